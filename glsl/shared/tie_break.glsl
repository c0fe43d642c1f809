// What the order of index decides: equal keys at the edge of the selection, or, when the repetitions ran out, all the room
// there is. Needs `key`, `stats`, `state` and `push`. Loops of no turn, not branches: compilers for CPUs run both sides of
// a branch under masks, fetches included.
#include "shared/capacity.glsl"
#include "shared/remainder_key.glsl"

uvec2 key_of(uint pixel) { return texelFetch(key, int(pixel)).xy; }

// How much the pixels of a thread could take in that order.
uint64_t possible(Apportionment s, uint first, uint items) {
    uint forced = s.forced != 0u ? items : 0u, tied = s.forced + s.whole_edge == 0u ? items : 0u;
    uint64_t room = 0UL;
    uint ties = 0u;
    for (uint k = 0u; k < forced; k++) room += room_of(first + k) - quota_of(first + k);
    for (uint k = 0u; k < tied; k++) ties += selected_tied(s, key_of(first + k)).y;
    return room + ties;
}
