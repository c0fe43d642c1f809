// Similarity of a pixel's surroundings by geometry. Needs `push` (PriorityPush) and `guides`.
#include "shared/portable_math.glsl"

const float SIMILARITY_UNIT = 65536.0;

// G_n * G_x of GEO's equation 2, without colour, in units of 2^-16; 0 between a hit and a miss.
uint similarity(uint p, uint q) {
    Guide a = Guide_load(guides, p), b = Guide_load(guides, q);
    if ((a.object == NONE) != (b.object == NONE)) return 0u;
    float normals = squared_distance(a.normal, b.normal), positions = squared_distance(a.position, b.position);
    precise float x = normals * push.normal_scale + positions * push.position_scale;
    precise float rounded = exp_negative(x) * SIMILARITY_UNIT + 0.5;
    return uint(rounded);
}

// q = 1 - W_p: the mean dissimilarity over the window, which for an even edge reaches one pixel further up and left. Pixels
// beyond the film do not count.
float importance(uint p) {
    ivec2 size = ivec2(push.size), at = ivec2(p % push.size.x, p / push.size.x);
    int reach = int(push.window) / 2;
    uint sum = 0u, count = 0u;
    // Tested at its end: see shared/traverse.glsl.
    int dy = -reach;
    do {
        int dx = -reach;
        do {
            ivec2 q = at + ivec2(dx, dy);
            bool inside = all(greaterThanEqual(q, ivec2(0))) && all(lessThan(q, size));
            ivec2 safe = clamp(q, ivec2(0), size - 1);
            uint alike = similarity(p, uint(safe.y * size.x + safe.x));
            sum += inside ? alike : 0u;
            count += inside ? 1u : 0u;
        } while (++dx < int(push.window) - reach);
    } while (++dy < int(push.window) - reach);
    uint unlike = (count << 16) - sum;
    return float(unlike / count) / SIMILARITY_UNIT;
}
