#include "shared/thread.glsl"

// Computes the priority of one pixel per thread as published (Schalk 2018, eq. 11 and 12, algorithm 1). Before round `limit`
// it is the pixel's own noise over its luminance. At round `limit` it becomes samples / `limit`, the probability of a sample
// from then on.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 1) buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/pixel_noise.glsl"

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    vec4 m = moments(i);
    float floored = max(push.luminance_floor, 0.0);
    float noise = (sqrt(max(m.x / m.y, 0.0)) + floored) / max(m.z / m.w + floored, 1e-20);
    if (push.luminance_floor < 0.0) noise = sqrt(max(m.x / m.y, 0.0));
    if (m.w < 2.0) noise = 1.0; // one sample shows no noise; 1 is the first threshold
    if (push.round < push.limit) priority[i] = noise;
    if (push.round == push.limit) priority[i] = m.w / float(push.limit);
}
