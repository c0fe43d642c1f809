// The bindings of a noisy image that is to be demodulated: the film of a render, or the layers of any renderer's file. Twin:
// denoise::twin::Pixels.
#include "shared/sample_marks.glsl"

layout(constant_id = 111) const bool OF_FILE = false; // counts are floats, and m2 is the variance of the mean
layout(constant_id = 115) const bool HAS_LIGHT = false; // `light` holds a record of every pixel
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform usamplerBuffer light; // of PixelLight
layout(binding = 2) uniform usamplerBuffer guide; // of Guide

vec3 colour_at(int i) { return PixelStats_mean(stats, i); }

// Number of samples of a pixel.
float count_at(int i) {
    uint count = PixelStats_count(stats, i);
    return OF_FILE ? uintBitsToFloat(count) : float(count);
}

// What the samples say of it or, without samples, the ray through the pixel's centre.
vec3 albedo_at(int i) {
    return HAS_LIGHT && count_at(i) > 0.0 ? PixelLight_albedo(light, i) : Guide_albedo(guide, i);
}

// Whether a pixel has any of these marks.
bool marked(int i, uint marks) { return HAS_LIGHT && (PixelLight_remainder(light, i) & marks) != 0u; }

// Whether all samples of a pixel passed over the key light, of which they tell nothing.
bool passed_over(int i) { return marked(i, ALL_PASSED_OVER); }
