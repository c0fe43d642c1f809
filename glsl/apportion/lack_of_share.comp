#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Turns wanted shares of all samples, past and next, into what a pixel lacks: max(0, floor(total * w / W) - count).
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform usamplerBuffer state; // of Apportionment
layout(scalar, binding = 2) buffer Weights { uint weight[]; };
layout(scalar, binding = 3) writeonly buffer Sums { BlockSums sums[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

#include "shared/load_apportionment.glsl"
#include "shared/proportion.glsl"

void main() {
    uint first = first_item(), items = item_count(first, push.pixels);
    Apportionment s = load_state();
    bool equal = s.equal != 0u;
    Proportion share_of = proportion_of(s);
    uint64_t total = 0UL;
    for (uint k = 0u; k < items; k++) {
        uint i = first + k;
        uint64_t share, rest;
        multiply_divide(share_of, equal ? 1u : weight[i], share, rest);
        uint have = texelFetch(stats, int(2u * i)).w;
        uint lack = share > have ? uint(min(share - have, 0xffffffffUL)) : 0u;
        weight[i] = lack;
        total += lack;
    }
    uint64_t weights = block_sum(total);
    if (gl_LocalInvocationIndex == 0u) {
        sums[gl_WorkGroupID.x] = BlockSums(unpackUint2x32(weights), uvec2(0u), uvec2(0u), 0u, 0u);
    }
}
