// Which paths a batch has. Path i of a batch is sample first_sample + i / pixels of pixel first_pixel + i % pixels, or that of a
// list. Needs `push` (PathPush).
#include "shared/sampler.glsl"
layout(binding = 13) uniform usamplerBuffer paths; // of uvec2

bool is_listed() { return FX_ADAPTIVE && push.samples == 0u; }

uint path_count() { return push.pixels * (is_listed() ? 1u : push.samples); }

bool is_traced_whole(uint pixel) {
    uvec2 at = uvec2(pixel % push.constants.size.x, pixel / push.constants.size.x);
    return all(equal(at % push.constants.indirect_stride, uvec2(0u)));
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
