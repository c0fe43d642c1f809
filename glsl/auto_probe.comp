#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/probe.glsl"

// The image with a small known noise on top: how much of that a filter keeps is its divergence (Ramani, Blu, Unser 2008).
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer around; // of vec4
layout(scalar, binding = 2) writeonly buffer Output { vec4 probed[]; };
layout(scalar, push_constant) uniform Push { AutoPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return; // safe: no barrier() follows
    vec4 c = texelFetch(colour, int(i));
    probed[i] = vec4(c.rgb + probe(i, texelFetch(around, int(i)).rgb, push.floor), c.w);
}
