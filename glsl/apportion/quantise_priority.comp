#include "shared/uint64.glsl"
#include "shared/block.glsl"
#include "shared/finite.glsl"

// First pass of an apportionment: turns priorities into integer weights, 12.20 fixed point, so that all that follows is
// exact. A priority that is not finite gets weight 0 and is counted. A workgroup sums one block; the last
// one starts the apportionment by the sums of all.
//
// The passes in order: quantise_priority; then lack, where weights are shares or errors; quota, repeated; radix_select for each of
// the remainders' 8 digits; tie_sums, give_remainders. The scan of the counts follows: reduce, offsets; and sample_list for every
// batch. The method is Hamilton's (largest remainders), with an upper limit for every pixel.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer priority; // of float
layout(scalar, binding = 1) writeonly buffer Weights { uint weight[]; };
layout(scalar, binding = 2) coherent buffer Sums { BlockSums sums[]; };
layout(scalar, binding = 3) buffer States { Apportionment state[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/start_apportionment.glsl"

const float FIXED_POINT = 1048576.0; // 2^20: the product is exact
const float MAX_PRIORITY = 4095.0;

void main() {
    uint first = first_unordered(), items = unordered_count(first, push.pixels);
    uint64_t total = 0UL;
    uint broken = 0u, positive = 0u;
    for (uint k = 0u; k < items; k++) {
        uint i = first + k * UNORDERED_STEP;
        float p = texelFetch(priority, int(i)).x;
        uint w = finite(p) && p > 0.0 ? uint(min(p, MAX_PRIORITY) * FIXED_POINT) : 0u;
        weight[i] = w;
        total += w;
        broken += finite(p) ? 0u : 1u;
        positive += w > 0u ? 1u : 0u;
    }
    uint64_t weights = block_sum(total);
    uvec2 counts = unpackUint2x32(block_sum(packUint2x32(uvec2(broken, positive))));
    BlockSums sum = BlockSums_zero();
    sum.weights = unpackUint2x32(weights);
    sum.settled = counts.x;
    sum.open = counts.y;
    start_apportionment(sum, false);
}
