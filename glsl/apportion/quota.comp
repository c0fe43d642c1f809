#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Hamilton's first step: computes the quota floor(budget * weight / weights) of every pixel that is still open, and its
// remainder as a key. A pixel whose quota is no less than its room becomes full: it gets its room, and the rest is apportioned
// again by a repetition of this pass. A thread has THREAD_ITEMS pixels, a workgroup sums one block; the last one prepares that
// repetition, or the search for the largest remainders.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer weight; // of uint
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 2) buffer States { Apportionment state[]; };
layout(scalar, binding = 3) buffer Keys { uint64_t key[]; }; // of uvec2
layout(scalar, binding = 4) writeonly buffer Counts { uint count[]; };
layout(scalar, binding = 5) coherent buffer Sums { BlockSums sums[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/proportion.glsl"
#include "shared/capacity.glsl"
#include "shared/remainder_key.glsl"
#include "shared/last_block.glsl"

// Prepares another repetition for what full pixels left, or the search for the largest remainders. One workgroup runs.
void redistribute() {
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

void main() {
    Apportionment s = state[0];
    if (s.settled != 0u) return; // safe: the same for all threads
    uint first = first_unordered(), items = unordered_count(first, push.pixels);
    Proportion share_of = proportion_of(s);
    bool equal = s.equal != 0u;
    uint64_t weights = 0UL, filled = 0UL, floors = 0UL;
    uint settled = 0u, open = 0u;
    for (uint k = 0u; k < items; k++) {
        uint i = first + k * UNORDERED_STEP;
        if (push.step > 0u && is_full(unpackUint2x32(key[i]))) continue;
        uint w = equal ? 1u : texelFetch(weight, int(i)).x, room = room_of(i);
        uint64_t quota, rest;
        multiply_divide(share_of, w, quota, rest);
        bool full = quota >= room;
        count[i] = full ? room : uint(quota);
        key[i] = full ? packUint2x32(FULL) : rest << s.up;
        filled += full ? room : 0u;
        floors += full ? 0UL : quota;
        weights += full ? 0u : w;
        settled += full ? 1u : 0u;
        open += full ? 0u : 1u;
    }
    weights = block_sum(weights);
    filled = block_sum(filled);
    floors = block_sum(floors);
    uvec2 counts = unpackUint2x32(block_sum(packUint2x32(uvec2(settled, open))));
    if (gl_LocalInvocationIndex == 0u) {
        BlockSums sum = BlockSums_zero();
        sum.weights = unpackUint2x32(weights);
        sum.filled = unpackUint2x32(filled);
        sum.floors = unpackUint2x32(floors);
        sum.settled = counts.x;
        sum.open = counts.y;
        sums[gl_WorkGroupID.x] = sum;
    }
    if (is_last_block()) redistribute();
}
