#include "shared/linear_model.glsl"
#include "shared/sanitise.glsl"
#include "shared/tiled_index.glsl"
#define SUM Fit
#define NO_SUM NO_FIT
#include "shared/windows.glsl"

// Last pass of the guided filter: averages the models of all windows that cover a pixel and evaluates the mean at the pixel's
// own guide. A thread walks along SEGMENT pixels of a row.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer columns; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer colour; // of vec4
layout(scalar, binding = 3) writeonly buffer Output { u64vec2 filtered[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

#define FETCH_COLUMN(at) texelFetch(columns, at)

int pixel_at(int row, int x) {
    return tiled_index(clamp(x, 0, int(push.size.x) - 1), int(push.first_row) + row, int(push.size.y));
}

vec4 point_at(int row, int x) {
    return texelFetch(channels, pixel_at(row, x));
}

void merge_element(inout Fit f, vec4 point, int row, int x) {
    int width = int(push.size.x);
    int at = strip_index(clamp(x, 0, width - 1), row, width, FIT);
    Fit column = FIT_LOAD(at, 8, FETCH_COLUMN);
    merge(f, rebased(column, point - point_at(row, x)), x >= 0 && x < width);
}

void store(int row, int x, Fit whole, vec4 point) {
    int pixel = pixel_at(row, x);
    whole = rebased(whole, texelFetch(channels, pixel) - point);
    vec4 c = texelFetch(colour, pixel);
    // The pixel stays as it is where the model overflows or no known pixel is within reach.
    bool usable = whole.value.w > 0.0 && finite(whole.value.rgb);
    vec4 result = usable ? vec4(whole.value.rgb, c.w > 0.0 ? c.w : 1.0) : c;
    filtered[(int(push.first_row) + row) * int(push.size.x) + x] = pack64(result);
}

void main() {
    int row = int(gl_GlobalInvocationID.x), from = int(gl_GlobalInvocationID.y) * SEGMENT;
    if (row >= int(push.rows)) return;
    walk(row, from, min(from + SEGMENT, int(push.size.x)));
}
