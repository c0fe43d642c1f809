// Whether a pixel shows one surface alone, by the first hits through the centres of its neighbours. Needs `guide` and `push`
// (ReprojectPush). All lengths are in widths of the pixel at its hit, so that the unit of length does not matter.
//
// This stands for the limit on the distance between a pixel's hits in Schalk 2018, 3.2.2: samples of a pixel that shows an edge
// would carry the light of one surface to the other.
bool is_whole(uint pixel, vec3 plane, float width) {
    ivec2 size = ivec2(push.size), at = ivec2(pixel % push.size.x, pixel / push.size.x);
    uint object = Guide_object(guide, pixel);
    vec3 position = Guide_position(guide, pixel);
    float limit = push.aliasing * width * Guide_depth(guide, pixel);
    bool whole = true;
    for (int k = 0; k < 9; k++) {
        ivec2 q = clamp(at + ivec2(k % 3 - 1, k / 3 - 1), ivec2(0), size - 1);
        uint other = uint(q.y * size.x + q.x);
        bool beside = abs(dot(plane, Guide_position(guide, other) - position)) <= limit;
        whole = whole && Guide_object(guide, other) == object && beside;
    }
    return whole;
}
