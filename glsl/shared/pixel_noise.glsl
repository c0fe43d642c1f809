// What the samples say of a pixel's noise. Needs `push` (PriorityPush) and `stats`.
#include "shared/luminance.glsl"

// Samples' worth of trust in the noise of the surroundings.
const float PRIOR_SAMPLES = 32.0;
// Luminance is cut there, so that its sum over samples and pixels is finite.
const float MAX_LUMINANCE = 1e29;

// (squared deviations summed, mean over channels; degrees of freedom; luminance times samples; samples)
vec4 moments(uint pixel, out vec3 mean) {
    PixelStats s = PixelStats_load(stats, pixel);
    mean = s.mean;
    float n = float(s.count);
    return s.count > 0u ? vec4((s.m2.r + s.m2.g + s.m2.b) / 3.0, n - 1.0, min(luminance(mean), MAX_LUMINANCE) * n, n) : vec4(0.0);
}

vec4 moments(uint pixel) {
    vec3 mean;
    return moments(pixel, mean);
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
