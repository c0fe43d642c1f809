#include "shared/uint64.glsl"
#include "shared/block.glsl"
#include "shared/proportion.glsl"

// Adds up the sums of all blocks and starts an apportionment by them. One workgroup runs, after quantise_priority.comp
// (`push.step` 0) and again after lack_of_share.comp or lack_of_accuracy.comp (`push.step` 1).
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer Sums { BlockSums sums[]; };
layout(scalar, binding = 1) buffer States { Apportionment state[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

void main() {
    uint blocks = block_count(push.pixels);
    uint64_t weights = 0UL, counts = 0UL;
    for (uint b = gl_LocalInvocationIndex; b < blocks; b += BLOCK_THREADS) {
        weights += join64(sums[b].weights);
        counts += join64(uvec2(sums[b].settled, sums[b].open));
    }
    weights = block_sum(weights);
    counts = block_sum(counts);
    if (gl_LocalInvocationIndex != 0u) return;
    Apportionment s = state[0];
    s.equal = weights == 0UL ? 1u : 0u; // no pixel has a weight: all share alike
    bool deficit_next = push.step == 0u && push.total != uvec2(0u);
    uint64_t budget = join64(deficit_next ? push.total : push.budget);
    if (push.step == 1u && push.threshold != 0u) budget = min(budget, weights); // not more than all pixels lack
    set_proportion(s, budget, weights == 0UL ? uint64_t(push.pixels) : weights);
    if (push.step == 0u) { // the counts of quantise_priority.comp
        s.non_finite = unpackUint2x32(counts).x;
        s.wanting = unpackUint2x32(counts).y;
    }
    s.settled = 0u;
    s.forced = 0u;
    state[0] = s;
}
