// The bindings of a noisy image that is to be demodulated: the film of a render, or the layers of any renderer's file. Twin:
// denoise::twin::Pixels.
layout(constant_id = 111) const bool OF_FILE = false; // counts are floats, and m2 is the variance of the mean
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform usamplerBuffer light; // of PixelLight
layout(binding = 2) uniform usamplerBuffer guide; // of Guide

vec3 colour_at(int i) { return PixelStats_mean(stats, i); }

vec3 albedo_at(int i) { return Guide_albedo(guide, i); }

// Number of samples of a pixel.
float count_at(int i) {
    uint count = PixelStats_count(stats, i);
    return OF_FILE ? uintBitsToFloat(count) : float(count);
}
