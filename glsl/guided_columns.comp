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

int pixel_at(int x, int y) {
    return clamp(y, 0, int(push.size.y) - 1) * int(push.size.x) + x;
}

// Leaves `m` about the pixel that it absorbs; `point` is that of the last one.
void absorb_pixel(inout Moments m, inout vec4 point, int x, int y) {
    vec4 c = texelFetch(colour, pixel_at(x, y)), here = texelFetch(channels, pixel_at(x, y));
    m = moved(m, here - point);
    point = here;
    absorb_means(m, y >= 0 && y < int(push.size.y) && c.w > 0.0 ? 1.0 : 0.0, c.rgb, vec4(0.0));
}

void main() {
    int x = int(gl_GlobalInvocationID.x), width = int(push.size.x);
    if (x >= width) return; // safe: no barrier() follows
    int window = 2 * int(push.radius) + 1, first = int(gl_GlobalInvocationID.y) * window;
    int middle = int(push.first_row) + first, top = middle - int(push.radius), rows = min(window, int(push.rows) - first);
    Moments m = NO_MOMENTS;
    vec4 point = vec4(0.0);
    if (BACKWARD) {
        for (int i = window - 1; i >= 0; i--) {
            absorb_pixel(m, point, x, top + i);
            if (i < rows) {
                Moments end = moved(m, texelFetch(channels, pixel_at(x, middle + i)) - point);
                MOMENTS_STORE(sums, MOMENTS * ((first + i) * width + x), end);
            }
        }
        return;
    }
    for (int i = 0; i < rows; i++) {
        if (i > 0) absorb_pixel(m, point, x, top + window + i - 1);
        int at = MOMENTS * ((first + i) * width + x);
        Moments whole = MOMENTS_LOAD(at, FETCH_END);
        absorb(whole, moved(m, texelFetch(channels, pixel_at(x, middle + i)) - point));
        MOMENTS_STORE(sums, at, whole);
    }
}
