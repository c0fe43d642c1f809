// Whether a pixel shows one surface alone, by the first hits through the centres of its neighbours. Needs `guide` and `push`
// (ReprojectPush). All lengths are in widths of the pixel at its hit, so that the unit of length does not matter.
//
// This stands for the limit on the distance between a pixel's hits in Schalk 2018, 3.2.2: samples of a pixel that shows an edge
// would carry the light of one surface to the other.

// The neighbour `k` of nine of a pixel; those of the border repeat.
uint neighbour(uint pixel, int k) {
    ivec2 size = ivec2(push.size), at = ivec2(pixel % push.size.x, pixel / push.size.x);
    ivec2 q = clamp(at + ivec2(k % 3 - 1, k / 3 - 1), ivec2(0), size - 1);
    return uint(q.y * size.x + q.x);
}

// Whether `other` shows the surface that `pixel` shows, whose tangent plane has this normal.
bool shows_same(uint pixel, uint other, vec3 plane, float width) {
    float off = abs(dot(plane, Guide_position(guide, other) - Guide_position(guide, pixel)));
    return Guide_object(guide, other) == Guide_object(guide, pixel) && off <= push.aliasing * width * Guide_depth(guide, pixel);
}

bool is_whole(uint pixel, vec3 plane, float width) {
    bool whole = true;
    for (int k = 0; k < 9; k++) whole = whole && shows_same(pixel, neighbour(pixel, k), plane, width);
    return whole;
}
