// Cells are squares of the film's pixels, row-major; those at its right and lower edge may be cut. One of a cell's pixels is probed
// for changes of its light.
const uint PROBE_CELL = 4u; // pixels along an edge

uvec2 probe_cells_of(uvec2 size) { return (size + (PROBE_CELL - 1u)) / PROBE_CELL; }

uint probe_cell_of(uint pixel, uvec2 size) {
    return pixel / size.x / PROBE_CELL * probe_cells_of(size).x + pixel % size.x / PROBE_CELL;
}
