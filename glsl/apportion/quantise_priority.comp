#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Turns priorities into integer weights, 12.20 fixed point, so that all that follows is exact. A priority that is not
// finite weighs nothing and is counted. One workgroup sums one block.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer priority; // of float
layout(scalar, binding = 1) writeonly buffer Weights { uint weight[]; };
layout(scalar, binding = 2) writeonly buffer Sums { BlockSums sums[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

const float FIXED_POINT = 1048576.0; // 2^20: the product is exact
const float LARGEST = 4095.0;

void main() {
    uint first = first_item(), items = item_count(first, push.pixels);
    uint64_t total = 0UL;
    uint broken = 0u, positive = 0u;
    for (uint k = 0u; k < items; k++) {
        uint i = first + k;
        float p = texelFetch(priority, int(i)).x;
        bool finite = (floatBitsToUint(p) & 0x7f800000u) != 0x7f800000u;
        uint w = finite && p > 0.0 ? uint(min(p, LARGEST) * FIXED_POINT) : 0u;
        weight[i] = w;
        total += w;
        broken += finite ? 0u : 1u;
        positive += w > 0u ? 1u : 0u;
    }
    uint64_t weights = block_sum(total);
    uint64_t counts = block_sum(packUint2x32(uvec2(broken, positive)));
    if (gl_LocalInvocationIndex == 0u) {
        uvec2 both = unpackUint2x32(counts);
        sums[gl_WorkGroupID.x] = BlockSums(unpackUint2x32(weights), uvec2(0u), uvec2(0u), both.x, both.y);
    }
}
