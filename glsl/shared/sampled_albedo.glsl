// The albedo that the light of a pixel was divided by: that of its samples or, without any, of the ray through its centre. Twin: the
// function of this name in denoise::filter::pixel.
layout(constant_id = 112) const bool HAS_LIGHT = false; // `light` holds a record of every pixel
layout(binding = 6) uniform usamplerBuffer light; // of PixelLight

// Light that is no number has a count of 0, too, but samples.
vec3 sampled_albedo(int i, float count, vec3 of_centre) {
    if (!HAS_LIGHT) return of_centre;
    vec3 of_samples = PixelLight_albedo(light, i);
    return count > 0.0 || any(notEqual(of_samples, vec3(0.0))) ? of_samples : of_centre;
}
