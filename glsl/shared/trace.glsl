// What rays meet: found by the traversal of traverse.glsl, or in the form of a kernel with RAY_QUERY by the device itself.
#include "shared/traverse.glsl"
#ifdef RAY_QUERY
#include "shared/ray_query.glsl"
#else
// The closest hit of a ray that leaves no triangle.
Hit traverse(Segment ray, uint root) {
    RaySpace space = ray_space(ray.origin, ray.direction);
    Traversal t = traversal_start(ray.t_max, root);
    bool done;
    do {
        done = traversal_step(t, space, false, root, ray.mask_seed, uvec2(NONE));
    } while (!done);
    ended_early = ended_early || has_nodes_left(t);
    return t.hit;
}

// Finds out first, where `shadowed`, whether anything blocks `shadow`, which replaces `shadowed`; then, where `alive`, the closest
// hit of `ray`. Both rays leave the same triangle. In one loop, no lane waits for the slowest shadow ray.
Hit trace_shadow_then_closest(Segment shadow, inout bool shadowed, Segment ray, bool alive, uint root, uvec2 from) {
    RaySpace first = ray_space(shadow.origin, shadow.direction), second = ray_space(ray.origin, ray.direction);
    bool any_hit = shadowed, done;
    shadowed = false;
    if (FX_CLEAR_WALLS) wall_depth = uvec3(0u);
    Traversal t = traversal_start(any_hit ? shadow.t_max : ray.t_max, root);
    do {
        uint mask_seed = any_hit ? shadow.mask_seed : ray.mask_seed;
        done = traversal_step(t, select_ray(any_hit, first, second), any_hit, root, mask_seed, from);
        if (done && any_hit) {
            shadowed = t.hit.triangle != NONE;
            t = traversal_start(ray.t_max, root);
            any_hit = false;
            done = !alive;
        }
    } while (!done);
    ended_early = ended_early || any_hit || (alive && has_nodes_left(t));
    return t.hit;
}
#endif
