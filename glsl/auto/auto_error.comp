#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/candidates.glsl"

// Estimates, per pixel and thread, the error in luminance that each candidate would make if the pixel were left out of its
// sums (cross-validation: Stone 1974, Craven and Wahba 1979): for a leverage h it is (filtered - pixel) / (1 - h). Its mean
// square is the candidate's error plus the pixel's noise. That of a blend follows from the products written here (stacking:
// Wolpert 1992, Breiman 1996). The unfiltered image, an independent copy of itself, misses by twice the noise.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer estimate; // of vec4
layout(binding = 1) uniform samplerBuffer colour; // of vec4
layout(binding = 2) uniform samplerBuffer wide; // of vec4
layout(binding = 3) uniform samplerBuffer mid; // of vec4
layout(binding = 4) uniform samplerBuffer narrow; // of vec4, of what it gets
layout(binding = 5) uniform samplerBuffer wide_dim; // of vec4, of the same
layout(binding = 6) uniform samplerBuffer svgf; // of vec4
layout(binding = 7) uniform samplerBuffer leverages; // of vec4, of auto_leverage.comp
layout(binding = 8) uniform samplerBuffer surroundings; // of vec4
layout(scalar, binding = 9) writeonly buffer Squares { vec4 squares[]; };    // wide, mid, narrow, svgf
layout(scalar, binding = 10) writeonly buffer Products { vec4 products[]; }; // wide mid, wide narrow, wide svgf, mid narrow
layout(scalar, binding = 11) writeonly buffer Others { vec4 others[]; };     // mid svgf, narrow svgf, none, the light itself
layout(scalar, push_constant) uniform Push { AutoPush push; };

const float MOST = 0.9; // largest leverage: beyond it, too little is left to judge by
// How far the leverage used moves from the smoothed one towards the pixel's own, larger one, at one sample. Both a pixel's
// leverage and its noise are often high together. With few samples, where noise is hundreds of times the filters' error, its
// own leverage would make filters seem good that keep much of the pixel.
const float OWN = 0.3;
const float LIMIT = 1e9; // luminance and its differences are cut here, so that their products are finite
// Errors are relative to the mean of the candidates; with more samples than this, to svgf's more and more. The windows take light into
// dark pixels (between reflections on Veach's plates), where errors would count too little.
const float FEW = 4.0;
const int REACH = 3; // pixels from the centre to the border of the window that the variance is taken over

float scaled(vec3 a, vec3 b) {
    return clamp(contrast(a, b) / push.floor, -LIMIT, LIMIT);
}

// A variance in units of the squared floor.
float squared_deviation(float variance) {
    float deviation = min(sqrt(max(variance, 0.0)) / push.floor, LIMIT);
    return deviation * deviation;
}

// Mean variance around a pixel, in the same units, nearer pixels weighing more.
float variance_around(ivec2 at) {
    ivec2 size = ivec2(push.size);
    float sum = 0.0, total = 0.0;
    // Tested at its end: see shared/traverse.glsl.
    int j = -REACH;
    do {
        [[unroll]] for (int i = -REACH; i <= REACH; i++) {
            ivec2 tap = clamp(at + ivec2(i, j), ivec2(0), size - 1); // borders repeat
            float variance = texelFetch(estimate, tap.y * size.x + tap.x).w;
            float w = variance < 0.0 ? 0.0 : float((REACH + 1 - abs(i)) * (REACH + 1 - abs(j)));
            sum += w * squared_deviation(variance);
            total += w;
        }
    } while (++j <= REACH);
    return total > 0.0 ? sum / total : 0.0;
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    int at = int(i);
    vec4 e = texelFetch(estimate, at);
    vec3 a = texelFetch(wide, at).rgb, b = texelFetch(mid, at).rgb, c = texelFetch(narrow, at).rgb;
    vec3 a_dim = texelFetch(wide_dim, at).rgb, d = texelFetch(svgf, at).rgb, dim = dimmed(e.rgb, a);
    vec4 found = texelFetch(surroundings, at);
    vec4 own = leverages_of(texelFetch(leverages, at), push.shares), around = leverages_of(found, push.shares);
    float count = texelFetch(colour, at).w;
    vec4 left = 1.0 - clamp(around + OWN / sqrt(max(count, 1.0)) * max(own - around, 0.0), 0.0, MOST);
    // The narrow window filters the dimmed pixel, and the wide one the rest of its light: each misses its own part.
    vec4 missed = vec4(scaled(a, e.rgb), scaled(b, e.rgb), scaled(c, dim), scaled(d, e.rgb)) / left;
    missed.z += scaled(a - a_dim, e.rgb - dim) / left.x;
    float most = max(count / FEW, 1.0);
    float level = scaled((a + as_light(b, a) + whole_light(c, a, a_dim) + most * d) / (3.0 + most), vec3(0.0)), light = level * level + 1.0;
    float uncertain = light + NOISE * variance_around(ivec2(at % int(push.size.x), at / int(push.size.x)));
    float weight = count > 0.0 ? 1.0 / uncertain : 0.0;
    squares[i] = weight * missed * missed;
    products[i] = weight * missed.xxxy * missed.yzwz;
    others[i] = weight * vec4(missed.yz * missed.w, 2.0 * share_of_noise(found) * squared_deviation(e.w), light);
}
