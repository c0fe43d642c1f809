#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"

// Traces the rays of a wavefront: of each path that waits the shadow ray, then the one to its next surface. A thread takes paths one
// after the other, so that none waits for the slowest of its neighbours. An H200 takes longer where a subgroup takes paths once a
// quarter of its rays have ended (1.02 of the time), where shadow rays have a dispatch of their own (1.07), or where paths are listed
// by the octant of their direction (1.46); where they are listed in tiles of pixels it takes as long.
layout(local_size_x_id = 100) in;
layout(scalar, push_constant) uniform Push { PathPush push; };

const uint PATHS_A_THREAD = 8u; // from the first surface on, where all paths of a batch wait

#include "shared/trace.glsl"
#include "shared/path_memory.glsl"
#include "shared/path_queue.glsl"
#include "shared/counters.glsl"

// The first path from `item` on that waits for a ray: of a list that is short, some do not.
uint next_item(uint item, uint stride, uint count) {
    while (item < count && !any(waits_for(waiting_path(item)))) item += stride;
    return item;
}

#ifdef RAY_QUERY
void trace_rays(uint item, uint stride, uint count) {
    for (; item < count; item = next_item(item + stride, stride, count)) {
        uint i = waiting_path(item);
        bvec2 waits = waits_for(i);
        bool blocked = waits.x;
        Segment shadow = saved_ray(i, true), next = saved_ray(i, false);
        Hit hit = trace_shadow_then_closest(shadow, blocked, next, waits.y, push.constants.root, saved_from(i));
        if (blocked) block_light(i);
        else if (waits.x) dim_light(i);
        save_hit(i, hit);
    }
}
#else
void trace_rays(uint item, uint stride, uint count) {
    uint i = waiting_path(item);
    bvec2 waits = waits_for(i);
    bool any_hit = waits.x, on = true;
    Segment ray = saved_ray(i, any_hit);
    RaySpace space = ray_space(ray.origin, ray.direction);
    uvec2 from = saved_from(i);
    Traversal t = traversal_start(ray.t_max, push.constants.root);
    do {
        if (traversal_step(t, space, any_hit, push.constants.root, ray.mask_seed, from)) {
            if (!any_hit) save_hit(i, t.hit);
            else if (t.hit.triangle != NONE) block_light(i);
            else dim_light(i);
            if (FX_CLEAR_WALLS) wall_depth = uvec3(0u);
            if (any_hit && waits.y) {
                any_hit = false;
            } else {
                item = next_item(item + stride, stride, count);
                on = item < count;
                i = waiting_path(on ? item : 0u);
                waits = waits_for(i);
                any_hit = waits.x;
                from = saved_from(i);
            }
            ray = saved_ray(i, any_hit);
            space = ray_space(ray.origin, ray.direction);
            t = traversal_start(ray.t_max, push.constants.root);
        }
    } while (on);
}
#endif

void main() {
    uint thread = thread_index(), stride = gl_NumWorkGroups.x * gl_NumWorkGroups.y * WORKGROUP, count = waiting();
    if (thread == 0u) empty_next_queue();
    uint item = next_item(thread, stride, count);
    if (item >= count) return;
    trace_rays(item, stride, count);
    if (FX_COUNTERS) count_up(2u, nodes_visited);
}
