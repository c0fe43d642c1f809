#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/fit.glsl"
#include "shared/tiles.glsl"

// Mean of the models of all windows that cover a pixel and are centred in its column, tile by tile of a strip.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer slope_r; // of vec4
layout(binding = 1) uniform samplerBuffer slope_g; // of vec4
layout(binding = 2) uniform samplerBuffer slope_b; // of vec4
layout(binding = 3) uniform samplerBuffer value; // of vec4
layout(binding = 4) uniform samplerBuffer channels; // of vec4
layout(binding = 5) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 6) writeonly buffer Sums { u64vec2 sums[]; }; // of vec4
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

void absorb_pixel(inout Fit f, vec4 point, int x, int row, bool within) {
    int y = int(push.first_row) + row, at = pixel_at(x, row);
    bool is = within && y >= 0 && y < int(push.size.y);
    Fit model = Fit(texelFetch(slope_r, at), texelFetch(slope_g, at), texelFetch(slope_b, at), texelFetch(value, at));
    absorb(f, moved(model, point - point_at(x, row)), is ? 1.0 : 0.0);
}

void main() {
    int x = int(gl_GlobalInvocationID.x), index = int(gl_GlobalInvocationID.y), width = int(push.size.x);
    if (x >= width) return; // safe: no barrier() follows
    Block b = block_at(index, int(push.radius), int(push.rows));
    Fit f = NO_FIT;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int tile = last_tile(b); tile >= 0; tile -= TILE) {
            vec4 here = point_at(x, middle(b, tile));
            f = moved(f, here - point);
            point = here;
            if (tile < b.count) { FIT_STORE(sums, FIT * end_at(b, tile, x, width), f); }
            [[unroll]] for (int j = TILE - 1; j >= 0; j--) absorb_pixel(f, point, x, b.left + tile + j, tile + j < b.window);
        }
        return;
    }
    for (int tile = 0; tile < b.count; tile += TILE) {
        vec4 here = point_at(x, middle(b, tile));
        f = moved(f, here - point);
        point = here;
        Fit tail = FIT_LOAD(FIT * end_at(b, tile, x, width), FETCH_END), end[TILE];
        [[unroll]] for (int j = TILE - 1; j >= 0; j--) {
            absorb_pixel(tail, point, x, b.left + tile + j, tile + j < b.window);
            end[j] = tail;
        }
        [[unroll]] for (int j = 0; j < TILE; j++) {
            int row = b.first + tile + j;
            Fit whole = end[j];
            absorb(whole, f, 1.0);
            whole = moved(whole, point_at(x, row) - point);
            if (tile + j < b.count) { FIT_STORE(sums, FIT * (row * width + x), whole); }
            absorb_pixel(f, point, x, b.left + b.window + tile + j, true);
        }
    }
}
