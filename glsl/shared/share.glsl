// A pixel's share of the budget. Found again wherever it is needed, which costs no more than to store and load it. Needs
// `weight`, `stats`, `state` and `push`.
#include "shared/proportion.glsl"
#include "shared/state.glsl"

uint weight_of(Apportionment s, uint pixel) { return s.equal != 0u ? 1u : texelFetch(weight, int(pixel)).x; }

// The quota, and the remainder as a key, high word second.
void share_of(Apportionment s, uint pixel, out uint64_t quota, out uvec2 key) {
    uint64_t rest;
    multiply_divide(proportion_of(s), weight_of(s, pixel), quota, rest);
    key = unpackUint2x32(rest << s.up);
}

uint room_of(uint pixel) {
    if (push.limit == NONE) return NONE;
    uint have = texelFetch(stats, int(7u * pixel + 3u)).x;
    return have < push.limit ? push.limit - have : 0u;
}

// Of a key: (1 when it is selected, 1 when its order of index decides).
uvec2 selected_tied(Apportionment s, uvec2 key) {
    uvec2 part = key & s.mask;
    bool above = part.y > s.prefix.y || (part.y == s.prefix.y && part.x > s.prefix.x);
    bool edge = part == s.prefix, whole = s.whole_edge != 0u;
    return uvec2(above || (edge && whole) ? 1u : 0u, edge && !whole ? 1u : 0u);
}
