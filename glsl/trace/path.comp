#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"
#include "shared/finite.glsl"
#include "shared/store64.glsl"

// Traces one camera path per thread.
// Thread i traces sample first_sample + i / pixels of pixel first_pixel + i % pixels, or path i of a list. It writes one vec4
// (radiance), or three with FX_SPLIT (direct, indirect, the albedo to divide indirect by). With FX_SOFT what lamps and sky bring
// to the first hit goes with indirect light, since it is as noisy. w of the first is the number of
// rays, negated where the light was not finite: such a sample is black.
layout(local_size_x_id = 100) in;
layout(scalar, binding = 11) writeonly buffer Samples { u64vec2 samples[]; }; // of vec4
layout(scalar, binding = 12) buffer Counters { uint counters[]; };
layout(binding = 13) uniform usamplerBuffer paths; // of uvec2
layout(scalar, binding = 14) buffer Broken { BrokenTally broken[]; };
layout(scalar, push_constant) uniform Push { PathPush push; };

uint nodes_visited = 0u;

#include "shared/sampler.glsl"
#include "shared/warp.glsl"
#include "shared/fresnel.glsl"
#include "shared/microfacet.glsl"
#include "shared/bsdf.glsl"
#include "shared/texture.glsl"
#include "shared/camera.glsl"
#include "shared/traverse.glsl"
#include "shared/trace.glsl"
#include "shared/deal.glsl"
#include "shared/surface.glsl"
#include "shared/light.glsl"
#include "shared/trace_path.glsl"

// Adds to a 64-bit counter made of two words, since 64-bit atomics are not a required feature.
void count(uint slot, uint n) {
    uint before = atomicAdd(counters[2u * slot], n);
    if (before + n < before) atomicAdd(counters[2u * slot + 1u], 1u);
}

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

void main() {
    bool listed = FX_ADAPTIVE && push.samples == 0u;
    uint i = listed ? striped_index() : thread_index(); // lists are ordered by pixel: stripes spread the work
    bool on = i < push.pixels * (listed ? 1u : push.samples);
    if (!DEALT && !on) return;
    i = on ? i : 0u;
    if (FX_SPARSE && !listed) i = sparse_index(i, push.pixels * push.samples);
    uint pixel = push.first_pixel + i % push.pixels;
    uint index = push.first_sample + i / push.pixels;
    if (listed) {
        uvec2 path = texelFetch(paths, int(i)).xy;
        pixel = path.x;
        index = path.y;
        on = on && pixel != NONE;
        if (!DEALT && !on) return;
        pixel = on ? pixel : push.first_pixel;
    }
    bool sharp_only = FX_SPARSE && !is_traced_whole(pixel);
    Sampler random = sampler_start(pixel, index, push.constants.seed);
    Ray ray = eye_ray(film_sample(pixel, random), random);
    Path path = Path(ray.origin, ray.direction, vec3(1.0), 0.0, true, 1.0);
    uint seed = path_seed(pixel, index);
    Segment eye = Segment(path.origin, path.direction, INFINITE_DISTANCE, pcg(seed));
    Hit first;
    // The rays of neighbours meet the same triangles, so that dealing them would not pay; masks and spheres are looked at less often.
    if (DEALT && APART) first = deal_closest(eye, on, push.constants.root);
    else first = traverse(eye, push.constants.root);
    vec3 albedo;
    SplitLight light = trace_path(path, on, sharp_only, first, random, seed, albedo);
    if (!on) return;
    float rays = float(closest_rays + any_rays);
    if (!finite(light.direct + light.indirect)) {
        light = SplitLight(vec3(0.0), vec3(0.0), vec3(0.0));
        rays = -rays;
        atomicMax(broken[0].lowest, ~pixel);
    }
    if (FX_SPLIT) {
        samples[3u * i] = pack64(vec4(light.direct, rays));
        samples[3u * i + 1u] = pack64(vec4(light.indirect, 0.0));
        samples[3u * i + 2u] = pack64(vec4(albedo, 0.0));
    } else {
        samples[i] = pack64(vec4(light.direct + light.indirect, rays));
    }
    if (FX_COUNTERS) {
        count(0u, closest_rays);
        count(1u, any_rays);
        count(2u, nodes_visited);
    }
}
