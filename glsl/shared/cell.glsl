// Cells are squares of the film's pixels, row-major; those at its right and lower edge may be cut. One of a cell's pixels is probed
// for changes of its light.
const uint CELL = 4u; // pixels along an edge

uvec2 cells_of(uvec2 size) { return (size + (CELL - 1u)) / CELL; }

uint cell_of(uint pixel, uvec2 size) {
    return pixel / size.x / CELL * cells_of(size).x + pixel % size.x / CELL;
}
