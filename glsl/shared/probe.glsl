#include "shared/pcg.glsl"

// A fiftieth of the luminance around a pixel, up or down, to be added to all its channels. Neighbours' are alike, so that
// what a filter brings along from them does not drown what it keeps.
float probe(uint pixel, vec3 around, float least) {
    float size = 0.02 * (abs(contrast(around, vec3(0.0))) + least);
    return (pcg(pixel) >> 31) == 0u ? size : -size;
}
