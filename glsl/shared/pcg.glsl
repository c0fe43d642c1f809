// PCG-RXS-M-XS as a hash, a bijection (Jarzynski and Olano 2020).
uint pcg(uint x) {
    x = x * 747796405u + 2891336453u;
    x = ((x >> ((x >> 28) + 4u)) ^ x) * 277803737u;
    return (x >> 22) ^ x;
}
