// Samples that are given in order of index: to equal keys at the edge of the selection or, if the repetitions were too few, to all
// pixels with room. Needs `key`, `stats`, `state` and `push`. Loops that may have no turn replace branches, which compilers for
// CPUs would run on both sides under masks, fetches included. A GPU gains nothing from that.
#include "shared/capacity.glsl"
#include "shared/remainder_key.glsl"

uvec2 key_of(uint pixel) { return texelFetch(key, int(pixel)).xy; }

// How many samples the pixels of a thread can take in that order.
uint64_t possible(Apportionment s, uint first, uint items) {
    uint forced = s.forced != 0u ? items : 0u, tied = s.forced + s.whole_edge == 0u ? items : 0u;
    uint64_t room = 0UL;
    uint ties = 0u;
    for (uint k = 0u; k < forced; k++) room += room_of(first + k) - quota_of(first + k);
    for (uint k = 0u; k < tied; k++) ties += selected_tied(s, key_of(first + k)).y;
    return room + ties;
}
