#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"

// Traces rays from a buffer, for the tests and the benchmark of traversal. Thread i of n traces rays i, i + n, i + 2n ... A
// lane that has finished a ray takes its next one instead of waiting for the slowest of its neighbours.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer rays; // of RayQuery
layout(scalar, binding = 12) writeonly buffer Hits { RayHit hits[]; };
layout(scalar, push_constant) uniform Push { TraversePush push; };

uint nodes_visited = 0u;

#include "shared/sampler.glsl"
#include "shared/texture.glsl"
#include "shared/traverse.glsl"

Segment ray_at(uint i) {
    RayQuery ray = RayQuery_load(rays, i);
    return Segment(ray.origin, ray.direction, ray.t_max, ray.mask_seed);
}

void main() {
    bool any_hit = push.any_hit != 0u, done = true;
    Traversal t = traversal_start(0.0, push.root);
    uint i = thread_index(), stride = gl_NumWorkGroups.x * gl_NumWorkGroups.y * WORKGROUP;
    if (i >= push.count) return;
    do {
        Segment ray = ray_at(i); // fetched at every step: on lavapipe faster than keeping it, on a GPU slower
        if (done) t = traversal_start(ray.t_max, push.root);
        RaySpace space = ray_space(ray.origin, ray.direction);
        done = traversal_step(t, space, any_hit, push.root, ray.mask_seed, uvec2(NONE));
        if (done) {
            hits[i].t = t.hit.t;
            hits[i].triangle = t.hit.triangle;
            hits[i].instance = t.hit.instance;
            hits[i].barycentric = vec2(t.hit.b1, t.hit.b2);
            i += stride;
        }
    } while (i < push.count);
}
