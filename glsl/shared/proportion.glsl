// Computes the budget's proportion to the weights once, in one thread, since 64-bit division is slow on every device.
void set_proportion(inout Apportionment s, uint64_t budget, uint64_t weights) {
    uint64_t d = max(weights, 1UL);
    bool small = budget <= 0xffffffffUL;
    s.budget = unpackUint2x32(budget);
    s.weights = unpackUint2x32(d);
    s.ratio = unpackUint2x32(small ? (budget << 32) / d : 0UL);
    s.whole = unpackUint2x32(small ? 0UL : budget / d);
    s.part = unpackUint2x32(small ? 0UL : budget % d);
    s.up = (d >> 32) != 0UL ? 30u - findMSB(uint(d >> 32)) : 62u - findMSB(uint(d));
}

Proportion proportion_of(Apportionment s) {
    return Proportion(join64(s.budget), join64(s.weights), join64(s.ratio), join64(s.whole), join64(s.part));
}
