#include "shared/linear_model.glsl"
#include "shared/tiled_index.glsl"
#include "shared/window_blocks.glsl"
#define SUM Fit
#define NO_SUM NO_FIT
#include "shared/windows.glsl"

// Third pass of the guided filter: averages the models of all windows that cover a block and are centred in its column. A
// thread walks down a column of the strip.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer slope_r; // of vec4
layout(binding = 1) uniform samplerBuffer slope_g; // of vec4
layout(binding = 2) uniform samplerBuffer slope_b; // of vec4
layout(binding = 3) uniform samplerBuffer value; // of vec4
layout(binding = 4) uniform samplerBuffer channels; // of vec4
layout(scalar, binding = 5) writeonly buffer Sums { u64vec4 sums[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

vec4 point_at(int x, int y) {
    int first = clamp(y, 0, blocks_of(push.size).y - 1) * STEP;
    return texelFetch(channels, tiled_index(x * STEP, first, int(push.size.y)));
}

void merge_element(inout Fit f, vec4 point, int x, int y) {
    int rows = blocks_of(push.size).y, at = tiled_index(x, clamp(y, 0, rows - 1), rows);
    Fit model = Fit(texelFetch(slope_r, at), texelFetch(slope_g, at), texelFetch(slope_b, at), texelFetch(value, at));
    bool exists = y >= 0 && y < rows;
    merge(f, rebased(model, point - point_at(x, y)), exists);
}

void store(int x, int y, Fit whole, vec4 point) {
    whole = rebased(whole, point_at(x, y) - point);
    int at = strip_index(x, y - int(push.first_row), blocks_of(push.size).x, FIT);
    FIT_STORE(sums, at, 8, whole);
}

void main() {
    int x = int(gl_GlobalInvocationID.x);
    if (x < blocks_of(push.size).x) walk(x, int(push.first_row), int(push.rows));
}
