#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/moments.glsl"
#include "shared/tiles.glsl"

// The linear model a . I + b of every window (He et al. 2010, equation 19), from the moments of its columns, tile by
// tile of a row. Instead of b it keeps the model's value at the window's own centre.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer columns; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 3) writeonly buffer Sums { u64vec2 sums[]; }; // of vec4
layout(scalar, binding = 4) writeonly buffer SlopeR { u64vec2 slope_r[]; }; // of vec4
layout(scalar, binding = 5) writeonly buffer SlopeG { u64vec2 slope_g[]; }; // of vec4
layout(scalar, binding = 6) writeonly buffer SlopeB { u64vec2 slope_b[]; }; // of vec4
layout(scalar, binding = 7) writeonly buffer Values { u64vec2 value[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPush push; };

layout(constant_id = 110) const bool BACKWARD = false; // the first of two dispatches: ends of blocks only

#define FETCH_COLUMN(at) texelFetch(columns, at)
#define FETCH_END(at) texelFetch(ends, at)

vec4 point_at(int row, int x) {
    return texelFetch(channels, blocked(min(x, int(push.size.x) - 1), int(push.first_row) + row, int(push.size.y)));
}

void absorb_column(inout Moments m, vec4 point, int row, int x, bool within) {
    bool is = within && x >= 0 && x < int(push.size.x);
    x = clamp(x, 0, int(push.size.x) - 1);
    Moments column = MOMENTS_LOAD(MOMENTS * (row * int(push.size.x) + x), FETCH_COLUMN);
    column.mean += point_at(row, x) - point;
    absorb(m, column, is ? 1.0 : 0.0);
}

void main() {
    int row = int(gl_GlobalInvocationID.x), index = int(gl_GlobalInvocationID.y), width = int(push.size.x);
    int rows = int(push.rows);
    if (row >= rows) return; // safe: no barrier() follows
    Block b = block_at(index, int(push.radius), width);
    Moments m = NO_MOMENTS;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int tile = last_tile(b); tile >= 0; tile -= TILE) {
            vec4 here = point_at(row, middle(b, tile));
            m = moved(m, here - point);
            point = here;
            if (tile < b.count) { MOMENTS_STORE(sums, MOMENTS * end_at(b, tile, row, rows), m); }
            [[unroll]] for (int j = TILE - 1; j >= 0; j--) absorb_column(m, point, row, b.left + tile + j, tile + j < b.window);
        }
        return;
    }
    for (int tile = 0; tile < b.count; tile += TILE) {
        vec4 here = point_at(row, middle(b, tile));
        m = moved(m, here - point);
        point = here;
        Moments tail = MOMENTS_LOAD(MOMENTS * end_at(b, tile, row, rows), FETCH_END), end[TILE];
        [[unroll]] for (int j = TILE - 1; j >= 0; j--) {
            absorb_column(tail, point, row, b.left + tile + j, tile + j < b.window);
            end[j] = tail;
        }
        [[unroll]] for (int j = 0; j < TILE; j++) {
            int x = b.first + tile + j;
            Moments whole = end[j];
            absorb(whole, m, 1.0);
            vec4 r, g, blue, off = point_at(row, x) - point - whole.mean;
            solve(whole, whole.head.x * push.eps, r, g, blue);
            if (tile + j < b.count) {
                int at = blocked(x, int(push.first_row) + row, int(push.size.y));
                vec3 here = whole.head.yzw + vec3(dot(r, off), dot(g, off), dot(blue, off));
                slope_r[at] = paired(r);
                slope_g[at] = paired(g);
                slope_b[at] = paired(blue);
                value[at] = paired(vec4(here, min(whole.head.x, 1.0)));
            }
            absorb_column(m, point, row, b.left + b.window + tile + j, true);
        }
    }
}
