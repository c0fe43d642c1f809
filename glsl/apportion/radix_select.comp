#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Finds the digit in which the sought remainder lies, counting from the largest, and clears the histogram.
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
    uint64_t above = block_scan(mine, total), needed = wide(s.needed);
    uint shift = 24u - 8u * (push.round % 4u), word = push.round < 4u ? 1u : 0u; // high word first
    for (uint k = 0u; k < THREAD_BINS; k++) {
        uint digit = highest - k, here = histogram[digit];
        histogram[digit] = 0u;
        if (above < needed && needed <= above + here) {
            s.prefix[word] |= digit << shift;
            s.mask[word] |= 255u << shift;
            s.needed = unpackUint2x32(needed - above);
            s.whole_edge = needed - above == here ? 1u : 0u;
            bool last = 56u - 8u * push.round <= s.up; // all lower bits are 0
            s.selected = last ? 1u : s.whole_edge;
            state[0] = s;
        }
        above += here;
    }
}
