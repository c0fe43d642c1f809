#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/probe.glsl"
#include "shared/candidates.glsl"

// What four candidates miss a pixel's luminance by when it is left out of their sums (cross-validation: Stone 1974,
// Craven and Wahba 1979), squared, over the luminance: a filter that keeps a part h of a pixel misses it by
// (filtered - pixel) / (1 - h), whose square is its error and the pixel's own noise. No filter would miss it by twice that.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer estimate; // of vec4
layout(binding = 1) uniform samplerBuffer colour; // of vec4
layout(binding = 2) uniform samplerBuffer filtered_1; // of vec4
layout(binding = 3) uniform samplerBuffer probed_1; // of vec4
layout(binding = 4) uniform samplerBuffer filtered_2; // of vec4
layout(binding = 5) uniform samplerBuffer probed_2; // of vec4
layout(binding = 6) uniform samplerBuffer filtered_3; // of vec4
layout(binding = 7) uniform samplerBuffer probed_3; // of vec4
layout(scalar, binding = 8) writeonly buffer Errors { vec4 errors[]; };
layout(scalar, push_constant) uniform Push { AutoPush push; };

const float ENOUGH = 4.0; // samples whose own variance is trusted
const float MOST = 0.9;   // of a pixel that a filter keeps: beyond it, too little is left to judge by
const float LIMIT = 1e9;  // of luminance and its differences, so that their squares are finite

float scaled(vec3 a, vec3 b) {
    return clamp(contrast(a, b) / push.floor, -LIMIT, LIMIT);
}

float missed(vec4 e, float added, vec3 filtered, vec3 probed) {
    float kept = clamp(contrast(probed, filtered) / added, 0.0, MOST), off = scaled(filtered, e.rgb) / (1.0 - kept);
    return off * off;
}

void main() {
    uint i = thread_index();
    if (i >= push.count) return; // safe: no barrier() follows
    int at = int(i);
    vec4 e = texelFetch(estimate, at);
    vec3 a = texelFetch(filtered_1, at).rgb, b = texelFetch(filtered_2, at).rgb, c = texelFetch(filtered_3, at).rgb;
    float added = probe(i, a, push.floor), level = scaled((a + b + c) / 3.0, vec3(0.0));
    float deviation = min(sqrt(e.w) / push.floor, LIMIT);
    vec4 missed = vec4(2.0 * deviation * deviation, missed(e, added, a, texelFetch(probed_1, at).rgb),
        missed(e, added, b, texelFetch(probed_2, at).rgb), missed(e, added, c, texelFetch(probed_3, at).rgb));
    vec4 relative = missed / sqrt(level * level + 1.0);
    // What few samples tell of their own variance follows their values: whoever relies on it seems better than it is.
    if (texelFetch(colour, at).w < ENOUGH) relative.xw = vec2(WORST);
    errors[i] = relative;
}
