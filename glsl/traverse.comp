#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "effects.glsl"
#include "shared/scene.glsl"

// Rays from a buffer, one per thread: traversal by itself, for its tests and its benchmark.
layout(local_size_x_id = 100) in;
layout(scalar, binding = 11) readonly buffer Rays { RayQuery rays[]; };
layout(scalar, binding = 12) writeonly buffer Hits { RayHit hits[]; };
layout(scalar, push_constant) uniform Push { TraversePush push; };

uint nodes_visited = 0u;

#include "shared/sampler.glsl"
#include "shared/texture.glsl"
#include "shared/traverse.glsl"

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) return; // safe: no barrier() follows
    RayQuery ray = rays[i];
    Hit hit;
    // Two calls with a constant each, as in path.comp.
    if (push.any_hit != 0u) hit = traverse(ray.origin, ray.direction, ray.t_max, true, push.root, ray.mask_seed);
    else hit = traverse(ray.origin, ray.direction, ray.t_max, false, push.root, ray.mask_seed);
    hits[i] = RayHit(hit.t, hit.triangle, hit.instance, hit.barycentric);
}
