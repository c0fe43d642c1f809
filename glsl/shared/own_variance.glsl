// What the samples of a pixel say of the variance of its luminance. Needs `variance`. Twin: src/denoise/filter/noise_estimate.rs.
#include "shared/finite.glsl"
#include "shared/luminance.glsl"
#include "shared/variance_at.glsl"
layout(constant_id = 114) const bool MEASURED = true; // `variance` holds every pixel's

const float UNMEASURED = -1.0; // where they say nothing

float own_variance(int i, float count) {
    vec3 v = MEASURED ? variance_at(i) : vec3(-1.0);
    // Channels of one path rise and fall together: their deviations add, not their variances.
    float deviation = min(luminance(sqrt(v)), STRONGEST);
    return count >= ENOUGH && finite(v) && all(greaterThanEqual(v, vec3(0.0))) ? deviation * deviation : UNMEASURED;
}
