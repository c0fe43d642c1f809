#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"
#include "shared/finite.glsl"

// Traces one camera path per thread, from its first ray to its last: see which_path.glsl for which, and sample.glsl for what it writes.
layout(local_size_x_id = 100) in;
layout(scalar, push_constant) uniform Push { PathPush push; };

#include "shared/trace_path.glsl"
#include "shared/eye_path.glsl"
#include "shared/sample.glsl"

void main() {
    bool on;
    uint i = thread_path(on), pixel, index;
    if (!DEALT && !on) return;
    on = find_path(i, pixel, index) && on;
    if (!DEALT && !on) return;
    Sampler random = path_sampler(pixel, index);
    PathState p = eye_path(pixel, index, random);
    // The rays of neighbours meet the same triangles, so that dealing them would not pay; masks and spheres are looked at less often.
    if (DEALT && APART) p.hit = deal_closest(next_segment(p), on, push.constants.root);
    else p.hit = traverse(next_segment(p), push.constants.root);
    trace_path(p, on, random);
    if (!on) return;
    store_sample(i, pixel, p, ended_early);
    if (FX_COUNTERS) count_up(2u, nodes_visited);
}
