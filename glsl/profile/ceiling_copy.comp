#include "shared/thread.glsl"
#include "shared/store64.glsl"

// Copies memory from one buffer to another, one element of 16 bytes per thread, to measure how fast a kernel can move bytes. It
// reads texels and writes 8 bytes at a time, as filters do: lavapipe is fastest so.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer source; // of vec4
layout(scalar, binding = 1) writeonly buffer Target { u64vec2 target[]; }; // of vec4
layout(scalar, push_constant) uniform Push { uint push; }; // elements

void main() {
    uint i = thread_index();
    if (i < push) target[i] = pack64(texelFetch(source, int(i)));
}
