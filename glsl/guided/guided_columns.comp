#include "shared/moments.glsl"
#include "shared/tiled_index.glsl"
#define SUM Moments
#define NO_SUM NO_MOMENTS
#include "shared/windows.glsl"

// First pass of the guided filter (guided_columns, guided_rows, guided_mean_columns, guided_mean_rows) over a strip of rows:
// sums the moments of the 1 x WINDOW pixels above and below every pixel. A thread walks down SEGMENT pixels of a column.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(scalar, binding = 2) writeonly buffer Sums { u64vec4 sums[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

int pixel_at(int x, int y) {
    return tiled_index(x, clamp(y, 0, int(push.size.y) - 1), int(push.size.y));
}

vec4 point_at(int x, int y) {
    return texelFetch(channels, pixel_at(x, y));
}

void merge_element(inout Moments m, vec4 point, int x, int y) {
    vec4 c = texelFetch(colour, pixel_at(x, y));
    bool known = y >= 0 && y < int(push.size.y) && c.w > 0.0;
    merge_means(m, known ? 1.0 : 0.0, c.rgb, point_at(x, y) - point);
}

void store(int x, int y, Moments whole, vec4 point) {
    whole = rebased(whole, point_at(x, y) - point);
    int at = strip_index(x, y - int(push.first_row), int(push.size.x), MOMENTS);
    MOMENTS_STORE(sums, at, 8, whole);
}

void main() {
    int x = int(gl_GlobalInvocationID.x), from = int(gl_GlobalInvocationID.y) * SEGMENT;
    if (x >= int(push.size.x)) return;
    walk(x, int(push.first_row) + from, int(push.first_row) + min(from + SEGMENT, int(push.rows)));
}
