#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Radix selection of the smallest remainder that still gets a sample: counts one 8-bit digit (`push.step`) of the keys that
// share the digits found so far. A thread has THREAD_ITEMS keys.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer key; // of uvec2
layout(binding = 1) uniform usamplerBuffer state; // of Apportionment
layout(scalar, binding = 2) buffer Histogram { uint histogram[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

shared uint bins[256];

void main() {
    Apportionment s = Apportionment_load(state, 0u);
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
}
