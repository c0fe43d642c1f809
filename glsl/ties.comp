#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// Per block, how much its pixels could take in order of index: the equal remainders at the edge of the selection.
layout(local_size_x = 256) in;
layout(binding = 0) uniform usamplerBuffer key; // of uvec2
layout(binding = 1) uniform usamplerBuffer quotas; // of uint
layout(binding = 2) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 3) readonly buffer States { Apportionment state[]; };
layout(scalar, binding = 4) writeonly buffer Blocks { uvec2 blocks[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/tie.glsl"

void main() {
    Apportionment s = state[0];
    uint first = first_item();
    uint64_t sum = 0UL;
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels) continue;
        uvec2 words = uvec2(texelFetch(key, int(2u * i)).x, texelFetch(key, int(2u * i + 1u)).x);
        sum += beyond_quota(s, i, texelFetch(quotas, int(i)).x, words).y;
    }
    sum = block_sum(sum);
    if (gl_LocalInvocationIndex == 0u) blocks[gl_WorkGroupID.x] = unpackUint2x32(sum);
}
