#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"

// Traces rays from a buffer, for the tests and the benchmark of traversal. Thread i of n traces rays i, i + n, i + 2n ... A
// lane that has finished a ray takes its next one instead of waiting for the slowest of its neighbours.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer rays; // of RayQuery
layout(scalar, binding = 12) writeonly buffer Hits { RayHit hits[]; };
layout(constant_id = 110) const bool BEHIND = false; // finds what a ray meets that leaves its first hit
layout(scalar, push_constant) uniform Push { TraversePush push; };

#include "shared/trace.glsl"
#include "shared/deal.glsl"

// Of rays, shadow rays alone pass walls.
Segment ray_at(uint i) {
    RayQuery ray = RayQuery_load(rays, i);
    wall_depth = uvec3(0u);
    return Segment(ray.origin, ray.direction, ray.t_max, push.any_hit != 0u ? ray.mask_seed : mask_bits(ray.mask_seed));
}

void write_hit(uint i, Hit hit) {
    hits[i].t = hit.t;
    hits[i].triangle = hit.triangle;
    hits[i].instance = hit.instance;
    hits[i].barycentric = vec2(hit.b1, hit.b2);
}

Hit behind(Segment ray, bool any_hit) {
    Hit first = traverse(ray, push.root);
    bool blocked = any_hit;
    Hit hit = trace_shadow_then_closest(ray, blocked, ray, !any_hit, push.root, uvec2(first.triangle, first.instance));
    if (blocked) hit.triangle = 0u; // or any other
    return hit;
}

void main() {
    bool any_hit = push.any_hit != 0u;
    uint i = thread_index(), stride = gl_NumWorkGroups.x * gl_NumWorkGroups.y * WORKGROUP;
    bool on = i < push.count;
    if (!DEALT && !on) return;
    if (BEHIND) {
        for (; i < push.count; i += stride) write_hit(i, behind(ray_at(i), any_hit));
        return;
    }
#ifdef RAY_QUERY
    for (; i < push.count; i += stride) write_hit(i, query_hit(ray_at(i), any_hit, push.root, uvec2(NONE)));
#else
    Segment ray = ray_at(i);
    Walk w = walk_start(ray, ray_space(ray.origin, ray.direction), on, any_hit, push.root);
    if (any_lane(on)) do {
        bool ends;
        if (DEALT) {
            walk_on(w, push.root, uvec2(NONE));
            look_apart(w, uvec2(NONE));
            ends = has_ended(w);
        } else ends = traversal_step(w.t, w.world, any_hit, push.root, w.mask_seed, uvec2(NONE));
        if (ends) {
            write_hit(i, w.t.hit);
            i += stride;
            on = i < push.count;
            ray = ray_at(i);
            w = walk_start(ray, ray_space(ray.origin, ray.direction), on, any_hit && on, push.root);
        }
    } while (any_lane(on));
#endif
}
