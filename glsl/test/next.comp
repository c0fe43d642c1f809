// Writes to[i] = 3 from[n - 1 - i] + 1, which reads what another thread of the previous pass wrote.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) readonly buffer From { uint from[]; };
layout(scalar, binding = 1) writeonly buffer To { uint to[]; };
layout(scalar, push_constant) uniform Push { uint push; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < push) to[i] = 3u * from[push - 1u - i] + 1u;
}
