#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// Writes the counts of open pixels: their quotas and, Hamilton's second step, one more sample for the largest remainders,
// ties to the lower pixel index. `blocks` holds the exclusive scan of `ties`.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer weight; // of uint
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 2) uniform usamplerBuffer state; // of Apportionment
layout(scalar, binding = 3) readonly buffer Blocks { uvec2 blocks[]; };
layout(scalar, binding = 4) buffer Counts { uint count[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/share.glsl"

// What is certain of a pixel's count, and how much more it could take in order of index.
uvec2 certain_possible(Apportionment s, uint pixel) {
    if (push.limit != NONE && count[pixel] != NONE) return uvec2(count[pixel], 0u);
    uint64_t quota;
    uvec2 key;
    share_of(s, pixel, quota, key);
    uvec2 more = selected_tied(s, key);
    return s.forced != 0u ? uvec2(quota, room_of(pixel) - uint(quota)) : uvec2(uint(quota) + more.x, more.y);
}

void main() {
    Apportionment s = load_state();
    uint first = first_item(), items = item_count(first, push.pixels);
    uint64_t mine = 0UL, total;
    for (uint k = 0u; k < (s.whole_edge != 0u ? 0u : items); k++) mine += certain_possible(s, first + k).y;
    uint64_t before = block_scan(mine, total) + wide(blocks[gl_WorkGroupID.x]), needed = wide(s.needed);
    for (uint k = 0u; k < items; k++) {
        uint i = first + k;
        uvec2 counts = certain_possible(s, i);
        count[i] = counts.x + (before < needed ? uint(min(needed - before, uint64_t(counts.y))) : 0u);
        before += counts.y;
    }
}
