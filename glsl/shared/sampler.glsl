// Random numbers that depend on (pixel, sample index, dimension pair, seed) only. Needs effects.glsl.

// `index` is bit-reversed for Sobol points: every step but the outputs works on reversed words.
struct Sampler {
    uint seed;
    uint index;
};

#include "shared/pcg.glsl"

// Owen scrambling of a bit-reversed word, in which no bit depends on higher ones: Laine and Karras's hash with Vegdahl's
// constants (2021).
uint owen_reversed(uint x, uint seed) {
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return x;
}

// Second Sobol dimension, bit-reversed: bit j is the parity of the index bits whose position contains the bits of j (Pascal's
// triangle mod 2, Lucas's theorem). That matrix is a Kronecker power, so that five exclusive-or steps suffice.
uint sobol_1_reversed(uint index) {
    index ^= (index >> 1) & 0x55555555u;
    index ^= (index >> 2) & 0x33333333u;
    index ^= (index >> 4) & 0x0f0f0f0fu;
    index ^= (index >> 8) & 0x00ff00ffu;
    return index ^ (index >> 16);
}

// The random numbers of a sample. Both hashes are bijections: two pixels never share a stream under one seed, nor does one pixel
// under two seeds.
Sampler sampler_start(uint pixel, uint index, uint seed) {
    return Sampler(pcg(pixel + pcg(seed)), FX_INDEPENDENT ? index : bitfieldReverse(index));
}

// Two 32-bit words for the dimensions 2 * pair and 2 * pair + 1: padded, shuffled and scrambled Sobol points (Burley 2020). The
// first dimension is the bit-reversed index.
uvec2 sample_2d_bits(Sampler s, uint pair) {
    uint h = pcg(s.seed + pair);
    if (FX_INDEPENDENT) {
        uint x = pcg(h + s.index);
        return uvec2(x, pcg(x ^ h));
    }
    // Weaker hashes of h are enough for the two scrambles; the shifts keep their low bits from repeating its own.
    uint hx = (h ^ (h >> 15)) * 0x2c1b3c6du;
    uint hy = (h ^ (h >> 12)) * 0x297a2d39u;
    uint index = bitfieldReverse(owen_reversed(s.index, h));
    uint x = owen_reversed(index, hx ^ (hx >> 16));
    uint y = owen_reversed(sobol_1_reversed(index), hy ^ (hy >> 15));
    return uvec2(bitfieldReverse(x), bitfieldReverse(y));
}

vec2 unit_floats(uvec2 bits) {
    return vec2(unit_interval(bits.x), unit_interval(bits.y));
}

vec2 sample_2d(Sampler s, uint pair) {
    return unit_floats(sample_2d_bits(s, pair));
}
