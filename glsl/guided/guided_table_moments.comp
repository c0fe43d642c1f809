#include "shared/moments.glsl"
#include "shared/tiled_index.glsl"

// First pass of the summed-area table (Crow 1984) of N, I and their products, as Bauszat et al. 2011 (section 3.3) describe
// it: running sums along one row per thread, about 0.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(scalar, binding = 2) writeonly buffer Table { u64vec4 table[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

void main() {
    int y = int(gl_GlobalInvocationID.x), width = int(push.size.x), height = int(push.size.y);
    if (y >= height) return;
    Moments m = NO_MOMENTS;
    for (int x = 0; x < width; x++) {
        vec4 c = texelFetch(colour, tiled_index(x, y, height)), i = texelFetch(channels, tiled_index(x, y, height));
        if (c.w == 0.0) i = vec4(0.0);
        m.head += vec4(c.w > 0.0 ? 1.0 : 0.0, c.rgb);
        m.mean += i;
        m.xx += i.x * i;
        m.yy += i.y * i.yzw;
        m.zz += i.zzw * i.zww;
        m.r += c.r * i;
        m.g += c.g * i;
        m.b += c.b * i;
        MOMENTS_STORE(table, MOMENTS / 2 * (y * width + x), 1, m);
    }
}
