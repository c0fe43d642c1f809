// What the samples say of a pixel's noise. Needs `push` (PriorityPush) and `stats`.

// Samples' worth of trust in the noise of the surroundings.
const float PRIOR_SAMPLES = 32.0;

float stat(uint pixel, int word) { return uintBitsToFloat(texelFetch(stats, int(7u * pixel) + word).x); }

// (squared deviations summed, mean over channels; degrees of freedom; luminance times samples; samples)
vec4 moments(uint pixel) {
    uint count = texelFetch(stats, int(7u * pixel + 3u)).x; // a float fetch may flush it to 0
    float n = float(count);
    float luminance = 0.2126 * stat(pixel, 0) + 0.7152 * stat(pixel, 1) + 0.0722 * stat(pixel, 2);
    vec4 m = vec4((stat(pixel, 4) + stat(pixel, 5) + stat(pixel, 6)) / 3.0, n - 1.0, luminance * n, n);
    return count > 0u ? m : vec4(0.0);
}

// Standard deviation of one sample over the luminance (RAS), both steadied by the surroundings, `own` included, of which a
// few samples say more than of the pixel alone: 1 while nothing is known, 0 where the mean is good enough or the pixel full.
float noise(vec4 own, vec4 around) {
    if (around.y == 0.0) return 1.0;
    float variance = (own.x + PRIOR_SAMPLES * around.x / around.y) / (own.y + PRIOR_SAMPLES);
    float scale = push.luminance_floor < 0.0 ? 1.0 : around.z / around.w + push.luminance_floor;
    float relative = sqrt(variance) / max(scale, 1e-20);
    bool good = own.w > 0.0 && relative < push.threshold * sqrt(own.w);
    return good || own.w >= float(push.limit) ? 0.0 : relative;
}
