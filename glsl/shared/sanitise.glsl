// Limits that filters cut input pixels to, so that no value makes NaN or infinities. Twin: src/denoise/filter/pixel.rs.
#include "shared/finite.glsl"
#include "shared/octahedral.glsl"

const uint NO_NORMAL = 0x80008000u; // packSnorm2x16 never returns -32768
const float LARGEST = 1e24;         // radiance is cut here, so that differences and sums stay finite
const float FARTHEST = 1e18;        // positions are cut here, whose squares are summed
const float WIDEST = 1e7;           // the guided filter's channels are cut here

// Radiance, and in w its number of samples; all zero where it is unknown.
vec4 known_radiance(vec4 c) {
    bool known = c.w > 0.0 && finite(c.w) && finite(c.rgb);
    return known ? vec4(clamp(c.rgb, -LARGEST, LARGEST), c.w) : vec4(0.0);
}

uint packed_normal(vec3 n) {
    float len = dot(n, n);
    return finite(len) && len > 1e-20 ? octahedral_encode(n) : NO_NORMAL;
}

vec3 unpacked_normal(uint bits) {
    vec3 n = octahedral_decode(bits);
    return bits == NO_NORMAL ? vec3(0.0) : n;
}

float known_channel(float v) {
    return finite(v) ? clamp(v, -WIDEST, WIDEST) : 0.0;
}
