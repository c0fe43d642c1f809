#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/probe.glsl"

// What three filters keep of a pixel: its leverage, the diagonal of the matrix that a linear filter is, plus what the probe
// brings along from neighbours, which is 0 on average (Ramani, Blu, Unser 2008).
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer filtered_1; // of vec4
layout(binding = 1) uniform samplerBuffer probed_1; // of vec4
layout(binding = 2) uniform samplerBuffer filtered_2; // of vec4
layout(binding = 3) uniform samplerBuffer probed_2; // of vec4
layout(binding = 4) uniform samplerBuffer filtered_3; // of vec4
layout(binding = 5) uniform samplerBuffer probed_3; // of vec4
layout(scalar, binding = 6) writeonly buffer Output { vec4 leverages[]; };
layout(scalar, push_constant) uniform Push { AutoPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return; // safe: no barrier() follows
    int at = int(i);
    vec3 a = texelFetch(filtered_1, at).rgb, b = texelFetch(filtered_2, at).rgb, c = texelFetch(filtered_3, at).rgb;
    vec3 grown = vec3(contrast(texelFetch(probed_1, at).rgb, a), contrast(texelFetch(probed_2, at).rgb, b),
        contrast(texelFetch(probed_3, at).rgb, c));
    leverages[i] = vec4(clamp(grown / probe(i, a, push.floor), -1.0, 1.0), 0.0);
}
