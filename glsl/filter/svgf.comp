#include "shared/edge.glsl"
#include "shared/b3_spline.glsl"
#include "shared/luminance.glsl"

// Filters one pixel per thread by one level of A-Trous wavelets whose luminance weight is relative to the pixel's standard
// deviation (Schied et al. 2017, section 4.4). It filters the variance (w) too; the last level writes the number of samples
// in its place.
layout(local_size_x = 32) in;
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
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    vec4 here = texelFetch(estimate, index(at));
    bool known = here.w >= 0.0;
    Pixel p = unpack_pixel(here, texelFetch(place, index(at)));
    float rate = push.rate_l / (deviation(at) + 1e-30); // stays finite without variance, so that equal pixels weigh 1
    vec3 sum = vec3(0.0);
    float total = 0.0, spread = 0.0;
    // Tested at its end: see shared/traverse.glsl.
    int i = -2;
    do {
        [[unroll]] for (int j = -2; j <= 2; j++) {
            ivec2 tap = at + int(push.spacing) * ivec2(i, j), inside = nearest(tap);
            vec4 there = texelFetch(estimate, index(inside));
            float counts = there.w >= 0.0 && tap == inside ? 1.0 : 0.0;
            Pixel q = unpack_pixel(vec4(there.rgb, counts), texelFetch(place, index(inside)));
            float exponent = edge_exponent(p, q, push.rates);
            if (known) exponent -= rate * abs(contrast(q.colour.rgb, p.colour.rgb));
            float w = b3_spline(i) * b3_spline(j) * edge_weight(q, exponent);
            sum += w * (q.colour.rgb - p.colour.rgb);
            total += w;
            spread += w * w * there.w;
        }
    } while (++i <= 2);
    if (total > 0.0) here = vec4(here.rgb + sum / total, spread / (total * total));
    float count = texelFetch(colour, index(at)).w;
    if (LAST) here.w = count > 0.0 ? count : here.w >= 0.0 ? 1.0 : 0.0;
    filtered[index(at)] = here;
}
