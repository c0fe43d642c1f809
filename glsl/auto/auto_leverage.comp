#include "shared/thread.glsl"
#include "shared/edge.glsl"
#include "shared/luminance.glsl"
#include "shared/perturbation.glsl"

// Estimates, per pixel and thread, the leverage of a pixel in each candidate: the derivative of its filtered value by its own
// value, the diagonal of the matrix of a linear filter. svgf's is estimated by a probe (Ramani, Blu, Unser 2008), and also holds what
// the probe brings from neighbours, which is 0 on average.
//
// Samples that are stratified over lamps have far less noise than their variance tells. Neighbours tell it as well: by their second
// differences (Gasser, Sroka, Jennen-Steinmetz 1986), which light that changes linearly does not enter.
layout(local_size_x = 64) in;
#include "shared/packed_pixels.glsl"
layout(binding = 2) uniform samplerBuffer wide; // of vec4, of the image
layout(binding = 3) uniform samplerBuffer svgf; // of vec4, of the image
layout(binding = 4) uniform samplerBuffer narrow; // of float, leverages
layout(binding = 5) uniform samplerBuffer probed; // of vec4, what svgf makes of the probed image
layout(binding = 6) uniform samplerBuffer estimate; // of vec4
// Squared second differences, what variances tell of them, leverages in the narrow window and in svgf.
layout(scalar, binding = 7) writeonly buffer Output { vec4 leverages[]; };
layout(scalar, push_constant) uniform Push { AutoPush push; };

const float LIMIT = 1e9; // as in auto_error.comp

// The squared second difference of luminance along one axis and what its pixels' variances tell of it, weighted by how alike they are.
vec2 differences(ivec2 at, ivec2 along) {
    ivec2 size = ivec2(push.size);
    if (any(lessThan(at, along)) || any(greaterThanEqual(at + along, size))) return vec2(0.0);
    int here = at.y * size.x + at.x, step = along.y * size.x + along.x;
    Pixel p = pixel_at(here), before = pixel_at(here - step), after = pixel_at(here + step);
    float w = p.colour.w > 0.0 ? edge_weight(before, edge_exponent(p, before, push.rates)) * edge_weight(after, edge_exponent(p, after, push.rates)) : 0.0;
    float bend = contrast(p.colour.rgb, before.colour.rgb) + contrast(p.colour.rgb, after.colour.rgb);
    float found = min(0.5 * abs(bend) / push.floor, LIMIT);
    vec3 v = max(vec3(texelFetch(estimate, here).w, texelFetch(estimate, here - step).w, texelFetch(estimate, here + step).w), 0.0);
    float told = min(sqrt(v.x + 0.25 * (v.y + v.z)) / push.floor, LIMIT);
    return w * vec2(found * found, told * told);
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    int at = int(i);
    float added = perturbation(i, texelFetch(wide, at).rgb, push.floor);
    float grown = contrast(texelFetch(probed, at).rgb, texelFetch(svgf, at).rgb);
    ivec2 pixel = ivec2(i % push.size.x, i / push.size.x);
    float light = min(abs(contrast(texelFetch(wide, at).rgb, vec3(0.0))) / push.floor, LIMIT);
    vec2 differ = (differences(pixel, ivec2(1, 0)) + differences(pixel, ivec2(0, 1))) / (light * light + 1.0);
    leverages[i] = vec4(differ, clamp(vec2(texelFetch(narrow, at).x, grown / added), -1.0, 1.0));
}
