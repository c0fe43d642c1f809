#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/moments.glsl"

// The linear model a . I + b of every window (He et al. 2010, equation 19), from the moments of its columns: blocks as
// in guided_columns.comp, along rows. Instead of b it keeps the model's value at the window's own centre.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer columns; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 3) writeonly buffer Sums { vec4 sums[]; };
layout(scalar, binding = 4) writeonly buffer SlopeR { vec4 slope_r[]; };
layout(scalar, binding = 5) writeonly buffer SlopeG { vec4 slope_g[]; };
layout(scalar, binding = 6) writeonly buffer SlopeB { vec4 slope_b[]; };
layout(scalar, binding = 7) writeonly buffer Values { vec4 value[]; };
layout(scalar, push_constant) uniform Push { GuidedPush push; };

layout(constant_id = 110) const bool BACKWARD = false; // the first of two dispatches: ends of blocks only

#define FETCH_COLUMN(at) texelFetch(columns, at)
#define FETCH_END(at) texelFetch(ends, at)

vec4 point_at(int row, int x) {
    return texelFetch(channels, (int(push.first_row) + row) * int(push.size.x) + x);
}

// Leaves `m` about the pixel that it absorbs; `point` is that of the last one.
void absorb_column(inout Moments m, inout vec4 point, int row, int x) {
    if (x < 0 || x >= int(push.size.x)) return;
    vec4 here = point_at(row, x);
    m = moved(m, here - point);
    point = here;
    Moments column = MOMENTS_LOAD(MOMENTS * (row * int(push.size.x) + x), FETCH_COLUMN);
    absorb(m, column);
}

void main() {
    int row = int(gl_GlobalInvocationID.x), width = int(push.size.x);
    if (row >= int(push.rows)) return; // safe: no barrier() follows
    int window = 2 * int(push.radius) + 1, first = int(gl_GlobalInvocationID.y) * window;
    int left = first - int(push.radius), count = min(window, width - first);
    Moments m = NO_MOMENTS;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int i = window - 1; i >= 0; i--) {
            absorb_column(m, point, row, left + i);
            if (i < count) {
                Moments end = moved(m, point_at(row, first + i) - point);
                MOMENTS_STORE(sums, MOMENTS * (row * width + first + i), end);
            }
        }
        return;
    }
    for (int i = 0; i < count; i++) {
        if (i > 0) absorb_column(m, point, row, left + window + i - 1);
        Moments whole = MOMENTS_LOAD(MOMENTS * (row * width + first + i), FETCH_END);
        absorb(whole, moved(m, point_at(row, first + i) - point));
        vec4 r, g, b;
        solve(whole, whole.head.x * push.eps, r, g, b);
        int pixel = (int(push.first_row) + row) * width + first + i;
        slope_r[pixel] = r;
        slope_g[pixel] = g;
        slope_b[pixel] = b;
        value[pixel] = vec4(whole.head.yzw - vec3(dot(r, whole.mean), dot(g, whole.mean), dot(b, whole.mean)), min(whole.head.x, 1.0));
    }
}
