// Which path a thread starts, and how that leaves the camera.
#include "shared/thread.glsl"
#include "shared/which_path.glsl"
#include "shared/camera.glsl"
#include "shared/path_state.glsl"

// A permutation of thread_index that deals workgroups to STRIPES parts in turn. lavapipe gives each CPU thread one run of
// consecutive groups; without stripes some threads would trace sky only, and others all that is expensive. A GPU has one stripe.
layout(constant_id = 104) const uint STRIPES = 1u;

uint striped_index() {
    uint groups = gl_NumWorkGroups.x * gl_NumWorkGroups.y, stripe = groups / STRIPES, group = group_index();
    group = group < stripe * STRIPES ? group % STRIPES * stripe + group / STRIPES : group;
    return group * WORKGROUP + gl_LocalInvocationID.x;
}

// A permutation of indices that deals SPREAD threads in turn to pixels a stride apart, so that lanes side by side trace alike: paths of
// different lengths would wait for each other. Indices without a whole run around them stay as they are.
const uint SPREAD = 32u;
uint sparse_index(uint i, uint count) {
    uint run = SPREAD * push.constants.indirect_stride, at = i % run, first = i - at;
    return first + run > count ? i : first + at % SPREAD * push.constants.indirect_stride + at / SPREAD;
}

// The path of this thread; where there is none for it, which leaves it not `on`, the first.
uint thread_path(out bool on) {
    uint i = is_listed() ? striped_index() : thread_index(); // lists are ordered by pixel: stripes spread the work
    on = i < path_count();
    i = on ? i : 0u;
    return FX_SPARSE && !is_listed() ? sparse_index(i, path_count()) : i;
}

PathState eye_path(uint pixel, uint index, Sampler random) {
    Ray eye = eye_ray(film_sample(pixel, random), random);
    return path_state(eye.origin, eye.direction, FX_SPARSE && !is_traced_whole(pixel), path_seed(pixel, index));
}
