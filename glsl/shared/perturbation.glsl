#include "shared/pcg.glsl"

// Noise to be added to all channels of a pixel: a fiftieth of the luminance around it, with a random sign. It is about as
// large for neighbours, so that their noise in a filter's result does not drown the pixel's own.
float perturbation(uint pixel, vec3 around, float least) {
    float random_sign = 1.0 - 2.0 * float(pcg(pixel) >> 31u);
    return random_sign * 0.02 * (abs(contrast(around, vec3(0.0))) + least);
}
