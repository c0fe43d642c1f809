#include "shared/thread.glsl"

// Computes the priority of one pixel per thread from the guides alone, before any radiance is known (Bauszat, Eisemann and
// Magnor 2011). Where neighbours differ in normal and position, a geometry-aware filter has few pixels to average. Every
// device computes the same bits.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer guides; // of Guide
layout(scalar, binding = 1) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/similarity.glsl"

void main() {
    uint i = thread_index();
    if (i < push.size.x * push.size.y) priority[i] = importance(i);
}
