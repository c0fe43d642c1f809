// Estimates are smoothed over square cells: they vary slowly, and a quarter of the sums suffices. A cell stands for the surface of its
// first known pixel, or of its first pixel if none is.
#include "shared/edge.glsl"

const int SMOOTHING_CELL = 2; // pixels along an edge

// Cells across and down an image; those at the right and the lower border may lack pixels.
ivec2 smoothing_cells_of(uvec2 size) {
    return (ivec2(size) + SMOOTHING_CELL - 1) / SMOOTHING_CELL;
}

// The lowest bit of the first coordinate, which packed pixels leave at 0, tells whether a pixel of the cell is known.
uvec4 pack_cell(uvec4 place, bool known) {
    return uvec4(bitfieldInsert(place.x, uint(known), 0, 1), place.yzw);
}

// The surface that a cell stands for.
Pixel unpack_cell(uvec4 cell) {
    return unpack_pixel(vec4(0.0, 0.0, 0.0, float(cell.x & 1u)), uvec4(cell.x & ~1u, cell.yzw));
}
