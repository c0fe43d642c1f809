// Indices of a window's four corners in a summed-area table: bottom right, bottom left, top right, top left; -1 where the window
// begins at the image's border and the entry counts as 0.
ivec4 corners(ivec2 at, ivec2 size, int radius) {
    ivec2 low = max(at - radius, ivec2(0)) - 1, high = min(at + radius, size - 1);
    int above = low.y * size.x, last = high.y * size.x;
    return ivec4(last + high.x, low.x < 0 ? -1 : last + low.x, low.y < 0 ? -1 : above + high.x,
                 low.x < 0 || low.y < 0 ? -1 : above + low.x);
}
