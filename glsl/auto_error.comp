#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/candidates.glsl"

// What three filters miss a pixel's luminance by when it is left out of their sums (cross-validation: Stone 1974, Craven
// and Wahba 1979): one of leverage h misses it by (filtered - pixel) / (1 - h). The mean square of that is its error and
// the pixel's noise; of a blend, which misses by the blend of these, it follows from their products (stacking: Wolpert
// 1992, Breiman 1996). No filter would miss by twice the noise.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer estimate; // of vec4
layout(binding = 1) uniform samplerBuffer colour; // of vec4
layout(binding = 2) uniform samplerBuffer filtered_1; // of vec4
layout(binding = 3) uniform samplerBuffer filtered_2; // of vec4
layout(binding = 4) uniform samplerBuffer filtered_3; // of vec4
layout(binding = 5) uniform samplerBuffer leverages; // of vec4
layout(binding = 6) uniform samplerBuffer surroundings; // of vec4
layout(scalar, binding = 7) writeonly buffer Squares { vec4 squares[]; };   // none, 1, 2, 3
layout(scalar, binding = 8) writeonly buffer Products { vec4 products[]; }; // 1 2, 1 3, 2 3, -
layout(scalar, push_constant) uniform Push { AutoPush push; };

const float ENOUGH = 4.0; // samples whose own variance is trusted
const float MOST = 0.9;   // leverage: beyond it, too little is left to judge by
// Of what the leverage of a pixel of one sample is above that of the pixels around it, which alone is not too noisy. Where a
// pixel's is high, its noise often is: filters that keep much would seem good where noise is hundreds of times their error,
// as it is with few samples.
const float OWN = 0.8;
const float LIMIT = 1e9; // of luminance and its differences, so that their products are finite

float scaled(vec3 a, vec3 b) {
    return clamp(contrast(a, b) / push.floor, -LIMIT, LIMIT);
}

void main() {
    uint i = thread_index();
    if (i >= push.count) return; // safe: no barrier() follows
    int at = int(i);
    vec4 e = texelFetch(estimate, at);
    vec3 a = texelFetch(filtered_1, at).rgb, b = texelFetch(filtered_2, at).rgb, c = texelFetch(filtered_3, at).rgb;
    vec3 own = texelFetch(leverages, at).xyz, around = texelFetch(surroundings, at).xyz;
    float count = texelFetch(colour, at).w;
    vec3 leverage = clamp(around + OWN / sqrt(max(count, 1.0)) * max(own - around, 0.0), 0.0, MOST);
    vec3 missed = vec3(scaled(a, e.rgb), scaled(b, e.rgb), scaled(c, e.rgb)) / (1.0 - leverage);
    float deviation = min(sqrt(e.w) / push.floor, LIMIT);
    // Between errors relative to luminance (^1), which are what is seen, and equal trust in bright and dark pixels (^2).
    float level = scaled((a + b + c) / 3.0, vec3(0.0)), weight = pow(level * level + 1.0, -0.65);
    vec4 square = weight * vec4(2.0 * deviation * deviation, missed * missed);
    // What few samples tell of their own variance follows their values: whoever relies on it seems better than it is.
    if (count < ENOUGH) square.xw = vec2(WORST);
    squares[i] = square;
    products[i] = vec4(weight * missed.xxy * missed.yzz, 0.0);
}
