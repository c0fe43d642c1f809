#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/frame.glsl"

// The first kernel of a wavefront (Laine, Karras, Aila 2013): a thread for each path of a batch, which leaves the camera. See
// path_memory.glsl for what it writes.
layout(local_size_x_id = 100) in;
layout(scalar, push_constant) uniform Push { PathPush push; };

#include "shared/eye_path.glsl"
#include "shared/path_memory.glsl"

void main() {
    bool on;
    uint i = thread_path(on), pixel, index;
    if (!on) return;
    Departure d;
    d.shadowed = false;
    d.shadow = Segment(vec3(0.0), vec3(0.0), 0.0, 0u);
    d.sampled = vec3(0.0);
    d.alive = find_path(i, pixel, index);
    save_path(i, eye_path(pixel, index, path_sampler(pixel, index)), d);
}
