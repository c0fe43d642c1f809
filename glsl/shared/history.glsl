// What is known of the samples that a pixel has from earlier frames, in one word: their number in the lower 16 bits, then 8 bits
// of how many times they have moved, then 8 of the error that they are accounted, in parts of the largest one that is allowed,
// rounded up. Where the number is 0 the bits above it say why.
const uint MOST_CARRIED = 65535u;
const uint ERROR_PARTS = 255u;

// Reasons for a pixel not to hand on its samples, or not to take any; 0: it has none, or nobody offers any.
const uint DROPPED_SKY = 1u;      // there is no surface
const uint DROPPED_SPECULAR = 2u; // a smooth or refractive interface
const uint DROPPED_EDGE = 3u;     // first hits around it lie on other surfaces: the aliasing limit
const uint DROPPED_OLD = 4u;      // moved too many times
const uint DROPPED_OUTSIDE = 5u;  // outside the film, or behind the camera
const uint DROPPED_HIDDEN = 6u;   // another surface is in front, or the other side of it is seen
const uint DROPPED_VIEW = 7u;     // the error by the changed view exceeds the limit

struct Carried {
    uint count;
    uint age;
    uint error; // in ERROR_PARTS
};

Carried carried_of(uint word) {
    return Carried(word & 0xffffu, (word >> 16) & 0xffu, word >> 24);
}

uint word_of(Carried c) { return c.count | c.age << 16 | c.error << 24; }

uint dropped(uint reason) { return reason << 16; }

// A smaller part of a sum of squared deviations: that of `kept` of `count` samples of the same variance.
float part_of_m2(float m2, uint kept, uint count) {
    return kept < count ? m2 * (float(max(kept, 1u) - 1u) / float(count - 1u)) : m2;
}
