#include "shared/edge.glsl"
#include "shared/atrous_taps.glsl"
#include "shared/luminance.glsl"

// Filters by one level of A-Trous wavelets whose luminance weight is relative to the pixel's standard deviation (Schied et al.
// 2017, section 4.4). It filters the variance (w) too; the last level writes the number of samples in its place. A thread filters
// ROWS pixels of a column. With TWO it filters a second image of the same surfaces beside the first: what both share of the weights
// is most of the work.
layout(local_size_x_id = 100) in;
#include "shared/packed_pixels.glsl"
layout(binding = 2) uniform samplerBuffer estimate; // of vec4
layout(binding = 3) uniform samplerBuffer second; // of vec4
layout(scalar, binding = 4) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, binding = 5) writeonly buffer Second { vec4 second_filtered[]; };
layout(scalar, push_constant) uniform Push { SvgfPush push; };

layout(constant_id = 114) const bool LAST = false;
layout(constant_id = 115) const bool TWO = false;
const int IMAGES = TWO ? 2 : 1;
const float LEAST_DEVIATION = 1e-30; // stands for 0, so that equal pixels are alike where nothing varies
// Departure: above this number of samples noise is little beside what neighbours truly differ by, and the weight narrows with their
// fourth root. Over 14 scenes the filter alone has .96 of the relMSE at 16 samples, .86 at 64, and .99 and .92 of FLIP. `auto`, which
// weighs what it makes of two images against other candidates, would have 1.05 of the relMSE at 64.
const float FEW = 8.0;
const float STEEPEST = 1e8; // weight per standard deviation, finite over LEAST_DEVIATION

// How much narrower the weight of luminance is at so many samples.
float narrowed(float count) { return TWO ? 1.0 : sqrt(sqrt(max(count / FEW, 1.0))); }

int index(ivec2 at) {
    return at.y * int(push.size.x) + at.x;
}

// The pixel of the image that is nearest to `at`; one that differs from `at` has weight 0.
ivec2 nearest(ivec2 at) {
    return clamp(at, ivec2(0), ivec2(push.size) - 1);
}

vec4 fetch(int image, int at) {
    if (image == 0) return texelFetch(estimate, at);
    return texelFetch(second, at);
}

void store(int image, int at, vec4 value) {
    if (image == 0) filtered[at] = value;
    else second_filtered[at] = value;
}

// Standard deviation of a known pixel, from the variance smoothed by a 3x3 Gaussian: that of one pixel is uncertain.
float deviation(int image, ivec2 at) {
    float sum = 0.0, total = 0.0;
    [[unroll]] for (int j = -1; j <= 1; j++) {
        [[unroll]] for (int i = -1; i <= 1; i++) {
            ivec2 tap = at + ivec2(i, j), inside = nearest(tap);
            float v = fetch(image, index(inside)).w, w = 1.0 / float(1 << (2 + abs(i) + abs(j)));
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
    Pixel pixel[ROWS];
    vec4 centre[2][ROWS];
    float rate[2][ROWS], total[2][ROWS], spread[2][ROWS];
    vec3 sum[2][ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        ivec2 at = nearest(ivec2(x, first + k * spacing));
        pixel[k] = unpack_pixel(vec4(0.0), texelFetch(place, index(at)));
        float rate_l = min(push.rate_l * narrowed(texelFetch(colour, index(at)).w), STEEPEST);
        [[unroll]] for (int m = 0; m < IMAGES; m++) {
            vec4 here = fetch(m, index(at));
            centre[m][k] = here;
            // An unknown pixel has no luminance to compare.
            rate[m][k] = here.w >= 0.0 ? rate_l / (deviation(m, at) + LEAST_DEVIATION) : 0.0;
            sum[m][k] = vec3(0.0);
            total[m][k] = 0.0;
            spread[m][k] = 0.0;
        }
    }
    // Tested at its end: see shared/traverse.glsl.
    int i = -2;
    do {
        [[unroll]] for (int j = -2; j < ROWS + 2; j++) {
            ivec2 tap = ivec2(x + i * spacing, first + j * spacing), inside = nearest(tap);
            Pixel q = unpack_pixel(vec4(0.0), texelFetch(place, index(inside)));
            vec4 there[2];
            [[unroll]] for (int m = 0; m < IMAGES; m++) there[m] = fetch(m, index(inside));
            [[unroll]] for (int k = 0; k < ROWS; k++) { // constant bounds, or it would not be unrolled
                if (abs(j - k) <= 2) {
                    float surfaces = edge_exponent(pixel[k], q, push.rates);
                    [[unroll]] for (int m = 0; m < IMAGES; m++) {
                        float steps = rate[m][k] * abs(contrast(there[m].rgb, centre[m][k].rgb));
                        q.colour.w = there[m].w >= 0.0 && tap == inside ? 1.0 : 0.0;
                        float w = b3_spline(i) * b3_spline(j - k) * edge_weight(q, surfaces - steps);
                        sum[m][k] += w * (there[m].rgb - centre[m][k].rgb);
                        total[m][k] += w;
                        spread[m][k] += w * w * there[m].w;
                    }
                }
            }
        }
    } while (++i <= 2);
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        ivec2 at = ivec2(x, first + k * spacing);
        if (at.y >= size.y) continue;
        float count = LAST ? texelFetch(colour, index(at)).w : 0.0;
        [[unroll]] for (int m = 0; m < IMAGES; m++) {
            vec4 here = centre[m][k];
            float weights = total[m][k];
            if (weights > 0.0) here = vec4(here.rgb + sum[m][k] / weights, spread[m][k] / (weights * weights));
            if (LAST) here.w = count > 0.0 ? count : here.w >= 0.0 ? 1.0 : 0.0;
            store(m, index(at), here);
        }
    }
}
