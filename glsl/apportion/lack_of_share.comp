#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Replaces each weight w, a share of all samples past and next, by the samples that the pixel lacks of that share:
// max(0, floor(total * w / W) - count), W the sum of the weights. A thread has THREAD_ITEMS pixels, a workgroup sums one block;
// the last one starts the apportionment by these.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 1) buffer States { Apportionment state[]; };
layout(scalar, binding = 2) buffer Weights { uint weight[]; };
layout(scalar, binding = 3) coherent buffer Sums { BlockSums sums[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/start_apportionment.glsl"

void main() {
    uint first = first_unordered(), items = unordered_count(first, push.pixels);
    Apportionment s = state[0];
    bool equal = s.equal != 0u;
    Proportion share_of = proportion_of(s);
    uint64_t total = 0UL;
    for (uint k = 0u; k < items; k++) {
        uint i = first + k * UNORDERED_STEP;
        uint64_t share, rest;
        multiply_divide(share_of, equal ? 1u : weight[i], share, rest);
        uint have = PixelStats_count(stats, i);
        uint lack = share > have ? uint(min(share - have, 0xffffffffUL)) : 0u;
        weight[i] = lack;
        total += lack;
    }
    uint64_t weights = block_sum(total);
    if (gl_LocalInvocationIndex == 0u) {
        BlockSums sum = BlockSums_zero();
        sum.weights = unpackUint2x32(weights);
        sums[gl_WorkGroupID.x] = sum;
    }
    start_apportionment(true);
}
