#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// Per block, how much its pixels could take in order of index: the equal remainders at the edge of the selection, or, when
// the repetitions ran out, all the room there is.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer weight; // of uint
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 2) uniform usamplerBuffer counts; // of uint
layout(binding = 3) uniform usamplerBuffer state; // of Apportionment
layout(scalar, binding = 4) writeonly buffer Blocks { uvec2 blocks[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/share.glsl"

void main() {
    Apportionment s = load_state();
    uint first = first_item(), items = item_count(first, push.pixels);
    uint64_t sum = 0UL;
    if (s.whole_edge != 0u) items = 0u; // nobody's order decides
    for (uint k = 0u; k < items; k++) {
        uint i = first + k;
        if (push.limit != NONE && texelFetch(counts, int(i)).x != NONE) continue;
        uint64_t quota;
        uvec2 key;
        share_of(s, i, quota, key);
        sum += s.forced != 0u ? room_of(i) - uint(quota) : selected_tied(s, key).y;
    }
    sum = block_sum(sum);
    if (gl_LocalInvocationIndex == 0u) blocks[gl_WorkGroupID.x] = unpackUint2x32(sum);
}
