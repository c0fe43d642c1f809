#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"

// Priority by the noise that the samples show (Schalk 2018). Squared error is least when a pixel's samples are in
// proportion to the deviation of one of them, so the priority is a share of all samples, past ones included.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 1) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/noise.glsl"

void main() {
    uint i = thread_index();
    if (i < push.size.x * push.size.y) priority[i] = noise(i);
}
