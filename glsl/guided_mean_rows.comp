#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/fit.glsl"
#include "shared/pixel.glsl"
#include "shared/tiles.glsl"

// The guided filter's result: the mean model of all windows that cover a pixel, at the pixel's own guide; tile by tile
// of a row.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer columns; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer colour; // of vec4
layout(binding = 3) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 4) writeonly buffer Sums { u64vec2 sums[]; }; // of vec4
layout(scalar, binding = 5) writeonly buffer Output { u64vec2 filtered[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

layout(constant_id = 110) const bool BACKWARD = false; // the first of two dispatches: ends of blocks only

#define FETCH_COLUMN(at) texelFetch(columns, at)
#define FETCH_END(at) texelFetch(ends, at)

int pixel_at(int row, int x) {
    return blocked(min(x, int(push.size.x) - 1), int(push.first_row) + row, int(push.size.y));
}

vec4 point_at(int row, int x) {
    return texelFetch(channels, pixel_at(row, x));
}

void absorb_column(inout Fit f, vec4 point, int row, int x, bool within) {
    bool is = within && x >= 0 && x < int(push.size.x);
    x = clamp(x, 0, int(push.size.x) - 1);
    Fit column = FIT_LOAD(FIT * (row * int(push.size.x) + x), FETCH_COLUMN);
    absorb(f, moved(column, point - point_at(row, x)), is ? 1.0 : 0.0);
}

void main() {
    int row = int(gl_GlobalInvocationID.x), index = int(gl_GlobalInvocationID.y), rows = int(push.rows);
    if (row >= rows) return; // safe: no barrier() follows
    Block b = block_at(index, int(push.radius), int(push.size.x));
    Fit f = NO_FIT;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int tile = last_tile(b); tile >= 0; tile -= TILE) {
            vec4 here = point_at(row, middle(b, tile));
            f = moved(f, here - point);
            point = here;
            if (tile < b.count) { FIT_STORE(sums, FIT * end_at(b, tile, row, rows), f); }
            [[unroll]] for (int j = TILE - 1; j >= 0; j--) absorb_column(f, point, row, b.left + tile + j, tile + j < b.window);
        }
        return;
    }
    for (int tile = 0; tile < b.count; tile += TILE) {
        vec4 here = point_at(row, middle(b, tile));
        f = moved(f, here - point);
        point = here;
        Fit tail = FIT_LOAD(FIT * end_at(b, tile, row, rows), FETCH_END), end[TILE];
        [[unroll]] for (int j = TILE - 1; j >= 0; j--) {
            absorb_column(tail, point, row, b.left + tile + j, tile + j < b.window);
            end[j] = tail;
        }
        [[unroll]] for (int j = 0; j < TILE; j++) {
            int pixel = pixel_at(row, b.first + tile + j);
            Fit whole = end[j];
            absorb(whole, f, 1.0);
            whole = moved(whole, texelFetch(channels, pixel) - point);
            vec4 c = texelFetch(colour, pixel);
            // A model that no float can hold, or no known pixel in reach: the pixel stays as it is.
            bool usable = whole.value.w > 0.0 && finite(whole.value.rgb);
            vec4 result = usable ? vec4(whole.value.rgb, c.w > 0.0 ? c.w : 1.0) : c;
            int at = (int(push.first_row) + row) * int(push.size.x) + b.first + tile + j;
            if (tile + j < b.count) filtered[at] = paired(result);
            absorb_column(f, point, row, b.left + b.window + tile + j, true);
        }
    }
}
