#include "shared/edge.glsl"
#include "shared/atrous_taps.glsl"
#include "shared/luminance.glsl"
#include "shared/filter_thread.glsl"

// Filters by one level of A-Trous wavelets whose luminance weight is relative to the pixel's standard deviation (Schied et al.
// 2017, section 4.4). It filters the variance (w) too; the last level writes the number of samples in its place. A thread filters
// ROWS pixels of a column.
layout(binding = 0) uniform samplerBuffer estimate; // of vec4
layout(binding = 1) uniform usamplerBuffer place; // of uvec4
layout(binding = 2) uniform samplerBuffer colour; // of vec4
layout(scalar, binding = 3) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { SvgfPush push; };

layout(constant_id = 114) const bool LAST = false;

int index(ivec2 at) {
    return at.y * int(push.size.x) + at.x;
}

// The pixel of the image that is nearest to `at`; one that differs from `at` has weight 0.
ivec2 nearest(ivec2 at) {
    return clamp(at, ivec2(0), ivec2(push.size) - 1);
}

// Standard deviation of a known pixel, from the variance smoothed by a 3x3 Gaussian: that of one pixel is uncertain.
float deviation(ivec2 at) {
    float sum = 0.0, total = 0.0;
    [[unroll]] for (int j = -1; j <= 1; j++) {
        [[unroll]] for (int i = -1; i <= 1; i++) {
            ivec2 tap = at + ivec2(i, j), inside = nearest(tap);
            float v = texelFetch(estimate, index(inside)).w, w = 1.0 / float(1 << (2 + abs(i) + abs(j)));
            if (v < 0.0 || tap != inside) w = 0.0;
            sum += w * v;
            total += w;
        }
    }
    return sqrt(sum / total);
}

void main() {
    ivec2 size = ivec2(push.size);
    int spacing = int(push.spacing), x = int(gl_GlobalInvocationID.x), column = int(gl_GlobalInvocationID.y);
    int first = first_row(column, spacing);
    if (x >= size.x || first >= size.y) return;
    vec4 centre[ROWS];
    Pixel pixel[ROWS];
    float rate[ROWS], total[ROWS], spread[ROWS];
    vec3 sum[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        ivec2 at = nearest(ivec2(x, first + k * spacing));
        centre[k] = texelFetch(estimate, index(at));
        pixel[k] = unpack_pixel(centre[k], texelFetch(place, index(at)));
        // Stays finite without variance, so that equal pixels weigh 1. An unknown pixel has no luminance to compare.
        rate[k] = centre[k].w >= 0.0 ? push.rate_l / (deviation(at) + 1e-30) : 0.0;
        sum[k] = vec3(0.0);
        total[k] = 0.0;
        spread[k] = 0.0;
    }
    // Tested at its end: see shared/traverse.glsl.
    int i = -2;
    do {
        [[unroll]] for (int j = -2; j < ROWS + 2; j++) {
            ivec2 tap = ivec2(x + i * spacing, first + j * spacing), inside = nearest(tap);
            vec4 there = texelFetch(estimate, index(inside));
            float counts = there.w >= 0.0 && tap == inside ? 1.0 : 0.0;
            Pixel q = unpack_pixel(vec4(there.rgb, counts), texelFetch(place, index(inside)));
            [[unroll]] for (int k = 0; k < ROWS; k++) { // constant bounds, or it would not be unrolled
                if (abs(j - k) <= 2) {
                    float steps = rate[k] * abs(contrast(q.colour.rgb, pixel[k].colour.rgb));
                    float w = b3_spline(i) * b3_spline(j - k) * edge_weight(q, edge_exponent(pixel[k], q, push.rates) - steps);
                    sum[k] += w * (q.colour.rgb - pixel[k].colour.rgb);
                    total[k] += w;
                    spread[k] += w * w * there.w;
                }
            }
        }
    } while (++i <= 2);
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        ivec2 at = ivec2(x, first + k * spacing);
        if (at.y >= size.y) continue;
        vec4 here = centre[k];
        if (total[k] > 0.0) here = vec4(here.rgb + sum[k] / total[k], spread[k] / (total[k] * total[k]));
        if (LAST) {
            float count = texelFetch(colour, index(at)).w;
            here.w = count > 0.0 ? count : here.w >= 0.0 ? 1.0 : 0.0;
        }
        filtered[index(at)] = here;
    }
}
