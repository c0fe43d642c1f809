// What the samples say of a pixel's noise. Needs `push` (PriorityPush) and `stats`.
#include "shared/luminance.glsl"

// Samples' worth of trust in the noise of the surroundings.
const float PRIOR_SAMPLES = 32.0;

// (squared deviations summed, mean over channels; degrees of freedom; luminance times samples; samples)
vec4 moments(uint pixel) {
    uvec4 mean = texelFetch(stats, int(2u * pixel)), m2 = texelFetch(stats, int(2u * pixel + 1u));
    vec3 squares = uintBitsToFloat(m2.rgb);
    float n = float(mean.w);
    vec4 m = vec4((squares.r + squares.g + squares.b) / 3.0, n - 1.0, luminance(uintBitsToFloat(mean.rgb)) * n, n);
    return mean.w > 0u ? m : vec4(0.0);
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
