#include "shared/pcg.glsl"

// A random sign, +1 or -1, for each channel.
vec3 signs_of(uint pixel) {
    return vec3(1.0) - 2.0 * vec3(uvec3(pcg(pixel)) >> uvec3(31u, 30u, 29u) & 1u);
}

// Noise to be added to all channels of a pixel: a fiftieth of the luminance around it, with a random sign. It is about as
// large for neighbours, so that their noise in a filter's result does not drown the pixel's own.
float perturbation(uint pixel, vec3 around, float least) {
    return signs_of(pixel).x * 0.02 * (abs(contrast(around, vec3(0.0))) + least);
}
