// Where a pixel of a plane is kept: eight columns beside each other, so that threads which walk down them, a row at a
// time, read memory in order.
int blocked(int x, int y, int rows) {
    return ((x >> 3) * rows + y) * 8 + (x & 7);
}

// First pair of vec4s of a record of a strip; the next is eight further on. Eight rows lie beside each other, so that
// threads which walk along them read memory in order.
int strip_at(int x, int row, int width, int record) {
    return ((row >> 3) * width + x) * 4 * record + (row & 7);
}
