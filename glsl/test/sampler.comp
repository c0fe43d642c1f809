#include "effects.glsl"
#include "shared/sampler.glsl"

// Writes the words of sample_2d_bits and the floats of sample_2d for query i = (pixel, sample index, pair) in thread i.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer Queries { uvec3 queries[]; };
layout(scalar, binding = 1) writeonly buffer Words { uvec2 words[]; };
layout(scalar, binding = 2) writeonly buffer Floats { vec2 floats[]; };
layout(scalar, push_constant) uniform Push { TestPush push; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count) return;
    uvec3 q = queries[i];
    Sampler s = sampler_start(q.x, q.y, push.seed);
    words[i] = sample_2d_bits(s, q.z);
    floats[i] = sample_2d(s, q.z);
}
