// A noisy image that is to be taken apart: the film of a render, or what a file of any renderer holds. Twin:
// denoise::twin::Pixels.
layout(constant_id = 111) const bool OF_FILE = false; // counts are floats, and m2 is the variance of the mean
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform usamplerBuffer light; // of PixelLight
layout(binding = 2) uniform samplerBuffer guide; // of Guide

#include "shared/pixel_light.glsl"

vec3 colour_at(int i) { return uintBitsToFloat(texelFetch(stats, 2 * i).xyz); }

vec3 albedo_at(int i) { return texelFetch(guide, 3 * i + 2).xyz; }

// Samples behind the pixel.
float count_at(int i) {
    uint count = texelFetch(stats, 2 * i).w;
    return OF_FILE ? uintBitsToFloat(count) : float(count);
}
