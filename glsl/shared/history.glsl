// What is known of the samples that a pixel has from earlier frames, in one word: their number in the lower 16 bits, then 8 bits
// of how many times they have moved, then 7 of the error that they are accounted by changed view and changed light, in
// parts of the largest that is allowed, rounded up, then one that says which side of the surface they show. Where the number is 0 the bits above it say why.
const uint MOST_CARRIED = 65535u;
const uint ERROR_PARTS = 127u;

// Reasons for a pixel not to hand on its samples, or not to take any; 0: it has none, or nobody offers any.
const uint DROPPED_SKY = 1u;      // there is no surface
const uint DROPPED_SPECULAR = 2u; // a smooth or refractive interface
const uint DROPPED_EDGE = 3u;     // first hits around it lie on other surfaces: the aliasing limit
const uint DROPPED_OLD = 4u;      // moved too many times
const uint DROPPED_OUTSIDE = 5u;  // outside the film, or behind the camera
const uint DROPPED_HIDDEN = 6u;   // another surface is in front, or the other side of it is seen
const uint DROPPED_VIEW = 7u;     // the error by the changed view exceeds the limit
const uint DROPPED_LIGHT = 8u;    // the error by changed light exceeds it

struct Carried {
    uint count;
    uint age;
    uint error; // in ERROR_PARTS
    bool back;  // of the side that the triangle's normal points away from
};

Carried carried_of(uint word) {
    return Carried(word & 0xffffu, (word >> 16) & 0xffu, (word >> 24) & 0x7fu, word >> 31 != 0u);
}

uint word_of(Carried c) { return c.count | c.age << 16 | c.error << 24 | uint(c.back) << 31; }

uint dropped(uint reason) { return reason << 16; }

// A smaller part of a sum of squared deviations: that of `kept` of `count` samples of the same variance.
float part_of_m2(float m2, uint kept, uint count) {
    return kept < count ? m2 * (float(max(kept, 1u) - 1u) / float(count - 1u)) : m2;
}
