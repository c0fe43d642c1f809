#include "shared/uint64.glsl"
#include "shared/block.glsl"
#include "shared/proportion.glsl"

// Follows quota.comp: either prepares another repetition for what full pixels left, or starts the search for the largest
// remainders. One workgroup runs.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer Sums { BlockSums sums[]; };
layout(scalar, binding = 1) buffer States { Apportionment state[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

void main() {
    if (state[0].settled != 0u) return; // safe: the same for all threads
    uint blocks = block_count(push.pixels);
    uint64_t weights = 0UL, filled = 0UL, floors = 0UL, counts = 0UL;
    for (uint b = gl_LocalInvocationIndex; b < blocks; b += BLOCK_THREADS) {
        weights += join64(sums[b].weights);
        filled += join64(sums[b].filled);
        floors += join64(sums[b].floors);
        counts += join64(uvec2(sums[b].settled, sums[b].open));
    }
    weights = block_sum(weights);
    filled = block_sum(filled);
    floors = block_sum(floors);
    uvec2 pixels = unpackUint2x32(block_sum(counts));
    if (gl_LocalInvocationIndex != 0u) return;
    Apportionment s = state[0];
    uint64_t left = join64(s.budget) - filled;
    if (pixels.x > 0u && push.step + 1u < push.repetitions) {
        if (weights == 0UL && s.equal == 0u) { // all pixels of positive weight are full: the others share alike
            s.equal = 1u;
            weights = pixels.y;
        }
        set_proportion(s, left, weights);
    } else {
        s.settled = 1u;
        s.forced = pixels.x > 0u ? 1u : 0u;
        s.needed = unpackUint2x32(left - floors);
        s.prefix = uvec2(0u);
        s.mask = uvec2(0u);
        s.selected = 0u;
        s.whole_edge = 0u;
        // No sample is left for remainders, or room decides instead: a prefix above all keys selects none.
        if (left == floors || s.forced != 0u) {
            s.selected = 1u;
            s.whole_edge = 1u - s.forced;
            s.mask = uvec2(NONE);
            s.prefix = uvec2(NONE);
        }
    }
    state[0] = s;
}
