#include "shared/finite.glsl"

// What is known of the samples that a pixel has from earlier frames, in one word: their number in the lower 16 bits, then 8 bits
// of how many times they have moved on average, then one that says whether they are of an edge, then one that says which side of the
// surface they show. Where the number is 0 the bits above it say why.
const uint MOST_CARRIED = 65535u;

// Reasons for a pixel not to hand on its samples, or not to take any; 0: it has none, or nobody offers any.
const uint DROPPED_SKY = 1u;      // there is no surface
const uint DROPPED_SPECULAR = 2u; // a smooth or refractive interface
const uint DROPPED_EDGE = 3u;     // at an edge, of whose samples none is worth handing on, or which no edge offers any
const uint DROPPED_OLD = 4u;      // moved too many times for any to count
const uint DROPPED_OUTSIDE = 5u;  // outside the film, or behind the camera
const uint DROPPED_HIDDEN = 6u;   // another surface is in front, or the other side of it is seen
const uint DROPPED_VIEW = 7u;     // the surface looks so different from the new view that no sample is worth handing on
const uint DROPPED_LIGHT = 8u;    // light has changed so much that no sample is worth handing on

struct Carried {
    uint count;
    uint age;
    bool edge;  // they are of several surfaces
    bool back;  // of the side that the triangle's normal points away from
};

Carried carried_of(uint word) {
    return Carried(word & 0xffffu, (word >> 16) & 0xffu, (word >> 24 & 1u) != 0u, (word >> 25 & 1u) != 0u);
}

uint word_of(Carried c) { return c.count | c.age << 16 | uint(c.edge) << 24 | uint(c.back) << 25; }

uint dropped(uint reason) { return reason << 16; }

// By what a sum of squared deviations is divided for the variance of one sample.
float freedom(uint count) { return float(max(count, 2u) - 1u); }

// Of `count` samples as many new ones as have a mean as far from the truth as theirs is after a change, whose square is
// `change` times the variance of one sample. None where radiance is so large that its squares overflow and the change is no number.
uint worth(uint count, float change) {
    return finite(change) ? min(uint(float(count) / (1.0 + float(count) * change) + 0.5), count) : 0u;
}

// Keys of offers: bit 31 says whether the new pixel is at an edge, then 6 bits are the distance from its centre, the lower 25 the old
// pixel.
const uint PIXEL_BITS = 25u;
const uint FARTHEST = 63u; // a pixel's width
const uint AT_EDGE = 2147483648u;
const uint NO_OFFER = 2147483647u; // all bits below AT_EDGE
