#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"

// Four candidates, each in proportion to the inverse cube of its estimated error: nearly the best one alone where they
// differ, and no seam where the best one changes.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer errors; // of vec4
layout(binding = 1) uniform samplerBuffer colour; // of vec4
layout(binding = 2) uniform samplerBuffer filtered_1; // of vec4
layout(binding = 3) uniform samplerBuffer filtered_2; // of vec4
layout(binding = 4) uniform samplerBuffer filtered_3; // of vec4
layout(scalar, binding = 5) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return; // safe: no barrier() follows
    int at = int(i);
    vec4 e = max(texelFetch(errors, at), vec4(0.0)), c = texelFetch(colour, at);
    // An error below a two-hundredth of the noise cannot be told from none.
    vec4 w = 1.0 / (e + 0.005 * e.x + 1e-6);
    w = w * w * w;
    vec4 a = texelFetch(filtered_1, at), b = texelFetch(filtered_2, at), d = texelFetch(filtered_3, at);
    if (c.w == 0.0) w.x = 0.0;
    vec3 base = c.w > 0.0 ? c.rgb : a.rgb; // differences from it: a constant comes back exactly
    w *= vec4(1.0, sign(a.w), sign(b.w), sign(d.w)); // what a filter could not in-paint
    float total = dot(w, vec4(1.0));
    vec3 off = w.y * (a.rgb - base) + w.z * (b.rgb - base) + w.w * (d.rgb - base);
    filtered[i] = total > 0.0 ? vec4(base + off / total, c.w > 0.0 ? c.w : 1.0) : vec4(0.0);
}
