#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/fit.glsl"

// Mean of the models of all windows that cover a pixel and are centred in its column; blocks as in guided_columns.comp.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer slope_r; // of vec4
layout(binding = 1) uniform samplerBuffer slope_g; // of vec4
layout(binding = 2) uniform samplerBuffer slope_b; // of vec4
layout(binding = 3) uniform samplerBuffer value; // of vec4
layout(binding = 4) uniform samplerBuffer channels; // of vec4
layout(binding = 5) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 6) writeonly buffer Sums { vec4 sums[]; };
layout(scalar, push_constant) uniform Push { GuidedPush push; };

layout(constant_id = 110) const bool BACKWARD = false; // the first of two dispatches: ends of blocks only

#define FETCH_END(at) texelFetch(ends, at)

int pixel_at(int x, int y) {
    return clamp(y, 0, int(push.size.y) - 1) * int(push.size.x) + x;
}

// Leaves `f` about the pixel that it absorbs; `point` is that of the last one.
void absorb_pixel(inout Fit f, inout vec4 point, int x, int y) {
    if (y < 0 || y >= int(push.size.y)) return;
    int at = pixel_at(x, y);
    vec4 here = texelFetch(channels, at);
    move(f, here - point);
    point = here;
    absorb(f, Fit(texelFetch(slope_r, at), texelFetch(slope_g, at), texelFetch(slope_b, at), texelFetch(value, at)));
}

void main() {
    int x = int(gl_GlobalInvocationID.x), width = int(push.size.x), radius = int(push.radius);
    if (x >= width) return; // safe: no barrier() follows
    int window = 2 * radius + 1, first = int(gl_GlobalInvocationID.y) * window;
    int middle = int(push.first_row) + first, rows = min(window, int(push.rows) - first);
    Fit f = NO_FIT;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int i = window - 1; i >= 0; i--) {
            absorb_pixel(f, point, x, middle - radius + i);
            if (i < rows) {
                Fit moved = f;
                move(moved, texelFetch(channels, pixel_at(x, middle + i)) - point);
                FIT_STORE(sums, FIT * ((first + i) * width + x), moved);
            }
        }
        return;
    }
    for (int i = 0; i < rows; i++) {
        if (i > 0) absorb_pixel(f, point, x, middle + radius + i);
        int at = FIT * ((first + i) * width + x);
        Fit whole = FIT_LOAD(at, FETCH_END), moved = f;
        move(moved, texelFetch(channels, pixel_at(x, middle + i)) - point);
        absorb(whole, moved);
        FIT_STORE(sums, at, whole);
    }
}
