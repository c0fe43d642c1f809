#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Finds the next digit of the sought remainder, counting keys from the largest digit down, and clears the histogram. One
// workgroup runs, each thread with four digits.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) buffer States { Apportionment state[]; };
layout(scalar, binding = 1) buffer Histogram { uint histogram[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

const uint THREAD_BINS = 256u / BLOCK_THREADS;

void main() {
    Apportionment s = state[0];
    if (s.selected != 0u) return; // safe: the same for all threads
    uint highest = 255u - gl_LocalInvocationIndex * THREAD_BINS; // thread 0 has the largest digits
    uint64_t mine = 0UL, total;
    for (uint k = 0u; k < THREAD_BINS; k++) mine += histogram[highest - k];
    uint64_t above = block_scan(mine, total), needed = join64(s.needed);
    uint shift = 24u - 8u * (push.step % 4u), word = push.step < 4u ? 1u : 0u; // high word first
    for (uint k = 0u; k < THREAD_BINS; k++) {
        uint digit = highest - k, here = histogram[digit];
        histogram[digit] = 0u;
        if (above < needed && needed <= above + here) {
            s.prefix[word] |= digit << shift;
            s.mask[word] |= 255u << shift;
            s.needed = unpackUint2x32(needed - above);
            s.whole_edge = needed - above == here ? 1u : 0u;
            bool last = 56u - 8u * push.step <= s.up; // all lower bits of the keys are 0
            s.selected = last ? 1u : s.whole_edge;
            state[0] = s;
        }
        above += here;
    }
}
