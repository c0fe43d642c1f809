// PCG-RXS-M-XS as a hash, a bijection (Jarzynski and Olano 2020).
uint pcg(uint x) {
    x = x * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28) + 4u)) ^ x) * 277803737u;
    return (x >> 22) ^ x;
}

// In [0, 1): 24 bits, so that the conversion is exact and never rounds up to 1.
float unit_interval(uint bits) { return float(bits >> 8) * 5.9604644775390625e-8; }
