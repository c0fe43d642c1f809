// 64-bit integers, which buffers hold as pairs of words, low word first, and exact proportions of them.
uint64_t join64(uvec2 pair) { return packUint2x32(pair); }

// Precomputed for a * b / d with many b, 0 <= b <= d < 2^62: by a reciprocal while a has 32 bits, else bit by bit.
struct Proportion {
    uint64_t a, d;
    uint64_t ratio;       // floor(a * 2^32 / d), for a of 32 bits
    uint64_t whole, part; // a / d and a mod d, for larger a
};

// quotient = floor(a * b / d), rest = a * b mod d.
void multiply_divide(Proportion p, uint b, out uint64_t quotient, out uint64_t rest) {
    bool small = p.a <= 0xffffffffUL;
    quotient = small ? (p.ratio * b) >> 32 : 0UL; // less than 1 below a * b / d, and no overflow since b <= d
    rest = small ? p.a * b - quotient * p.d : 0UL;
    if (rest >= p.d) { rest -= p.d; quotient++; }
    // Horner's rule over the bits of b, reduced modulo d at every step. Since the number of turns is not a constant, compilers for
    // CPUs do not unroll the loop and run it under a mask where a is small.
    for (int bit = small ? -1 : 31; bit >= 0; bit--) {
        rest = 2UL * rest + (((b >> bit) & 1u) != 0u ? p.part : 0UL);
        quotient *= 2UL;
        if (rest >= p.d) { rest -= p.d; quotient++; }
        if (rest >= p.d) { rest -= p.d; quotient++; }
    }
    quotient += p.whole * b;
}
