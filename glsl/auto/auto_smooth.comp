#include "shared/edge.glsl"
#include "shared/b3_spline.glsl"

// One level of A-Trous smoothing, per pixel and thread, of one plane of estimates or three, which are right on average only.
// Pixels of like surfaces count by their edge weights, others at least by `push.least`. Unknown pixels, which have no
// estimate, take their neighbours'.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform usamplerBuffer place; // of uvec4
layout(binding = 2) uniform samplerBuffer first; // of vec4
layout(binding = 3) uniform samplerBuffer second; // of vec4
layout(binding = 4) uniform samplerBuffer third; // of vec4
layout(scalar, binding = 5) writeonly buffer First { vec4 first_smoothed[]; };
layout(scalar, binding = 6) writeonly buffer Second { vec4 second_smoothed[]; };
layout(scalar, binding = 7) writeonly buffer Third { vec4 third_smoothed[]; };
layout(scalar, push_constant) uniform Push { AutoSmoothPush push; };

#include "shared/packed_pixels.glsl"

layout(constant_id = 114) const bool THREE = true; // false: the first plane alone

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    Pixel p = pixel_at(at.y * size.x + at.x);
    vec4 sum_1 = vec4(0.0), sum_2 = vec4(0.0), sum_3 = vec4(0.0);
    float total = 0.0;
    // Tested at its end: see shared/traverse.glsl.
    int j = -2;
    do {
        [[unroll]] for (int i = -2; i <= 2; i++) {
            ivec2 tap = clamp(at + int(push.spacing) * ivec2(i, j), ivec2(0), size - 1); // borders repeat
            int there = tap.y * size.x + tap.x;
            Pixel q = pixel_at(there);
            float alike = edge_weight(q, edge_exponent(p, q, push.rates));
            float w = b3_spline(i) * b3_spline(j) * (q.colour.w > 0.0 ? max(alike, push.least) : 0.0);
            sum_1 += w * texelFetch(first, there);
            if (THREE) {
                sum_2 += w * texelFetch(second, there);
                sum_3 += w * texelFetch(third, there);
            }
            total += w;
        }
    } while (++j <= 2);
    int here = at.y * size.x + at.x;
    float share = total > 0.0 ? 1.0 / total : 0.0;
    first_smoothed[here] = share * sum_1;
    if (THREE) {
        second_smoothed[here] = share * sum_2;
        third_smoothed[here] = share * sum_3;
    }
}
