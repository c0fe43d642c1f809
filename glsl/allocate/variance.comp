#include "shared/thread.glsl"

// Computes the priority of one pixel per thread from the noise of its own and its eight neighbours' samples (Schalk 2018).
// The squared error is least when samples are in proportion to the standard deviation of one sample, so that the priority
// is a share of all samples, past ones included. Neighbours are a stride apart: where the light that a filter takes is traced for
// some pixels only, these are noisier than the others.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 1) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/pixel_noise.glsl"

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    ivec2 size = ivec2(push.size), at = ivec2(i % push.size.x, i / push.size.x);
    vec4 around = vec4(0.0);
    for (int n = 0; n < 9; n++) {
        ivec2 q = at + (ivec2(n % 3, n / 3) - 1) * int(push.stride);
        if (all(greaterThanEqual(q, ivec2(0))) && all(lessThan(q, size))) around += moments(uint(q.y * size.x + q.x));
    }
    priority[i] = noise(moments(i), around);
}
