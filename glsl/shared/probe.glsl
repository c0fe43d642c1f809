#include "shared/pcg.glsl"

// A tenth of a pixel's deviation, up or down, to be added to all its channels. `e`: radiance and variance.
float probe(uint pixel, vec4 e) {
    float size = 0.1 * sqrt(max(e.w, 0.0)) + 1e-3 * abs(clamp(luminance(e.rgb), -STRONGEST, STRONGEST)) + 1e-20;
    return (pcg(pixel) >> 31) == 0u ? size : -size;
}
