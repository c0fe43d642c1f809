#include "shared/edge.glsl"
#include "shared/smoothing_cell.glsl"

// Finds the surface that each cell stands for, one per thread.
layout(local_size_x = 8, local_size_y = 8) in;
#include "shared/packed_pixels.glsl"
layout(scalar, binding = 2) writeonly buffer Cells { uvec4 cells[]; };
layout(scalar, push_constant) uniform Push { SizePush push; };

void main() {
    ivec2 size = ivec2(push.size), grid = smoothing_cells_of(push.size), cell = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(cell, grid))) return;
    int stands = SMOOTHING_CELL * (cell.y * size.x + cell.x);
    bool known = false;
    [[unroll]] for (int k = 0; k < SMOOTHING_CELL * SMOOTHING_CELL; k++) {
        ivec2 at = SMOOTHING_CELL * cell + ivec2(k % SMOOTHING_CELL, k / SMOOTHING_CELL);
        int i = at.y * size.x + at.x;
        if (known || any(greaterThanEqual(at, size)) || texelFetch(colour, i).w == 0.0) continue;
        known = true;
        stands = i;
    }
    cells[cell.y * grid.x + cell.x] = pack_cell(texelFetch(place, stands), known);
}
