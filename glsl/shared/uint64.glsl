// 64-bit words as pairs in buffers, low first, and exact proportions.
uint64_t wide(uvec2 pair) { return packUint2x32(pair); }

// How a * b / d is found for many b, 0 <= b <= d < 2^62: by a reciprocal while a has 32 bits, else bit by bit.
struct Proportion {
    uint64_t a, d;
    uint64_t ratio;       // floor(a * 2^32 / d), for a of 32 bits
    uint64_t whole, part; // a / d, a mod d, for others
};

// quotient = floor(a * b / d), rest = a * b mod d.
void multiply_divide(Proportion p, uint b, out uint64_t quotient, out uint64_t rest) {
    bool small = p.a <= 0xffffffffUL;
    quotient = small ? (p.ratio * b) >> 32 : 0UL; // less than 1 below a * b / d, and no overflow since b <= d
    rest = small ? p.a * b - quotient * p.d : 0UL;
    if (rest >= p.d) { rest -= p.d; quotient++; }
    // Horner's rule over the bits of b, reduced at every step. A count that is not constant keeps compilers for CPUs from
    // unrolling it and running it under a mask where it is not wanted.
    for (int bit = small ? -1 : 31; bit >= 0; bit--) {
        rest = 2UL * rest + (((b >> bit) & 1u) != 0u ? p.part : 0UL);
        quotient *= 2UL;
        if (rest >= p.d) { rest -= p.d; quotient++; }
        if (rest >= p.d) { rest -= p.d; quotient++; }
    }
    quotient += p.whole * b;
}
