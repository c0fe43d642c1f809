// Keys of the radix selection: a remainder shifted left by Apportionment.up >= 1, so that all have the same number of digits; 64
// bits, low word first, bit 0 clear. Bit 0 marks FULL, the key of pixels that take no further sample.
const uvec2 FULL = uvec2(1u, 0u);

bool is_full(uvec2 key) { return (key.x & 1u) != 0u; }

// Returns (1 when the key is selected, 1 when it is tied and the order of index decides).
uvec2 selected_tied(Apportionment s, uvec2 key) {
    uvec2 part = key & s.mask;
    bool above = part.y > s.prefix.y || (part.y == s.prefix.y && part.x > s.prefix.x);
    bool edge = part == s.prefix, whole = s.whole_edge != 0u;
    return is_full(key) ? uvec2(0u) : uvec2(above || (edge && whole) ? 1u : 0u, edge && !whole ? 1u : 0u);
}
