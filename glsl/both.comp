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

// 1 / 0.2^2 of albedos. Pixels that look unlike still count a little: where all are, as in grass, there is no better source.
const float ALBEDO_SCALE = 25.0, LEAST_KINSHIP = 0.2;

struct Place {
    vec3 normal, albedo;
    bool hit;
};

Place place_at(uint pixel) {
    uvec4 albedo = guide_texel(pixel, 2u);
    return Place(uintBitsToFloat(guide_texel(pixel, 0u).xyz), uintBitsToFloat(albedo.xyz), albedo.w != NONE);
}

// How much a neighbour's noise says of a pixel's, 0 to 1.
float kinship(Place a, Place b) {
    vec3 normals = a.normal - b.normal, albedos = a.albedo - b.albedo;
    float x = dot(normals, normals) * push.normal_scale + dot(albedos, albedos) * ALBEDO_SCALE;
    return a.hit == b.hit ? max(exp_negative(x), LEAST_KINSHIP) : LEAST_KINSHIP;
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return; // safe: no barrier() follows
    ivec2 size = ivec2(push.size), at = ivec2(i % push.size.x, i / push.size.x);
    Place here = place_at(i);
    vec4 around = vec4(0.0);
    for (int dy = -1; dy <= 1; dy++) {
        for (int dx = -1; dx <= 1; dx++) {
            ivec2 q = clamp(at + ivec2(dx, dy), ivec2(0), size - 1);
            uint neighbour = uint(q.y * size.x + q.x);
            around += kinship(here, place_at(neighbour)) * moments(neighbour);
        }
    }
    float gathered = push.filtered > 0.0 ? 1.0 - texelFetch(importances, int(i)).x : 0.0;
    priority[i] = noise(moments(i), around) * sqrt(max(1.0 - push.filtered * gathered, 0.0));
}
