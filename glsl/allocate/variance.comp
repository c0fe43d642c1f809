#include "shared/thread.glsl"

// Computes the priority of one pixel per thread from the noise of its own and its eight neighbours' samples (Schalk 2018).
// The squared error is least when samples are in proportion to the standard deviation of one sample, so that the priority
// is a share of all samples, past ones included.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 1) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/pixel_noise.glsl"

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    ivec2 size = ivec2(push.size), at = ivec2(i % push.size.x, i / push.size.x);
    ivec2 first = max(at - 1, ivec2(0)), last = min(at + 1, size - 1);
    vec4 around = vec4(0.0);
    for (int y = first.y; y <= last.y; y++) {
        for (int x = first.x; x <= last.x; x++) around += moments(uint(y * size.x + x));
    }
    priority[i] = noise(moments(i), around);
}
