#include "shared/moments.glsl"
#include "shared/tiled_index.glsl"
#include "shared/window_blocks.glsl"
#define SUM Moments
#define NO_SUM NO_MOMENTS
#include "shared/windows.glsl"

// First pass of the guided filter (guided_columns, guided_rows, guided_mean_columns, guided_mean_rows) over a strip of rows of
// blocks: sums the moments of the 1 x WINDOW blocks above and below every block. A thread walks down a column.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(scalar, binding = 2) writeonly buffer Sums { u64vec4 sums[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

int pixel_at(int x, int y) {
    ivec2 at = clamp(ivec2(x, y), ivec2(0), ivec2(push.size) - 1);
    return tiled_index(at.x, at.y, int(push.size.y));
}

vec4 point_at(int x, int y) {
    return texelFetch(channels, pixel_at(x * STEP, y * STEP));
}

void merge_element(inout Moments m, vec4 point, int x, int y) {
    [[unroll]] for (int j = 0; j < STEP; j++) {
        [[unroll]] for (int i = 0; i < STEP; i++) {
            int u = x * STEP + i, v = y * STEP + j, at = pixel_at(u, v);
            vec4 c = texelFetch(colour, at);
            bool known = u < int(push.size.x) && v >= 0 && v < int(push.size.y) && c.w > 0.0;
            merge_means(m, known ? 1.0 : 0.0, c.rgb, texelFetch(channels, at) - point);
        }
    }
}

void store(int x, int y, Moments whole, vec4 point) {
    whole = rebased(whole, point_at(x, y) - point);
    int at = strip_index(x, y - int(push.first_row), blocks_of(push.size).x, MOMENTS);
    MOMENTS_STORE(sums, at, 8, whole);
}

void main() {
    int x = int(gl_GlobalInvocationID.x);
    if (x < blocks_of(push.size).x) walk(x, int(push.first_row), int(push.rows));
}
