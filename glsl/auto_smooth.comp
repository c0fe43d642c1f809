#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"

// One level of plain A-Trous smoothing of error estimates: SURE is right on average only. Values above UNKNOWN are none.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer errors; // of vec4
layout(scalar, binding = 1) writeonly buffer Output { vec4 smoothed[]; };
layout(scalar, push_constant) uniform Push { AutoSmoothPush push; };

const float UNKNOWN = 1.5e6;
const float B3[3] = float[](3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0); // by |offset|

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return; // safe: no barrier() follows
    vec4 sum = vec4(0.0);
    float total = 0.0;
    for (int j = -2; j <= 2; j++) {
        for (int i = -2; i <= 2; i++) {
            ivec2 tap = clamp(at + int(push.spacing) * ivec2(i, j), ivec2(0), size - 1); // borders repeat
            vec4 e = texelFetch(errors, tap.y * size.x + tap.x);
            float w = e.x < UNKNOWN ? B3[abs(i)] * B3[abs(j)] : 0.0;
            sum += w * (w > 0.0 ? e : vec4(0.0));
            total += w;
        }
    }
    smoothed[at.y * size.x + at.x] = total > 0.0 ? sum / total : vec4(2e6);
}
