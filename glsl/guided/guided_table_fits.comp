#include "shared/linear_model.glsl"
#include "shared/tiled_index.glsl"

// First pass of the models' summed-area table: running sums along one row per thread.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer slope_r; // of vec4
layout(binding = 1) uniform samplerBuffer slope_g; // of vec4
layout(binding = 2) uniform samplerBuffer slope_b; // of vec4
layout(binding = 3) uniform samplerBuffer value; // of vec4
layout(scalar, binding = 4) writeonly buffer Table { u64vec4 table[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

void main() {
    int y = int(gl_GlobalInvocationID.x), width = int(push.size.x), height = int(push.size.y);
    if (y >= height) return;
    Fit f = NO_FIT;
    for (int x = 0; x < width; x++) {
        int at = tiled_index(x, y, height);
        f.r += texelFetch(slope_r, at);
        f.g += texelFetch(slope_g, at);
        f.b += texelFetch(slope_b, at);
        f.value += texelFetch(value, at);
        FIT_STORE(table, FIT / 2 * (y * width + x), 1, f);
    }
}
