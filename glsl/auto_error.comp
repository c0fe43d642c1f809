#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/probe.glsl"

// Stein's unbiased estimate of the squared error of luminance of four candidates (Li, Wu, Chuang 2012), relative to
// the squared luminance: no filter, and three filters by what they make of the image and of the probed image.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer estimate; // of vec4
layout(binding = 1) uniform samplerBuffer filtered_1; // of vec4
layout(binding = 2) uniform samplerBuffer probed_1; // of vec4
layout(binding = 3) uniform samplerBuffer filtered_2; // of vec4
layout(binding = 4) uniform samplerBuffer probed_2; // of vec4
layout(binding = 5) uniform samplerBuffer filtered_3; // of vec4
layout(binding = 6) uniform samplerBuffer probed_3; // of vec4
layout(scalar, binding = 7) writeonly buffer Errors { vec4 errors[]; };
layout(scalar, push_constant) uniform Push { AutoErrorPush push; };

const float WORST = 1e6;

float risk(vec4 e, float added, vec3 filtered, vec3 probed) {
    float off = contrast(filtered, e.rgb), kept = clamp(contrast(probed, filtered) / added, 0.0, 1.0);
    return off * off + e.w * (2.0 * kept - 1.0);
}

void main() {
    uint i = thread_index();
    if (i >= push.count) return; // safe: no barrier() follows
    int at = int(i);
    vec4 e = texelFetch(estimate, at);
    vec3 a = texelFetch(filtered_1, at).rgb, b = texelFetch(filtered_2, at).rgb, c = texelFetch(filtered_3, at).rgb;
    float added = probe(i, e), level = contrast((a + b + c) / 3.0, vec3(0.0));
    vec4 risks = vec4(e.w, risk(e, added, a, texelFetch(probed_1, at).rgb), risk(e, added, b, texelFetch(probed_2, at).rgb),
        risk(e, added, c, texelFetch(probed_3, at).rgb));
    // Unknown pixels have no error to estimate; they take their neighbours' choice.
    errors[i] = e.w >= 0.0 ? clamp(risks / (level * level + push.floor), -WORST, WORST) : vec4(2.0 * WORST);
}
