// Index of a pixel of a plane that is stored in tiles of eight columns, so that threads which walk down neighbouring columns
// together read contiguous memory.
int tiled_index(int x, int y, int rows) {
    return ((x >> 3) * rows + y) * 8 + (x & 7);
}

// Index of the first pair of vec4s of a strip's record; its next pair is eight further on. Eight rows are interleaved, so that
// threads which walk along neighbouring rows together read contiguous memory.
int strip_index(int x, int row, int width, int record) {
    return ((row >> 3) * width + x) * 4 * record + (row & 7);
}
