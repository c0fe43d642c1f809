#include "shared/edge.glsl"
#include "shared/smoothing_cell.glsl"

// Gives every pixel the smoothed estimates of the four cells around it: between their first pixels linearly, those of like
// surfaces first. One pixel per thread.
layout(local_size_x = 8, local_size_y = 8) in;
#include "shared/packed_pixels.glsl"
layout(binding = 2) uniform usamplerBuffer cells; // of uvec4
layout(binding = 3) uniform samplerBuffer first; // of vec4, of cells
layout(binding = 4) uniform samplerBuffer second; // of vec4
layout(binding = 5) uniform samplerBuffer third; // of vec4
layout(scalar, binding = 6) writeonly buffer First { vec4 first_spread[]; };
layout(scalar, binding = 7) writeonly buffer Second { vec4 second_spread[]; };
layout(scalar, binding = 8) writeonly buffer Third { vec4 third_spread[]; };
layout(scalar, push_constant) uniform Push { SurfacesPush push; };

layout(constant_id = 114) const bool THREE = true; // false: the first plane alone
// Least weights of cells of another surface, and of those without a known pixel.
const float OTHER = 0.01, UNKNOWN = 1e-6;

void main() {
    ivec2 size = ivec2(push.size), grid = smoothing_cells_of(push.size), at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, size))) return;
    int here = at.y * size.x + at.x;
    Pixel p = pixel_at(here);
    vec4 sum_1 = vec4(0.0), sum_2 = vec4(0.0), sum_3 = vec4(0.0);
    float total = 0.0;
    vec2 between = vec2(at % SMOOTHING_CELL) / float(SMOOTHING_CELL);
    [[unroll]] for (int k = 0; k < 4; k++) {
        ivec2 step = ivec2(k % 2, k / 2), cell = min(at / SMOOTHING_CELL + step, grid - 1);
        int there = cell.y * grid.x + cell.x;
        Pixel q = unpack_cell(texelFetch(cells, there));
        vec2 near = mix(1.0 - between, between, equal(step, ivec2(1)));
        float alike = edge_weight(q, edge_exponent(p, q, push.rates));
        float w = near.x * near.y * (q.colour.w > 0.0 ? max(alike, OTHER) : UNKNOWN);
        sum_1 += w * texelFetch(first, there);
        if (THREE) {
            sum_2 += w * texelFetch(second, there);
            sum_3 += w * texelFetch(third, there);
        }
        total += w;
    }
    first_spread[here] = sum_1 / total;
    if (THREE) {
        second_spread[here] = sum_2 / total;
        third_spread[here] = sum_3 / total;
    }
}
