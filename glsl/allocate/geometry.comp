#include "shared/thread.glsl"

// Importance before any radiance is known (Bauszat, Eisemann and Magnor 2011): where neighbours differ in normal and
// position, a geometry-aware filter has little to gather. The same bits on every device.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer guides; // of Guide
layout(scalar, binding = 1) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/similarity.glsl"

void main() {
    uint i = thread_index();
    if (i < push.size.x * push.size.y) priority[i] = importance(i);
}
