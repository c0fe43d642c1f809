#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// Counts one digit of the remainders that still share the prefix of the one sought (radix selection).
layout(local_size_x = 256) in;
layout(binding = 0) uniform usamplerBuffer key; // of uvec2
layout(scalar, binding = 1) readonly buffer States { Apportionment state[]; };
layout(scalar, binding = 2) buffer Histogram { uint histogram[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

shared uint bins[2048];

void main() {
    Apportionment s = state[0];
    if (s.selected != 0u) return; // safe: the same for all threads
    for (uint b = gl_LocalInvocationIndex; b < 2048u; b += BLOCK_THREADS) bins[b] = 0u;
    barrier();
    uint first = first_item();
    uint64_t prefix = wide(s.prefix);
    uint mask = (1u << s.digit_bits) - 1u;
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels) continue;
        uvec2 words = uvec2(texelFetch(key, int(2u * i)).x, texelFetch(key, int(2u * i + 1u)).x);
        if (words == uvec2(NONE)) continue;
        uint64_t digits = wide(words) >> s.shift;
        if (digits >> s.digit_bits == prefix) atomicAdd(bins[uint(digits) & mask], 1u);
    }
    barrier();
    for (uint b = gl_LocalInvocationIndex; b < 2048u; b += BLOCK_THREADS) {
        if (bins[b] > 0u) atomicAdd(histogram[b], bins[b]);
    }
}
