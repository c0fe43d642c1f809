#version 460
#extension GL_EXT_control_flow_attributes : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"
#include "shared/candidates.glsl"

// The blend of the image and three filters whose mean square of what it misses a left-out pixel by is least, with weights
// of at least 0. From the best one on, pairs trade weight until nothing is gained.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer squares; // of vec4
layout(binding = 1) uniform samplerBuffer products; // of vec4
layout(binding = 2) uniform samplerBuffer colour; // of vec4
layout(binding = 3) uniform samplerBuffer filtered_1; // of vec4
layout(binding = 4) uniform samplerBuffer filtered_2; // of vec4
layout(binding = 5) uniform samplerBuffer filtered_3; // of vec4
layout(scalar, binding = 6) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

const uint ROUNDS = 8u;     // of trades
const float RIDGE = 0.01;   // of every square, added: weights that the estimates cannot tell apart become alike

void main() {
    uint i = thread_index();
    if (i >= push.count) return; // safe: no barrier() follows
    int at = int(i);
    vec4 c = texelFetch(colour, at);
    vec4 a = texelFetch(filtered_1, at), b = texelFetch(filtered_2, at), d = texelFetch(filtered_3, at);
    bvec4 usable = greaterThan(vec4(c.w, a.w, b.w, d.w), vec4(0.0)); // false: a filter could not in-paint it
    vec4 square = mix(vec4(WORST), texelFetch(squares, at), usable);
    vec3 product = texelFetch(products, at).xyz;
    // An independent copy of the pixel misses it by both copies' noise, and has the pixel's in common with what a filter misses.
    float noise = 0.5 * square.x;
    vec4 own = square * (1.0 + RIDGE);
    mat4 missed = mat4(own.x, noise, noise, noise, noise, own.y, product.x, product.y, noise, product.x, own.z, product.z,
        noise, product.y, product.z, own.w);
    float least = min(min(square.x, square.y), min(square.z, square.w));
    vec4 w = vec4(0.0);
    [[unroll]] for (int k = 3; k >= 0; k--) {
        if (square[k] == least) w = vec4(equal(ivec4(0, 1, 2, 3), ivec4(k)));
    }
    for (uint round = 0u; round < ROUNDS; round++) {
        [[unroll]] for (int j = 0; j < 3; j++) {
            [[unroll]] for (int k = j + 1; k < 4; k++) {
                float bend = missed[j][j] + missed[k][k] - 2.0 * missed[j][k];
                float gain = dot(missed[k], w) - dot(missed[j], w);
                float moved = bend > 0.0 && usable[j] && usable[k] ? clamp(gain / bend, -w[j], w[k]) : 0.0;
                w[j] += moved;
                w[k] -= moved;
            }
        }
    }
    vec3 base = c.w > 0.0 ? c.rgb : a.rgb; // differences from it: a constant comes back exactly
    vec3 off = w.y * (a.rgb - base) + w.z * (b.rgb - base) + w.w * (d.rgb - base);
    filtered[i] = any(usable) ? vec4(base + off, c.w > 0.0 ? c.w : 1.0) : vec4(0.0);
}
