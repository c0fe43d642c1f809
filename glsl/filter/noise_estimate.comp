#include "shared/edge.glsl"
#include "shared/luminance.glsl"

// Writes the radiance of one pixel per thread with the variance of its luminance, or -1 where the pixel is unknown. Few samples
// tell little of their own variance: below ENOUGH samples it is the variance over like pixels of a 7x7 window (Schied et al.
// 2017, section 4.2). For CAUTIOUS readers, below MANY samples, what those pixels' samples tell counts too.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform usamplerBuffer place; // of uvec4
layout(binding = 2) uniform samplerBuffer variance; // of vec3
layout(scalar, binding = 3) writeonly buffer Estimates { vec4 estimate[]; };
layout(scalar, push_constant) uniform Push { SvgfPush push; };

#include "shared/packed_pixels.glsl"

layout(constant_id = 114) const bool MEASURED = true; // `variance` holds every pixel's
layout(constant_id = 115) const bool CAUTIOUS = true;
const int REACH = 3;
// Samples that are all dark by chance seem not to vary, so that such pixels would be left dark. Cautious readers take the variance that
// like pixels have on average to be worth PRIOR further samples (the moderated variance of Smyth 2004, with a prior that is chosen):
// Crytek Sponza at 4 samples has FLIP .128 in place of .148. From MANY samples on that changes little.
const float PRIOR = 4.0;
const float MANY = 16.0;

// What a pixel's samples say of the variance of its luminance; -1 where they say nothing.
float told(int i, float count) {
    vec3 v = MEASURED ? vec3(texelFetch(variance, 3 * i).x, texelFetch(variance, 3 * i + 1).x, texelFetch(variance, 3 * i + 2).x) : vec3(-1.0);
    // Channels of one path rise and fall together: their deviations add, not their variances.
    float deviation = min(luminance(sqrt(v)), STRONGEST);
    return count >= ENOUGH && finite(v) && all(greaterThanEqual(v, vec3(0.0))) ? deviation * deviation : -1.0;
}

// The mean of that over like pixels.
float told_around(ivec2 at, Pixel p) {
    ivec2 size = ivec2(push.size);
    float total = 0.0, sum = 0.0;
    // Tested at its end: see shared/traverse.glsl.
    int j = -REACH;
    do {
        int i = -REACH;
        do {
            ivec2 tap = at + ivec2(i, j), inside = clamp(tap, ivec2(0), size - 1);
            int there = inside.y * size.x + inside.x;
            Pixel q = pixel_at(there);
            float of_tap = told(there, q.colour.w);
            float w = tap == inside && of_tap >= 0.0 ? edge_weight(q, edge_exponent(p, q, push.rates)) : 0.0;
            total += w;
            sum += w > 0.0 ? w * of_tap : 0.0;
        } while (++i <= REACH);
    } while (++j <= REACH);
    return sum / total;
}

float spread(ivec2 at, Pixel p) {
    ivec2 size = ivec2(push.size);
    float total = 0.0, squares = 0.0, mean = 0.0, m2 = 0.0;
    // Tested at its end: see shared/traverse.glsl.
    int j = -REACH;
    do {
        int i = -REACH;
        do {
            ivec2 tap = at + ivec2(i, j), inside = clamp(tap, ivec2(0), size - 1);
            Pixel q = pixel_at(inside.y * size.x + inside.x);
            float w = tap == inside ? edge_weight(q, edge_exponent(p, q, push.rates)) : 0.0;
            float off = contrast(q.colour.rgb, p.colour.rgb);
            total += w;
            squares += w * w;
            mean += w * off;
            m2 += w * off * off;
        } while (++i <= REACH);
    } while (++j <= REACH);
    mean /= total;
    // The division makes it unbiased for unequal weights; one pixel alone has no variance. The result is not negative, since
    // the pixel itself is one of at most 49 terms, with value 0.
    float others = 1.0 - squares / (total * total);
    return others > 1e-3 ? (m2 / total - mean * mean) / others : 0.0;
}

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    int i = at.y * size.x + at.x;
    Pixel p = pixel_at(i);
    float own = told(i, p.colour.w), v = own >= 0.0 ? own : spread(at, p);
    if (CAUTIOUS && own >= 0.0 && p.colour.w < MANY) {
        float known = p.colour.w - 1.0; // degrees of freedom
        v = (PRIOR * told_around(at, p) + known * own) / (PRIOR + known);
    }
    estimate[i] = vec4(p.colour.rgb, p.colour.w > 0.0 ? v : -1.0);
}
