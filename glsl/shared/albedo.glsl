// What light is divided by. Twin: src/denoise/twin.rs.
#include "shared/finite.glsl"

const float SMALLEST_ALBEDO = 0.01; // a channel of smaller albedo is divided by this; a pixel with no larger one reflects nothing

// 0 for what is no number.
float number(float v) { return finite(v) ? v : 0.0; }

vec3 number(vec3 v) { return vec3(number(v.x), number(v.y), number(v.z)); }

float largest(vec3 v) {
    v = number(v);
    return max(max(v.x, v.y), max(v.z, 0.0));
}

bool reflects(vec3 albedo) { return largest(albedo) > SMALLEST_ALBEDO; }

vec3 divisor(vec3 albedo) { return max(number(albedo), vec3(SMALLEST_ALBEDO)); }
