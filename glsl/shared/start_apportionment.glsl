// Starts an apportionment by weights, which are summed in `sums`. Needs `sums`, `state` and `push`.
#include "shared/last_block.glsl"
#include "shared/proportion.glsl"

// Parts of a sample in which pixels lack samples of their share: in whole ones, rounds of few samples would not tell pixels apart, and
// those at the top of the film would get them.
const uint PARTS = 64u;

// To be called by all threads with the sums of their block; the last workgroup does it. `again`: after the weights were replaced by what
// pixels lack.
void start_apportionment(BlockSums sum, bool again) {
    if (gl_LocalInvocationIndex == 0u) sums[gl_WorkGroupID.x] = sum;
    if (!is_last_block()) return; // safe: the same for all threads
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
    bool deficit_next = !again && push.total != uvec2(0u);
    uint64_t budget = deficit_next ? PARTS * join64(push.total) : join64(push.budget);
    if (again && push.threshold != 0u) budget = min(budget, weights); // not more than all pixels lack
    set_proportion(s, budget, weights == 0UL ? uint64_t(push.pixels) : weights);
    if (!again) { // the counts of quantise_priority.comp
        s.non_finite = unpackUint2x32(counts).x;
        s.wanting = unpackUint2x32(counts).y;
    }
    s.settled = 0u;
    s.forced = 0u;
    state[0] = s;
}
