// Edge-stopping weights of two pixels by their radiance, normal and position (Dammertz et al. 2010, section 2.2).
// Twin: src/denoise/filter/edge.rs.
#include "shared/sanitise.glsl"

layout(constant_id = 110) const bool WEIGHT_RT = true;
layout(constant_id = 111) const bool WEIGHT_N = true;
layout(constant_id = 112) const bool WEIGHT_X = true;
layout(constant_id = 113) const bool SQUARED = true; // false: the norms as equation 5 prints them

const float LEAST_EXPONENT = -50.0; // weights below 2^LEAST_EXPONENT are 0, so that squares of the others do not underflow on any device

struct Pixel {
    vec4 colour; // w: samples, 0 where the pixel is unknown
    vec3 normal;
    vec3 position;
};

// Unpacks the two texels that pack.comp writes.
Pixel unpack_pixel(vec4 colour, uvec4 place) {
    return Pixel(colour, WEIGHT_N ? unpacked_normal(place.w) : vec3(0.0), uintBitsToFloat(place.xyz));
}

float difference(vec3 d) {
    float squared = dot(d, d);
    return SQUARED ? squared : sqrt(squared);
}

// Exponent of the weight, in base 2, by the `rates` of radiance, normal and position. An unknown `p` has no radiance to compare.
float edge_exponent(Pixel p, Pixel q, vec3 rates) {
    float exponent = 0.0;
    if (WEIGHT_RT && p.colour.w > 0.0) exponent -= rates.x * difference(q.colour.rgb - p.colour.rgb);
    if (WEIGHT_N) exponent -= rates.y * difference(q.normal - p.normal);
    if (WEIGHT_X) exponent -= rates.z * difference(q.position - p.position);
    return exponent;
}

float edge_weight(Pixel q, float exponent) {
    return q.colour.w > 0.0 && exponent > LEAST_EXPONENT ? exp2(exponent) : 0.0;
}
