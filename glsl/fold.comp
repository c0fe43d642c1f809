#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/wide.glsl"
#include "shared/paired.glsl"

// Adds a batch of samples to the statistics of their pixels. One thread folds one pixel, in order of sample index, so
// the result does not depend on how samples were batched (Welford 1962).
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer samples; // of vec4
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 2) uniform samplerBuffer light; // of PixelLight
layout(binding = 3) uniform usamplerBuffer offset; // of uvec2
layout(scalar, binding = 4) writeonly buffer Stats { u64vec4 folded_stats[]; }; // of PixelStats
layout(scalar, binding = 5) writeonly buffer Lights { u64vec3 folded_light[]; }; // of PixelLight
layout(scalar, push_constant) uniform Push { FoldPush push; };

#include "shared/offset.glsl"
#include "shared/rounds.glsl"
#include "shared/pixel_light.glsl"

const uint PLAIN = 2048u; // see shared/rounds.glsl

// A channel whose albedo is below this cannot be divided out; its light stays with the direct light.
const float SMALLEST_ALBEDO = 1e-6;

// Where a pixel's samples lie in the batch: (first, step, number).
uvec3 samples_of(uint i, uint pixel) {
    if (!FX_ADAPTIVE || push.samples > 0u) return uvec3(i, push.pixels, push.samples);
    uint64_t begin = wide(push.first_path), end = begin + push.paths;
    uint64_t from = max(offset_of(pixel), begin), to = min(offset_of(pixel + 1u), end);
    return uvec3(uint(from - begin), 1u, to > from ? uint(to - from) : 0u);
}

void fold(inout PixelStats s, inout PixelLight l, int at) {
    vec4 first = texelFetch(samples, FX_SPLIT ? 3 * at : at); // w is the rays of the sample
    vec3 radiance = first.rgb;
    s.count++;
    s.rays += uint(first.w);
    float share = 1.0 / float(s.count);
    if (FX_SPLIT) {
        vec3 direct = first.rgb, indirect = texelFetch(samples, 3 * at + 1).rgb;
        vec3 albedo = texelFetch(samples, 3 * at + 2).rgb;
        bvec3 divides = greaterThan(albedo, vec3(SMALLEST_ALBEDO));
        vec3 irradiance = mix(vec3(0.0), indirect / max(albedo, vec3(SMALLEST_ALBEDO)), divides);
        vec3 kept = direct + mix(indirect, vec3(0.0), divides);
        radiance = direct + indirect;
        l.direct += (kept - l.direct) * share;
        l.indirect += (irradiance - l.indirect) * share;
    }
    vec3 off = radiance - s.mean;
    s.mean += off * share;
    s.m2 += off * (radiance - s.mean);
}

PixelStats load_stats(int pixel) {
    uvec4 a = texelFetch(stats, 2 * pixel), b = texelFetch(stats, 2 * pixel + 1);
    return PixelStats(uintBitsToFloat(a.xyz), a.w, uintBitsToFloat(b.xyz), b.w);
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return; // safe: no barrier() follows
    uvec3 at_step_count = samples_of(i, push.first_pixel + i);
    uint at = at_step_count.x, step = at_step_count.y, count = at_step_count.z;
    if (count == 0u) return;
    uint pixel = push.first_pixel + i;
    PixelStats s = load_stats(int(pixel));
    PixelLight l = PixelLight(vec3(0.0), vec3(0.0));
    if (FX_SPLIT) l = load_light(int(pixel));
    uint plain = FX_ADAPTIVE ? min(count, PLAIN) : count; // see SAMPLES_AT_ONCE in schedule.rs
    for (uint k = 0u; k < plain; k++) fold(s, l, int(at + k * step));
    for (uint k = plain; FX_ADAPTIVE && k < count; k += STRIDE) {
        [[unroll]] for (uint j = 0u; j < STRIDE; j++) {
            if (k + j < count) fold(s, l, int(at + (k + j) * step));
        }
    }
    uint place = pixel - push.window;
    folded_stats[place] = u64vec4(paired(uvec4(floatBitsToUint(s.mean), s.count)), paired(uvec4(floatBitsToUint(s.m2), s.rays)));
    if (FX_SPLIT) folded_light[place] = u64vec3(paired(vec4(l.direct, l.indirect.x)), paired(l.indirect.yzyz).x);
}
