#include "shared/linear_model.glsl"
#include "shared/sanitise.glsl"
#include "shared/tiled_index.glsl"
#include "shared/window_blocks.glsl"
#define SUM Fit
#define NO_SUM NO_FIT
#include "shared/windows.glsl"

// Last pass of the guided filter: averages the models of all windows that cover a block and evaluates the mean at the guides of
// its pixels. A thread walks along a row.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer columns; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer colour; // of vec4
layout(scalar, binding = 3) writeonly buffer Output { u64vec2 filtered[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

#define FETCH_COLUMN(at) texelFetch(columns, at)

vec4 point_at(int row, int x) {
    int first = clamp(x, 0, blocks_of(push.size).x - 1) * STEP;
    return texelFetch(channels, tiled_index(first, (int(push.first_row) + row) * STEP, int(push.size.y)));
}

void merge_element(inout Fit f, vec4 point, int row, int x) {
    int width = blocks_of(push.size).x;
    int at = strip_index(clamp(x, 0, width - 1), row, width, FIT);
    Fit column = FIT_LOAD(at, 8, FETCH_COLUMN);
    merge(f, rebased(column, point - point_at(row, x)), x >= 0 && x < width);
}

void store(int row, int x, Fit whole, vec4 point) {
    ivec2 size = ivec2(push.size), first = ivec2(x, int(push.first_row) + row) * STEP;
    [[unroll]] for (int j = 0; j < STEP; j++) {
        [[unroll]] for (int i = 0; i < STEP; i++) {
            ivec2 at = first + ivec2(i, j), inside = min(at, size - 1);
            int pixel = tiled_index(inside.x, inside.y, size.y);
            vec4 c = texelFetch(colour, pixel);
            Fit here = rebased(whole, texelFetch(channels, pixel) - point);
            // The pixel stays as it is where the model overflows or no known pixel is within reach.
            bool usable = here.value.w > 0.0 && finite(here.value.rgb);
            vec4 result = usable ? vec4(here.value.rgb, c.w > 0.0 ? c.w : 1.0) : c;
            if (at == inside) filtered[at.y * size.x + at.x] = pack64(result);
        }
    }
}

void main() {
    int row = int(gl_GlobalInvocationID.x);
    if (row < int(push.rows)) walk(row, 0, blocks_of(push.size).x);
}
