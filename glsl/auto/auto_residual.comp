#include "shared/edge.glsl"
#include "shared/luminance.glsl"
#include "shared/candidates.glsl"

// Gives back, per pixel and thread, what the blend has lost: where its mean difference from the noisy pixels around is more than
// their noise explains, the rest of the difference is added (twicing: Tukey 1977; soft threshold: Donoho 1995). Windows of
// like pixels, of 7x7, 3x3 and one pixel, follow each other. A blend that fits the pixels stays as it is.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform usamplerBuffer place; // of uvec4
layout(binding = 2) uniform samplerBuffer estimate; // of vec4
layout(binding = 3) uniform samplerBuffer others; // of vec4
layout(binding = 4) uniform samplerBuffer blend; // of vec4, of auto.comp
layout(scalar, binding = 5) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { AutoResidualPush push; };

#include "shared/packed_pixels.glsl"

const int REACH = 3; // pixels from the centre to the border of the largest window
const float SIGNIFICANT = 3.0; // standard deviations that noise explains
// The relative variance of the surroundings counts as that of this many samples. Where all samples are dark, their own variance
// says nothing of the bright ones that may have been missed by chance.
const float PRIOR_SAMPLES = 4.0;
const float ENOUGH_SAMPLES = 16.0; // of a window: fewer may all be dark by chance

// Sums over the like pixels of a window.
struct Window {
    vec3 residual;
    float total;   // weights
    float squares; // their squares
    float count;   // samples
    float variance; // of a pixel
};

void add(inout Window sum, vec3 residual, float w, float count, float variance) {
    sum.residual += w * residual;
    sum.total += w;
    sum.squares += w * w;
    sum.count += w * count;
    sum.variance += w * count * variance;
}

// What of a window's mean residual, `given` of which is given back already, is more than noise. `prior` is the variance of one
// sample by the surroundings.
vec3 significant(Window sum, vec3 given, float prior) {
    if (sum.count < ENOUGH_SAMPLES) return vec3(0.0);
    vec3 residual = sum.residual / sum.total - given;
    // Variance of a pixel of mean count.
    float variance = (sum.variance + PRIOR_SAMPLES * prior * sum.total / sum.count) / (sum.count + PRIOR_SAMPLES);
    float noise = SIGNIFICANT * sqrt(variance * sum.squares) / sum.total, off = abs(contrast(residual, vec3(0.0)));
    return off > noise ? residual * (1.0 - noise / off) : vec3(0.0);
}

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    int i = at.y * size.x + at.x;
    Pixel p = pixel_at(i);
    vec4 blended = texelFetch(blend, i);
    float count = p.colour.w;
    if (count == 0.0 || blended.w == UNFILTERED) {
        filtered[i] = vec4(blended.rgb, blended.w == UNFILTERED ? 0.0 : 1.0);
        return;
    }
    Window windows[3];
    for (int k = 0; k < 3; k++) windows[k] = Window(vec3(0.0), 0.0, 0.0, 0.0, 0.0);
    // Tested at its end: see shared/traverse.glsl.
    int v = -REACH;
    do {
        int u = -REACH;
        do {
            ivec2 tap = at + ivec2(u, v), inside = clamp(tap, ivec2(0), size - 1);
            int j = inside.y * size.x + inside.x;
            Pixel q = pixel_at(j);
            float w = tap == inside ? edge_weight(q, edge_exponent(p, q, push.rates)) : 0.0;
            vec4 there = texelFetch(blend, j);
            vec3 residual = q.colour.rgb - there.rgb;
            float variance = there.w >= 0.0 ? there.w : max(texelFetch(estimate, j).w, 0.0);
            if (there.w == UNFILTERED) w = 0.0;
            add(windows[0], residual, w, q.colour.w, variance);
            if (max(abs(u), abs(v)) <= 1) add(windows[1], residual, w, q.colour.w, variance);
            if (u == 0 && v == 0) add(windows[2], residual, w, q.colour.w, variance);
        } while (++u <= REACH);
    } while (++v <= REACH);
    vec4 other = texelFetch(others, i);
    float level = max(abs(contrast(blended.rgb, vec3(0.0))), push.floor);
    float prior = 0.5 * other.z / max(other.w, 1e-20) * level * level * count;
    // An estimate over 7x7 pixels tells nothing of smaller windows.
    int used = blended.w >= 0.0 ? 3 : 1;
    vec3 given = vec3(0.0);
    for (int k = 0; k < used; k++) given += significant(windows[k], given, prior);
    // No light becomes negative.
    vec3 least = min(min(blended.rgb, p.colour.rgb), vec3(0.0));
    filtered[i] = vec4(max(blended.rgb + given, least), count);
}
