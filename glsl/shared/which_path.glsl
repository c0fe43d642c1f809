// Which path a thread traces. Path i of a batch is sample first_sample + i / pixels of pixel first_pixel + i % pixels, or that of a
// list. Needs `push` (PathPush).
#include "shared/thread.glsl"
#include "shared/sampler.glsl"
layout(binding = 13) uniform usamplerBuffer paths; // of uvec2

bool is_listed() { return FX_ADAPTIVE && push.samples == 0u; }

uint path_count() { return push.pixels * (is_listed() ? 1u : push.samples); }

bool is_traced_whole(uint pixel) {
    uvec2 at = uvec2(pixel % push.constants.size.x, pixel / push.constants.size.x);
    return all(equal(at % push.constants.indirect_stride, uvec2(0u)));
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

// Whether path i is one: a list may be short.
bool find_path(uint i, out uint pixel, out uint index) {
    bool found = true;
    pixel = push.first_pixel + i % push.pixels;
    index = push.first_sample + i / push.pixels;
    if (is_listed()) {
        uvec2 path = texelFetch(paths, int(i)).xy;
        found = path.x != NONE;
        pixel = found ? path.x : push.first_pixel;
        index = path.y;
    }
    return found;
}

Sampler path_sampler(uint pixel, uint index) { return sampler_start(pixel, index, push.constants.seed); }
