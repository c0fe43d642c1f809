#include "shared/thread.glsl"

// Priority as published (Schalk 2018, eq. 11 and 12, algorithm 1): the pixel's own noise over its luminance until round
// `limit`; what it had of `limit` samples by then is its probability of a sample ever after.
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
    if (m.w < 2.0) noise = 1.0; // nothing is known: the first threshold
    if (push.round < push.limit) priority[i] = noise;
    if (push.round == push.limit) priority[i] = m.w / float(push.limit);
}
