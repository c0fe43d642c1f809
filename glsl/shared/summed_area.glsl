// Sums over windows from a summed-area table. Needs `table`.

// Indices of a window's four corners in a summed-area table: bottom right, bottom left, top right, top left; -1 where the window
// begins at the image's border and the entry counts as 0.
ivec4 corners(ivec2 at, ivec2 size, int radius) {
    ivec2 low = max(at - radius, ivec2(0)) - 1, high = min(at + radius, size - 1);
    int above = low.y * size.x, last = high.y * size.x;
    return ivec4(last + high.x, low.x < 0 ? -1 : last + low.x, low.y < 0 ? -1 : above + high.x,
                 low.x < 0 || low.y < 0 ? -1 : above + low.x);
}

vec4 entry(int pixel, int members, int member) {
    return pixel < 0 ? vec4(0.0) : texelFetch(table, members * pixel + member);
}

// The sum over the window with these corners of one member of entries, which have so many texels each.
vec4 window_sum(ivec4 c, int members, int member) {
    return entry(c.x, members, member) - entry(c.y, members, member) - entry(c.z, members, member) + entry(c.w, members, member);
}
