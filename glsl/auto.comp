#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"
#include "shared/candidates.glsl"

// Four candidates, each in proportion to the inverse cube of what it misses more than the best one: nearly that one alone
// where they differ, and no seam where the best one changes.
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
    vec4 c = texelFetch(colour, at);
    vec4 a = texelFetch(filtered_1, at), b = texelFetch(filtered_2, at), d = texelFetch(filtered_3, at);
    vec4 usable = vec4(greaterThan(vec4(c.w, a.w, b.w, d.w), vec4(0.0))); // 0: a filter could not in-paint it
    vec4 e = mix(vec4(WORST), texelFetch(errors, at), usable);
    float least = min(min(e.x, e.y), min(e.z, e.w));
    // Differences below a thirtieth, the noise included, cannot be told from none.
    float slack = 0.035 * least + 1e-6;
    vec4 w = slack / (e - least + slack);
    w *= usable * w * w;
    vec3 base = c.w > 0.0 ? c.rgb : a.rgb; // differences from it: a constant comes back exactly
    float total = dot(w, vec4(1.0));
    vec3 off = w.y * (a.rgb - base) + w.z * (b.rgb - base) + w.w * (d.rgb - base);
    filtered[i] = total > 0.0 ? vec4(base + off / total, c.w > 0.0 ? c.w : 1.0) : vec4(0.0);
}
