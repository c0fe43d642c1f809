// Sums over every window of w pixels along a line, in time that does not depend on w. A window is the end of one block
// of w pixels and the beginning of the next (van Herk 1992), so that nothing is ever subtracted: one dispatch walks every
// block backward and keeps its ends, another walks the next block forward and adds them. Storing is what costs most on
// lavapipe, so that only the ends at every TILE-th window are kept; those between are summed anew. Sums of a tile count
// from one point, the pixel in the middle of its windows' centres, which is within each of them.
layout(constant_id = 111) const int TILE = 8; // a part of w that wastes little, at most 8

// One of the blocks that a line is cut into.
struct Block {
    int window; // pixels of a window, and windows of a block
    int first;  // centre of the first window
    int left;   // first pixel of the first window
    int count;  // windows whose centre is on the line
};

Block block_at(int index, int radius, int edge) {
    int window = 2 * radius + 1, first = index * window;
    return Block(window, first, first - radius, min(window, edge - first));
}

// The last tile of a block.
int last_tile(Block b) {
    return (b.window - 1) / TILE * TILE;
}

// Where the ends of a tile are kept; `line` is one of `lines`.
int end_at(Block b, int tile, int line, int lines) {
    return ((b.first + tile + TILE - 1) / TILE + b.first / b.window) * lines + line;
}

// Centre that the sums of a tile count from.
int middle(Block b, int tile) {
    return b.first + min(tile + min(TILE, b.window) / 2, b.count - 1);
}

// Where a pixel of a plane is kept: eight columns beside each other, so that threads which walk down them, a row at a
// time, read memory in order.
int blocked(int x, int y, int rows) {
    return ((x >> 3) * rows + y) * 8 + (x & 7);
}
