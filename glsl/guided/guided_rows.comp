#include "shared/moments.glsl"
#include "shared/tiled_index.glsl"
#include "shared/window_blocks.glsl"
#define SUM Moments
#define NO_SUM NO_MOMENTS
#include "shared/windows.glsl"

// Second pass of the guided filter: solves for the linear model a . I + b of every window (He et al. 2010, equation 19) from
// the moments of its columns. In place of b it keeps the model's value at the guide of its block's first pixel. A thread walks along
// a row. With LEVERAGES it writes the leverage of every pixel in the window around its own block too.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer columns; // of vec4
layout(binding = 1) uniform samplerBuffer channels; // of vec4
layout(scalar, binding = 2) writeonly buffer SlopeR { u64vec2 slope_r[]; }; // of vec4
layout(scalar, binding = 3) writeonly buffer SlopeG { u64vec2 slope_g[]; }; // of vec4
layout(scalar, binding = 4) writeonly buffer SlopeB { u64vec2 slope_b[]; }; // of vec4
layout(scalar, binding = 5) writeonly buffer Values { u64vec2 value[]; }; // of vec4
layout(scalar, binding = 6) writeonly buffer Leverages { float leverages[]; };
layout(constant_id = 114) const bool LEVERAGES = false;
layout(scalar, push_constant) uniform Push { GuidedPush push; };

#define FETCH_COLUMN(at) texelFetch(columns, at)

vec4 point_at(int row, int x) {
    int first = clamp(x, 0, blocks_of(push.size).x - 1) * STEP;
    return texelFetch(channels, tiled_index(first, (int(push.first_row) + row) * STEP, int(push.size.y)));
}

void merge_element(inout Moments m, vec4 point, int row, int x) {
    int width = blocks_of(push.size).x;
    int at = strip_index(clamp(x, 0, width - 1), row, width, MOMENTS);
    Moments column = MOMENTS_LOAD(at, 8, FETCH_COLUMN);
    column.mean += point_at(row, x) - point;
    merge(m, column, x >= 0 && x < width);
}

// The derivative of a pixel's fitted value by its own value, averaged over the windows that hold it: that of the window around it
// or, as most windows do not have it in their middle, what their pixels have on average, if that is more.
void store_leverages(int row, int x, Moments whole, Factors f, vec4 point) {
    ivec2 size = ivec2(push.size), first = ivec2(x, int(push.first_row) + row) * STEP;
    float mean = fitted_channels(f, whole) / max(whole.head.x, 1.0);
    [[unroll]] for (int j = 0; j < STEP; j++) {
        [[unroll]] for (int i = 0; i < STEP; i++) {
            ivec2 at = first + ivec2(i, j);
            if (any(greaterThanEqual(at, size))) continue;
            vec4 off = texelFetch(channels, tiled_index(at.x, at.y, size.y)) - point - whole.mean;
            leverages[at.y * size.x + at.x] = 1.0 / max(whole.head.x, 1.0) + max(dot(off, solved(f, off)), mean);
        }
    }
}

void store(int row, int x, Moments whole, vec4 point) {
    vec4 off = point_at(row, x) - point - whole.mean;
    Factors f = factorised(whole, whole.head.x * push.eps);
    vec4 r = solved(f, whole.r), g = solved(f, whole.g), b = solved(f, whole.b);
    if (LEVERAGES) store_leverages(row, x, whole, f, point);
    int at = tiled_index(x, int(push.first_row) + row, blocks_of(push.size).y);
    vec3 here = whole.head.yzw + vec3(dot(r, off), dot(g, off), dot(b, off));
    slope_r[at] = pack64(r);
    slope_g[at] = pack64(g);
    slope_b[at] = pack64(b);
    value[at] = pack64(vec4(here, min(whole.head.x, 1.0)));
}

void main() {
    int row = int(gl_GlobalInvocationID.x);
    if (row < int(push.rows)) walk(row, 0, blocks_of(push.size).x);
}
