#include "shared/edge.glsl"
#include "shared/atrous_taps.glsl"
#include "shared/luminance.glsl"

// Writes the radiance of pixels with the variance of their luminance, or -1 where a pixel is unknown. Few samples tell little of
// their own variance: below ENOUGH samples it is the variance over like pixels of a 7x7 window (Schied et al. 2017, section 4.2). For
// CAUTIOUS readers what those pixels' samples tell counts too. A thread takes ROWS pixels of a column.
layout(local_size_x_id = 100) in;
#include "shared/packed_pixels.glsl"
layout(binding = 2) uniform samplerBuffer variance; // of vec3
layout(binding = 3) uniform usamplerBuffer guide; // of Guide
layout(scalar, binding = 4) writeonly buffer Estimates { vec4 estimate[]; };
layout(scalar, push_constant) uniform Push { SurfacesPush push; };

#include "shared/own_variance.glsl"
#include "shared/blurred.glsl"

layout(constant_id = 115) const bool CAUTIOUS = true;
const int REACH = 3;
// Samples that are all dark by chance seem not to vary, so that such pixels would be left dark. Cautious readers take the variance that
// like pixels have on average to be worth PRIOR further samples (the moderated variance of Smyth 2004, with a prior that is chosen).
// Without it `auto` had 1.2 times the error in a room that is lit through a gap, at 16 samples.
const float PRIOR = 8.0;
// The variance of a difference over its square from which on two pixels may show the same, and that up to which they do not. One sample
// of many that brings all light makes it 1, two make it about 1/2. Without this the image of a sun in a ball made its surroundings
// doubtful, so that fog around it was left to noise. Neither do equal pixels count that tell no variance: all their samples may be
// dark by chance.
const float SAME = 0.5;
const float OTHER = 0.375;

// How much a neighbour that is so far apart, with such a variance of the difference, tells of a pixel's variance.
float tells(float variance, float apart) {
    float square = apart * apart;
    if (variance >= SAME * square) return variance > 0.0 ? 1.0 : 0.0;
    return max((variance / square - OTHER) / (SAME - OTHER), 0.0);
}

// The means over like pixels of what their samples say of their variance. Where a lens blurs, all of them count in full: pixels beside
// lamps out of focus may be dark by chance as well.
float[ROWS] told_around(ivec2 first, Pixel p[ROWS], float own[ROWS]) {
    ivec2 size = ivec2(push.size);
    float total[ROWS], sum[ROWS];
    bool blurs[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        total[k] = sum[k] = 0.0;
        blurs[k] = blurred(min(first.y + k, size.y - 1) * size.x + first.x);
    }
    // Tested at its end: see shared/traverse.glsl.
    int i = -REACH;
    do {
        [[unroll]] for (int j = -REACH; j < ROWS + REACH; j++) {
            ivec2 tap = first + ivec2(i, j), inside = clamp(tap, ivec2(0), size - 1);
            int there = inside.y * size.x + inside.x;
            Pixel q = pixel_at(there);
            float of_tap = own_variance(there, q.colour.w);
            bool counts = tap == inside && of_tap >= 0.0;
            [[unroll]] for (int k = 0; k < ROWS; k++) { // constant bounds, or it would not be unrolled
                if (abs(j - k) <= REACH) {
                    float w = counts ? edge_weight(q, edge_exponent(p[k], q, push.rates)) : 0.0;
                    if (!blurs[k]) w *= tells(max(own[k], 0.0) + of_tap, contrast(q.colour.rgb, p[k].colour.rgb));
                    total[k] += w;
                    sum[k] += w > 0.0 ? w * of_tap : 0.0;
                }
            }
        }
    } while (++i <= REACH);
    [[unroll]] for (int k = 0; k < ROWS; k++) sum[k] = total[k] > 0.0 ? sum[k] / total[k] : 0.0;
    return sum;
}

// The variance of the pixels' own luminance over like pixels.
float[ROWS] spread(ivec2 first, Pixel p[ROWS]) {
    ivec2 size = ivec2(push.size);
    float total[ROWS], squares[ROWS], mean[ROWS], m2[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) total[k] = squares[k] = mean[k] = m2[k] = 0.0;
    // Tested at its end: see shared/traverse.glsl.
    int i = -REACH;
    do {
        [[unroll]] for (int j = -REACH; j < ROWS + REACH; j++) {
            ivec2 tap = first + ivec2(i, j), inside = clamp(tap, ivec2(0), size - 1);
            Pixel q = pixel_at(inside.y * size.x + inside.x);
            [[unroll]] for (int k = 0; k < ROWS; k++) {
                if (abs(j - k) <= REACH) {
                    float w = tap == inside ? edge_weight(q, edge_exponent(p[k], q, push.rates)) : 0.0;
                    float off = contrast(q.colour.rgb, p[k].colour.rgb);
                    total[k] += w;
                    squares[k] += w * w;
                    mean[k] += w * off;
                    m2[k] += w * off * off;
                }
            }
        }
    } while (++i <= REACH);
    float found[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        mean[k] /= total[k];
        // The division makes it unbiased for unequal weights; one pixel alone has no variance. The result is not negative, since
        // the pixel itself is one of at most 49 terms, with value 0.
        float others = 1.0 - squares[k] / (total[k] * total[k]);
        found[k] = others > 1e-3 ? (m2[k] / total[k] - mean[k] * mean[k]) / others : 0.0;
    }
    return found;
}

void main() {
    ivec2 size = ivec2(push.size);
    int x = int(gl_GlobalInvocationID.x), first = first_row(int(gl_GlobalInvocationID.y), 1);
    if (x >= size.x || first >= size.y) return;
    Pixel p[ROWS];
    float own[ROWS], around[ROWS], found[ROWS];
    bool untold = false, unsure = false;
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        int i = min(first + k, size.y - 1) * size.x + x;
        p[k] = pixel_at(i);
        own[k] = own_variance(i, p[k].colour.w);
        untold = untold || own[k] < 0.0;
        unsure = unsure || own[k] >= 0.0;
    }
    if (untold) found = spread(ivec2(x, first), p);
    if (CAUTIOUS && unsure) around = told_around(ivec2(x, first), p, own);
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        float count = p[k].colour.w, v = own[k] >= 0.0 ? own[k] : found[k];
        float freedom = count - 1.0;
        if (CAUTIOUS && own[k] >= 0.0) v = mix(own[k], around[k], PRIOR / (PRIOR + freedom));
        if (first + k < size.y) estimate[(first + k) * size.x + x] = vec4(p[k].colour.rgb, count > 0.0 ? v : -1.0);
    }
}
