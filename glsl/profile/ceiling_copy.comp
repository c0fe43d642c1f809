#include "shared/thread.glsl"

// Copies memory from one buffer to another, one element of 16 bytes per thread, to measure how fast a kernel can move bytes.
layout(local_size_x_id = 100) in;
layout(scalar, binding = 0) readonly buffer Source { vec4 source[]; };
layout(scalar, binding = 1) writeonly buffer Target { vec4 target[]; };
layout(scalar, push_constant) uniform Push { uint push; }; // elements

void main() {
    uint i = thread_index();
    if (i < push) target[i] = source[i];
}
