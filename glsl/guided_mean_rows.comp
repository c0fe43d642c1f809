#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/fit.glsl"
#include "shared/pixel.glsl"

// The guided filter's result: the mean model of all windows that cover a pixel, at the pixel's own guide. Blocks as in
// guided_columns.comp, along rows.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer columns; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer colour; // of vec4
layout(binding = 3) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 4) writeonly buffer Sums { vec4 sums[]; };
layout(scalar, binding = 5) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { GuidedPush push; };

layout(constant_id = 110) const bool BACKWARD = false; // the first of two dispatches: ends of blocks only

#define FETCH_COLUMN(at) texelFetch(columns, at)
#define FETCH_END(at) texelFetch(ends, at)

vec4 point_at(int row, int x) {
    return texelFetch(channels, (int(push.first_row) + row) * int(push.size.x) + x);
}

// Leaves `f` about the pixel that it absorbs; `point` is that of the last one.
void absorb_column(inout Fit f, inout vec4 point, int row, int x) {
    if (x < 0 || x >= int(push.size.x)) return;
    vec4 here = point_at(row, x);
    move(f, here - point);
    point = here;
    Fit column = FIT_LOAD(FIT * (row * int(push.size.x) + x), FETCH_COLUMN);
    absorb(f, column);
}

void main() {
    int row = int(gl_GlobalInvocationID.x), width = int(push.size.x), radius = int(push.radius);
    if (row >= int(push.rows)) return; // safe: no barrier() follows
    int window = 2 * radius + 1, first = int(gl_GlobalInvocationID.y) * window, count = min(window, width - first);
    Fit f = NO_FIT;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int i = window - 1; i >= 0; i--) {
            absorb_column(f, point, row, first - radius + i);
            if (i < count) {
                Fit moved = f;
                move(moved, point_at(row, first + i) - point);
                FIT_STORE(sums, FIT * (row * width + first + i), moved);
            }
        }
        return;
    }
    for (int i = 0; i < count; i++) {
        if (i > 0) absorb_column(f, point, row, first + radius + i);
        Fit whole = FIT_LOAD(FIT * (row * width + first + i), FETCH_END), moved = f;
        move(moved, point_at(row, first + i) - point);
        absorb(whole, moved);
        int pixel = (int(push.first_row) + row) * width + first + i;
        vec4 c = texelFetch(colour, pixel);
        // A model that no float can hold, or no known pixel in reach: the pixel stays as it is.
        bool usable = whole.value.w > 0.0 && finite(whole.value.rgb);
        filtered[pixel] = usable ? vec4(whole.value.rgb, c.w > 0.0 ? c.w : 1.0) : c;
    }
}
