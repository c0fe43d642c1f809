// 64-bit words as pairs in buffers, low first, and exact proportions. Kernels that include this ask for int64 themselves.
uint64_t wide(uvec2 pair) { return packUint2x32(pair); }

// quotient = floor(a * b / d), rest = a * b mod d, for d > 0 and a quotient below 2^64; d < 2^62.
void multiply_divide(uint64_t a, uint b, uint64_t d, out uint64_t quotient, out uint64_t rest) {
    if (a <= 0xffffffffUL) { // the product fits
        uint64_t product = a * b;
        quotient = product / d;
        rest = product - quotient * d;
        return;
    }
    uint64_t whole = a / d, part = a - whole * d;
    quotient = 0UL;
    rest = 0UL;
    for (int bit = 31; bit >= 0; bit--) { // Horner's rule over the bits of b, reduced at every step
        rest = 2UL * rest + (((b >> bit) & 1u) != 0u ? part : 0UL);
        quotient *= 2UL;
        if (rest >= d) { rest -= d; quotient++; }
        if (rest >= d) { rest -= d; quotient++; }
    }
    quotient += whole * b;
}
