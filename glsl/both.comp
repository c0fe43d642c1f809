#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"

// Noise that the samples show, less what a geometry-aware filter will remove of it. A filter that gathers a share W of
// its window divides the variance by about 1 + W (pixels - 1): the deviation that is left is what needs samples.
// Where nothing is known of the noise yet, geometry alone decides.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform samplerBuffer importances; // of float
layout(scalar, binding = 2) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/noise.glsl"

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return; // safe: no barrier() follows
    float gathered = 1.0 - texelFetch(importances, int(i)).x;
    priority[i] = noise(i) * sqrt(max(1.0 - push.filtered * gathered, 0.0));
}
