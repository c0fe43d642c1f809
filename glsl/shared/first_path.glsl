// Index of a pixel's first path in this round. The list of all paths, pixel by pixel, is dealt to the rounds like cards: path j
// goes to round j mod rounds. Needs `push` (round, rounds) and `offset`.
#include "shared/uint64.glsl"

uint64_t offset_of(uint pixel) {
    uint64_t all = join64(texelFetch(offset, int(pixel)).xy);
    return push.rounds == 1u ? all : (all + push.rounds - 1u - push.round) / push.rounds;
}
