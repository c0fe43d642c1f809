#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/moments.glsl"
#include "shared/tiles.glsl"

// Moments over the part of every window that lies in its centre's column, tile by tile of a strip.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 3) writeonly buffer Sums { u64vec2 sums[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

layout(constant_id = 110) const bool BACKWARD = false; // the first of two dispatches: ends of blocks only

#define FETCH_END(at) texelFetch(ends, at)

// Of the strip's row, which may lie outside the strip.
int pixel_at(int x, int row) {
    return blocked(x, clamp(int(push.first_row) + row, 0, int(push.size.y) - 1), int(push.size.y));
}

vec4 point_at(int x, int row) {
    return texelFetch(channels, pixel_at(x, row));
}

void absorb_pixel(inout Moments m, vec4 point, int x, int row, bool within) {
    vec4 c = texelFetch(colour, pixel_at(x, row));
    int y = int(push.first_row) + row;
    bool known = within && y >= 0 && y < int(push.size.y) && c.w > 0.0;
    absorb_means(m, known ? 1.0 : 0.0, c.rgb, point_at(x, row) - point);
}

void main() {
    int x = int(gl_GlobalInvocationID.x), index = int(gl_GlobalInvocationID.y), width = int(push.size.x);
    if (x >= width) return; // safe: no barrier() follows
    Block b = block_at(index, int(push.radius), int(push.rows));
    Moments m = NO_MOMENTS;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int tile = last_tile(b); tile >= 0; tile -= TILE) {
            vec4 here = point_at(x, middle(b, tile));
            m = moved(m, here - point);
            point = here;
            if (tile < b.count) { MOMENTS_STORE(sums, MOMENTS * end_at(b, tile, x, width), m); }
            [[unroll]] for (int j = TILE - 1; j >= 0; j--) absorb_pixel(m, point, x, b.left + tile + j, tile + j < b.window);
        }
        return;
    }
    for (int tile = 0; tile < b.count; tile += TILE) {
        vec4 here = point_at(x, middle(b, tile));
        m = moved(m, here - point);
        point = here;
        Moments tail = MOMENTS_LOAD(MOMENTS * end_at(b, tile, x, width), FETCH_END), end[TILE];
        [[unroll]] for (int j = TILE - 1; j >= 0; j--) {
            absorb_pixel(tail, point, x, b.left + tile + j, tile + j < b.window);
            end[j] = tail;
        }
        [[unroll]] for (int j = 0; j < TILE; j++) {
            int row = b.first + tile + j;
            Moments whole = end[j];
            absorb(whole, m, 1.0);
            whole = moved(whole, point_at(x, row) - point);
            if (tile + j < b.count) { MOMENTS_STORE(sums, MOMENTS * (row * width + x), whole); }
            absorb_pixel(m, point, x, b.left + b.window + tile + j, true);
        }
    }
}
