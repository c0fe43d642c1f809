#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Replaces each weight by the samples that the pixel lacks to reach the error threshold t. The error of a mean of n samples
// is w / sqrt(n), so that it lacks ceil((w / t)^2) - n. It gets at most as many as it has (or INITIAL_SAMPLES), because its
// n samples are all that the noise is known from. A thread has THREAD_ITEMS pixels, a workgroup sums one block; the
// last one starts the apportionment by these.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 1) buffer Weights { uint weight[]; };
layout(scalar, binding = 2) coherent buffer Sums { BlockSums sums[]; };
layout(scalar, binding = 3) buffer States { Apportionment state[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/start_apportionment.glsl"

const uint INITIAL_SAMPLES = 4u;

void main() {
    uint first = first_unordered(), items = unordered_count(first, push.pixels);
    uint64_t per_sample = uint64_t(push.threshold) * push.threshold, total = 0UL;
    for (uint k = 0u; k < items; k++) {
        uint i = first + k * UNORDERED_STEP, w = weight[i], have = PixelStats_count(stats, i);
        uint64_t squared = uint64_t(w) * w, wanted = squared / per_sample;
        wanted += wanted * per_sample < squared ? 1UL : 0UL; // rounded up
        uint most = min(max(have, INITIAL_SAMPLES), push.enough - min(push.enough, have));
        uint lack = uint(min(max(wanted, have + 1UL) - have, uint64_t(most)));
        weight[i] = w > 0u ? lack : 0u;
        total += w > 0u ? lack : 0u;
    }
    uint64_t weights = block_sum(total);
    if (gl_LocalInvocationIndex == 0u) {
        BlockSums sum = BlockSums_zero();
        sum.weights = unpackUint2x32(weights);
        sums[gl_WorkGroupID.x] = sum;
    }
    start_apportionment(true);
}
