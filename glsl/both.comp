#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"

// Noise that the samples show, estimated among the surroundings that look alike, less what a geometry-aware filter will
// remove of it. A filter that gathers a share W of its window divides the variance by about 1 + W (pixels - 1): the
// deviation that is left is what needs samples. Where nothing is known of the noise yet, geometry alone decides.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer guides; // of Guide
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 2) uniform samplerBuffer importances; // of float
layout(scalar, binding = 3) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/noise.glsl"
#include "shared/similarity.glsl"

const int REACH = 2;
// Noise goes on where shape does: positions may be ten times as far apart as for importance. 1 / 0.2^2 of albedos.
const float POSITION_SHARE = 0.01;
const float ALBEDO_SCALE = 25.0;

// How much a neighbour's noise says of a pixel's, 0 to 1.
float kinship(uint p, uint q) {
    uvec4 a = guide_texel(p, 1u), b = guide_texel(q, 1u);
    vec3 normals = uintBitsToFloat(guide_texel(p, 0u).xyz) - uintBitsToFloat(guide_texel(q, 0u).xyz);
    vec3 positions = uintBitsToFloat(a.xyz) - uintBitsToFloat(b.xyz);
    vec3 albedos = uintBitsToFloat(guide_texel(p, 2u).xyz) - uintBitsToFloat(guide_texel(q, 2u).xyz);
    float x = dot(normals, normals) * push.normal_scale + dot(positions, positions) * push.position_scale * POSITION_SHARE +
              dot(albedos, albedos) * ALBEDO_SCALE;
    return (a.w == NONE) == (b.w == NONE) ? exp_negative(x) : 0.0;
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return; // safe: no barrier() follows
    ivec2 size = ivec2(push.size), at = ivec2(i % push.size.x, i / push.size.x);
    vec4 own = moments(i), around = own;
    for (int dy = -REACH; dy <= REACH; dy++) {
        for (int dx = -REACH; dx <= REACH; dx++) {
            ivec2 q = clamp(at + ivec2(dx, dy), ivec2(0), size - 1);
            uint neighbour = uint(q.y * size.x + q.x);
            around += neighbour == i ? vec4(0.0) : kinship(i, neighbour) * moments(neighbour);
        }
    }
    float gathered = push.filtered > 0.0 ? 1.0 - texelFetch(importances, int(i)).x : 0.0;
    priority[i] = noise(own, around) * sqrt(max(1.0 - push.filtered * gathered, 0.0));
}
