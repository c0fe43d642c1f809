#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Replaces each weight by the samples that the pixel lacks: of its share of all samples or, with a threshold, of its accuracy. A thread
// has THREAD_ITEMS pixels, a workgroup sums one block; the last one starts the apportionment by these.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 1) buffer States { Apportionment state[]; };
layout(scalar, binding = 2) buffer Weights { uint weight[]; };
layout(scalar, binding = 3) coherent buffer Sums { BlockSums sums[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/start_apportionment.glsl"

const uint INITIAL_SAMPLES = 4u;

// The weight w is a share of all samples past and next, W the sum of the weights: max(0, floor(PARTS * total * w / W) - PARTS * count)
// parts of a sample.
uint lack_of_share(Proportion share_of, uint w, uint have) {
    uint64_t share, rest, parts = uint64_t(PARTS) * have;
    multiply_divide(share_of, w, share, rest);
    return share > parts ? uint(min(share - parts, 0xffffffffUL)) : 0u;
}

// The weight w is an error. That of a mean of n samples is w / sqrt(n), so that ceil((w / t)^2) - n are lacking for the threshold t. The
// pixel gets at most as many as it has (or INITIAL_SAMPLES), because its n samples are all that the noise is known from.
uint lack_of_accuracy(uint64_t per_sample, uint w, uint have) {
    uint64_t squared = uint64_t(w) * w, wanted = squared / per_sample;
    wanted += wanted * per_sample < squared ? 1UL : 0UL; // rounded up
    uint most = min(max(have, INITIAL_SAMPLES), push.enough - min(push.enough, have));
    uint lack = uint(min(max(wanted, have + 1UL) - have, uint64_t(most)));
    return w > 0u ? lack : 0u;
}

void main() {
    uint first = first_unordered(), items = unordered_count(first, push.pixels);
    Apportionment s = state[0];
    bool equal = s.equal != 0u;
    Proportion share_of = proportion_of(s);
    uint64_t per_sample = uint64_t(push.threshold) * push.threshold, total = 0UL;
    for (uint k = 0u; k < items; k++) {
        uint i = first + k * UNORDERED_STEP, have = PixelStats_count(stats, i), lack;
        if (push.threshold != 0u) lack = lack_of_accuracy(per_sample, weight[i], have);
        else lack = lack_of_share(share_of, equal ? 1u : weight[i], have);
        weight[i] = lack;
        total += lack;
    }
    BlockSums sum = BlockSums_zero();
    sum.weights = unpackUint2x32(block_sum(total));
    start_apportionment(sum, true);
}
