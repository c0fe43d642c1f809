#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/finite.glsl"

// Shades what the paths of a wavefront have met: adds the light that they have found and sends them on, or leaves their samples.
layout(local_size_x_id = 100) in;
layout(scalar, push_constant) uniform Push { PathPush push; };

#include "shared/path_step.glsl"
#include "shared/path_memory.glsl"
#include "shared/path_queue.glsl"
#include "shared/sample.glsl"

void main() {
    uint item = thread_index();
    if (item >= waiting()) return;
    uint i = waiting_path(item), pixel, index;
    if (!find_path(i, pixel, index)) return;
    Departure d;
    PathState p = saved_path(i, d);
    p.sharp_only = FX_SPARSE && !is_traced_whole(pixel);
    add_sampled(p, d, d.sampled, d.shadowed);
    Surface s;
    bool going = d.alive && arrive(p, s);
    if (going) d = leave(p, s, true, path_sampler(pixel, index));
    if (going && (d.alive || d.shadowed)) {
        save_path(i, p, d);
        wait_for_rays(i);
    } else {
        store_sample(i, pixel, p, false);
    }
}
