// PCG-RXS-M-XS as a hash, a bijection (Jarzynski and Olano 2020).
uint pcg(uint x) {
    x = x * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28) + 4u)) ^ x) * 277803737u;
    return (x >> 22) ^ x;
}

// In [0, 1): 24 bits, so that the conversion is exact and never rounds up to 1.
float unit_interval(uint bits) { return float(bits >> 8) * 5.9604644775390625e-8; }

const float BELOW_ONE = 0.99999994; // the largest number below 1

// A word that unit_interval makes `u` of, from 0 on, but for rounding down to 24 bits; 1 and more count as the largest number below.
// The other bits are those of `fill`.
uint word_of_unit(float u, uint fill) { return (uint(min(u, BELOW_ONE) * 16777216.0) << 8) | (fill & 0xffu); }
