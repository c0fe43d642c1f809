#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// Hamilton's second step: one more sample to the largest remainders, ties to the lower pixel index. `blocks` holds the
// exclusive scan of `ties`.
layout(local_size_x = 256) in;
layout(binding = 0) uniform usamplerBuffer key; // of uvec2
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 2) readonly buffer States { Apportionment state[]; };
layout(scalar, binding = 3) readonly buffer Blocks { uvec2 blocks[]; };
layout(scalar, binding = 4) buffer Counts { uint count[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/tie.glsl"

void main() {
    Apportionment s = state[0];
    uint first = first_item();
    uint64_t mine = 0UL, total;
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels) continue;
        uvec2 words = uvec2(texelFetch(key, int(2u * i)).x, texelFetch(key, int(2u * i + 1u)).x);
        mine += beyond_quota(s, i, count[i], words).y;
    }
    uint64_t before = block_scan(mine, total) + wide(blocks[gl_WorkGroupID.x]), needed = wide(s.needed);
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels) continue;
        uvec2 words = uvec2(texelFetch(key, int(2u * i)).x, texelFetch(key, int(2u * i + 1u)).x);
        uvec2 more = beyond_quota(s, i, count[i], words);
        uint taken = before < needed ? uint(min(needed - before, uint64_t(more.y))) : 0u;
        count[i] += more.x + taken;
        before += more.y;
    }
}
