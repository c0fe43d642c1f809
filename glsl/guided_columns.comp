#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/moments.glsl"

// Moments over the part of every window that lies in its centre's column. With windows of w pixels and blocks of w
// rows, a window is the end of one block and the beginning of the next (van Herk 1992): one dispatch walks every block
// of a column upwards and keeps its ends, another walks the next block downwards and adds them, so that the time does
// not depend on w. They are two because lavapipe reads storage buffers eight times slower than texels.
layout(local_size_x = 32) in;
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(binding = 2) uniform samplerBuffer ends; // of vec4
layout(scalar, binding = 3) writeonly buffer Sums { vec4 sums[]; };
layout(scalar, push_constant) uniform Push { GuidedPush push; };

layout(constant_id = 110) const bool BACKWARD = false; // the first of two dispatches: ends of blocks only

#define FETCH_END(at) texelFetch(ends, at)

void absorb_pixel(inout Moments m, int x, int y) {
    ivec2 size = ivec2(push.size);
    int at = clamp(y, 0, size.y - 1) * size.x + x;
    vec4 c = texelFetch(colour, at);
    absorb_means(m, y >= 0 && y < size.y && c.w > 0.0 ? 1.0 : 0.0, c.rgb, texelFetch(channels, at));
}

void main() {
    int x = int(gl_GlobalInvocationID.x), width = int(push.size.x);
    if (x >= width) return; // safe: no barrier() follows
    int window = 2 * int(push.radius) + 1, first = int(gl_GlobalInvocationID.y) * window;
    int top = int(push.first_row) + first - int(push.radius), rows = min(window, int(push.rows) - first);
    Moments m = NO_MOMENTS;
    if (BACKWARD) {
        for (int i = window - 1; i >= 0; i--) {
            absorb_pixel(m, x, top + i);
            if (i < rows) { MOMENTS_STORE(sums, MOMENTS * ((first + i) * width + x), m); }
        }
        return;
    }
    for (int i = 0; i < rows; i++) {
        if (i > 0) absorb_pixel(m, x, top + window + i - 1);
        int at = MOMENTS * ((first + i) * width + x);
        Moments whole = MOMENTS_LOAD(at, FETCH_END);
        absorb(whole, m);
        MOMENTS_STORE(sums, at, whole);
    }
}
