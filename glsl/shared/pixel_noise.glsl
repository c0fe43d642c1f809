// The noise of a pixel, estimated from the statistics of its samples. Needs `push` (PriorityPush) and `stats`.
#include "shared/luminance.glsl"

// The variance of the surroundings counts as that of this many samples.
const float PRIOR_SAMPLES = 32.0;
// Luminance is cut here, so that its sum over samples and pixels is finite.
const float MAX_LUMINANCE = 1e29;

// Returns (sum of squared deviations, mean over channels; degrees of freedom; luminance times samples; samples).
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

// Standard deviation of one sample over the luminance (Schalk 2018). Both are smoothed by the surroundings `around`, which
// include `own`, since few samples tell little of one pixel. It is 1 while nothing is known, and 0 where the mean's relative
// error is below the threshold or the pixel has `limit` samples.
float noise(vec4 own, vec4 around) {
    if (around.y == 0.0) return 1.0;
    float variance = (own.x + PRIOR_SAMPLES * around.x / around.y) / (own.y + PRIOR_SAMPLES);
    float scale = push.luminance_floor < 0.0 ? 1.0 : around.z / around.w + push.luminance_floor;
    float relative = sqrt(variance) / max(scale, 1e-20);
    bool good = own.w > 0.0 && relative < push.threshold * sqrt(own.w);
    return good || own.w >= float(push.limit) ? 0.0 : relative;
}
