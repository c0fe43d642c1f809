// The albedo that light is divided by before it is filtered. Twin: src/denoise/twin.rs.
#include "shared/finite.glsl"

// Smaller albedos are divided by this; a pixel with no larger one counts as reflecting nothing.
const float SMALLEST_ALBEDO = 0.01;

// A pixel with less than this share of a neighbour's albedo may partly show something without.
const float WHOLE = 0.98;

// Returns 0 for NaN and infinities.
float number(float v) { return finite(v) ? v : 0.0; }

vec3 number(vec3 v) { return vec3(number(v.x), number(v.y), number(v.z)); }

float largest(vec3 v) {
    v = number(v);
    return max(max(v.x, v.y), max(v.z, 0.0));
}

bool reflects(vec3 albedo) { return largest(albedo) > SMALLEST_ALBEDO; }

vec3 divisor(vec3 albedo) { return max(number(albedo), vec3(SMALLEST_ALBEDO)); }
