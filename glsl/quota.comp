#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// Hamilton's first step: every open pixel's quota, floor(budget * weight / weights), and the remainder as its key. A
// pixel whose quota is no less than its room is settled at its room; what it leaves is apportioned again.
layout(local_size_x = 256) in;
layout(binding = 0) uniform usamplerBuffer weight; // of uint
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 2) readonly buffer States { Apportionment state[]; };
layout(scalar, binding = 3) writeonly buffer Counts { uint count[]; };
layout(scalar, binding = 4) buffer Keys { uvec2 key[]; };
layout(scalar, binding = 5) writeonly buffer Sums { BlockSums sums[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

void main() {
    if (state[0].settled != 0u) return; // safe: the same for all threads
    uint first = first_item();
    uint64_t budget = wide(state[0].budget), all = wide(state[0].weights);
    bool equal = state[0].equal != 0u;
    uint64_t weights = 0UL, filled = 0UL, floors = 0UL;
    uint settled = 0u, open = 0u;
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels) continue;
        if (push.round > 0u && key[i] == uvec2(NONE)) continue;
        uint have = texelFetch(stats, int(7u * i + 3u)).x;
        uint room = have < push.limit ? push.limit - have : 0u;
        uint w = equal ? 1u : texelFetch(weight, int(i)).x;
        uint64_t quota = 0UL, rest = 0UL;
        if (w > 0u) multiply_divide(budget, w, all, quota, rest);
        bool full = quota >= room;
        count[i] = full ? room : uint(quota);
        key[i] = full ? uvec2(NONE) : unpackUint2x32(rest);
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
        sums[gl_WorkGroupID.x] = BlockSums(unpackUint2x32(weights), unpackUint2x32(filled), unpackUint2x32(floors),
                                           counts.x, counts.y);
    }
}
