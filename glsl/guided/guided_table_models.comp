#include "shared/moments.glsl"
#include "shared/tiled_index.glsl"

// Solves for the linear model of one window per thread, from the corners of a summed-area table. Covariances are
// E[I I] - E[I] E[I], which loses digits to cancellation.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer table; // of vec4
layout(scalar, binding = 1) writeonly buffer SlopeR { u64vec2 slope_r[]; }; // of vec4
layout(scalar, binding = 2) writeonly buffer SlopeG { u64vec2 slope_g[]; }; // of vec4
layout(scalar, binding = 3) writeonly buffer SlopeB { u64vec2 slope_b[]; }; // of vec4
layout(scalar, binding = 4) writeonly buffer Values { u64vec2 value[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

#include "shared/summed_area.glsl"
#define SUM(member) window_sum(c, MOMENTS, member)

void main() {
    ivec2 size = ivec2(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    ivec4 c = corners(at, size, int(push.radius));
    Moments m = MOMENTS_LOAD(0, 1, SUM);
    float count = m.head.x, share = 1.0 / max(count, 1.0);
    vec3 n = share * m.head.yzw;
    vec4 i = share * m.mean;
    m.xx -= m.mean.x * i;
    m.yy -= m.mean.y * i.yzw;
    m.zz -= m.mean.zzw * i.zww;
    m.r -= n.r * m.mean;
    m.g -= n.g * m.mean;
    m.b -= n.b * m.mean;
    Factors f = factorised(m, count * push.eps);
    vec4 r = solved(f, m.r), g = solved(f, m.g), b = solved(f, m.b);
    int to = tiled_index(at.x, at.y, size.y);
    slope_r[to] = pack64(r);
    slope_g[to] = pack64(g);
    slope_b[to] = pack64(b);
    value[to] = pack64(vec4(n - vec3(dot(r, i), dot(g, i), dot(b, i)), min(count, 1.0)));
}
