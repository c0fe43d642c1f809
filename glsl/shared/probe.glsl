// A tenth of a pixel's deviation, up or down, to be added to all its channels. `e`: radiance and variance.
float probe(uint pixel, vec4 e) {
    // PCG (O'Neill 2014), one round.
    uint state = pixel * 747796405u + 2891336453u, word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    float size = 0.1 * sqrt(max(e.w, 0.0)) + 1e-3 * abs(clamp(luminance(e.rgb), -STRONGEST, STRONGEST)) + 1e-20;
    return (word >> 31) == 0u ? size : -size;
}
