#include "shared/store64.glsl"

// Second pass of a summed-area table: sums rows' sums down one column per thread. A record of several vec4s is as many columns.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer rows; // of vec4
layout(scalar, binding = 1) writeonly buffer Table { u64vec2 table[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

void main() {
    int x = int(gl_GlobalInvocationID.x), width = int(push.size.x);
    if (x >= width) return;
    vec4 sum = vec4(0.0);
    for (int y = 0; y < int(push.size.y); y++) {
        sum += texelFetch(rows, y * width + x);
        table[y * width + x] = pack64(sum);
    }
}
