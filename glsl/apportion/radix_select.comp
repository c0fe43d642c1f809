#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Radix selection of the smallest remainder that still gets a sample: counts one 8-bit digit (`push.step`) of the keys that
// share the digits found so far. A thread has THREAD_ITEMS keys. The last workgroup finds the digit.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer key; // of uvec2
layout(scalar, binding = 1) buffer States { Apportionment state[]; };
layout(scalar, binding = 2) coherent buffer Histogram { uint histogram[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/last_block.glsl"

const uint THREAD_BINS = 256u / BLOCK_THREADS;

shared uint bins[256];

// Finds the digit, counting keys from the largest down, and clears the histogram. One workgroup runs, each thread with four digits.
void select_digit(Apportionment s) {
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

void main() {
    Apportionment s = state[0];
    if (s.selected != 0u) return; // safe: the same for all threads
    for (uint b = gl_LocalInvocationIndex; b < 256u; b += BLOCK_THREADS) bins[b] = 0u;
    barrier();
    uint first = first_unordered(), items = unordered_count(first, push.pixels);
    uint shift = 24u - 8u * (push.step % 4u);
    bool high = push.step < 4u; // the high word has the first four digits
    for (uint k = 0u; k < items; k++) {
        uvec2 word = texelFetch(key, int(first + k * UNORDERED_STEP)).xy;
        if ((word & s.mask) == s.prefix) atomicAdd(bins[((high ? word.y : word.x) >> shift) & 255u], 1u);
    }
    barrier();
    for (uint b = gl_LocalInvocationIndex; b < 256u; b += BLOCK_THREADS) {
        if (bins[b] > 0u) atomicAdd(histogram[b], bins[b]);
    }
    if (is_last_block()) select_digit(s);
}
