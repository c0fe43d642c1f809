#include "shared/edge.glsl"
#include "shared/atrous_taps.glsl"
#include "shared/smoothing_cell.glsl"

// One level of A-Trous smoothing of one plane of estimates or three, which are right on average only. Cells of like surfaces
// count by their edge weights, others at least by `push.least`; cells without a known pixel have no estimate. The first level
// makes cells of pixels. A thread smooths ROWS cells of a column.
layout(local_size_x_id = 100) in;
#include "shared/packed_pixels.glsl"
layout(binding = 2) uniform usamplerBuffer cells; // of uvec4, of auto_cells.comp
layout(binding = 3) uniform samplerBuffer first; // of vec4
layout(binding = 4) uniform samplerBuffer second; // of vec4
layout(binding = 5) uniform samplerBuffer third; // of vec4
layout(scalar, binding = 6) writeonly buffer First { vec4 first_smoothed[]; };
layout(scalar, binding = 7) writeonly buffer Second { vec4 second_smoothed[]; };
layout(scalar, binding = 8) writeonly buffer Third { vec4 third_smoothed[]; };
layout(scalar, push_constant) uniform Push { AutoSmoothPush push; };

layout(constant_id = 114) const bool THREE = true; // false: the first plane alone
layout(constant_id = 115) const bool OF_PIXELS = false; // the first level
const int STRIDE = OF_PIXELS ? SMOOTHING_CELL : 1; // taps from one cell to the next

void main() {
    ivec2 grid = smoothing_cells_of(push.size), taps = OF_PIXELS ? ivec2(push.size) : grid;
    int spacing = int(push.spacing), x = int(gl_GlobalInvocationID.x), column = int(gl_GlobalInvocationID.y);
    int first_y = first_row(column, spacing);
    if (x >= grid.x || first_y >= grid.y) return;
    Pixel centre[ROWS];
    vec4 sum_1[ROWS], sum_2[ROWS], sum_3[ROWS];
    float total[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        centre[k] = unpack_cell(texelFetch(cells, min(first_y + k * spacing, grid.y - 1) * grid.x + x));
        sum_1[k] = vec4(0.0);
        sum_2[k] = vec4(0.0);
        sum_3[k] = vec4(0.0);
        total[k] = 0.0;
    }
    // Tested at its end: see shared/traverse.glsl.
    int i = -2;
    do {
        int tap_x = clamp(STRIDE * x + i * spacing, 0, taps.x - 1); // borders repeat
        [[unroll]] for (int j = -2; j <= STRIDE * (ROWS - 1) + 2; j++) {
            int there = clamp(STRIDE * first_y + j * spacing, 0, taps.y - 1) * taps.x + tap_x;
            Pixel q;
            if (OF_PIXELS) q = pixel_at(there);
            else q = unpack_cell(texelFetch(cells, there));
            vec4 value_1 = texelFetch(first, there), value_2 = vec4(0.0), value_3 = vec4(0.0);
            if (THREE) {
                value_2 = texelFetch(second, there);
                value_3 = texelFetch(third, there);
            }
            [[unroll]] for (int k = 0; k < ROWS; k++) { // constant bounds, or it would not be unrolled
                int off = j - STRIDE * k;
                if (abs(off) <= 2) {
                    float alike = edge_weight(q, edge_exponent(centre[k], q, push.rates));
                    float w = b3_spline(i) * b3_spline(off) * (q.colour.w > 0.0 ? max(alike, push.least) : 0.0);
                    sum_1[k] += w * value_1;
                    if (THREE) {
                        sum_2[k] += w * value_2;
                        sum_3[k] += w * value_3;
                    }
                    total[k] += w;
                }
            }
        }
    } while (++i <= 2);
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        int y = first_y + k * spacing, here = y * grid.x + x;
        if (y >= grid.y) continue;
        float share = total[k] > 0.0 ? 1.0 / total[k] : 0.0;
        first_smoothed[here] = share * sum_1[k];
        if (THREE) {
            second_smoothed[here] = share * sum_2[k];
            third_smoothed[here] = share * sum_3[k];
        }
    }
}
