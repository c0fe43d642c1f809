// Isotropic microfacet distributions over normals m with m.z > 0, roughness `alpha` in [0.01, 1]; `w.z` > 0.
// Needs effects.glsl.
#include "shared/warp.glsl"

const float GRAZING = 1e-9; // directions whose cosine is not above this count as below the horizon
const vec3 UP = vec3(0.0, 0.0, 1.0);

bool smooth_alpha(float alpha) {
    return FX_SMOOTH && (!FX_ROUGH || alpha < SMOOTH_ALPHA);
}

// Unit vector along a + b; finite where that is 0.
vec3 half_vector(vec3 a, vec3 b) {
    vec3 h = a + b;
    return h * inversesqrt(max(dot(h, h), 1e-30));
}

vec3 mirror(vec3 w, vec3 m) {
    return 2.0 * dot(w, m) * m - w;
}

const float INV_SQRT_PI = 0.564189583547756;

// With one distribution in the scene, the compiler removes the other.
bool is_ggx(bool ggx) {
    return FX_GGX && (!FX_BECKMANN || ggx);
}

// Normal distribution D(m), per steradian. The lower limit of cos^2 prevents exp(-inf) / 0 at grazing normals.
float microfacet_d(bool ggx, vec3 m, float alpha) {
    float c2 = max(m.z * m.z, 1e-8);
    float a2 = alpha * alpha;
    float x = dot(m.xy, m.xy) / (a2 * c2);
    float shape = is_ggx(ggx) ? 1.0 / ((1.0 + x) * (1.0 + x)) : exp(-x);
    return shape * INV_PI / (a2 * c2 * c2);
}

// Smith's masking G1(w). Beckmann's is Walter's rational fit (2007, eq. 27), written with a single division.
float microfacet_g1(bool ggx, vec3 w, float alpha) {
    float t = alpha * sqrt(dot(w.xy, w.xy));
    if (is_ggx(ggx)) return 2.0 * w.z / (w.z + sqrt(w.z * w.z + t * t));
    float z2 = w.z * w.z;
    float fit = (3.535 * w.z * t + 2.181 * z2) / (t * t + 2.276 * w.z * t + 2.577 * z2);
    return w.z < 1.6 * t ? fit : 1.0;
}

// c (1 + erf(c / s)) + s exp(-(c / s)^2) / sqrt(pi): twice the projected area of a Beckmann surface of alpha 1 seen along
// (s, 0, c), up to the scale of c and s.
float beckmann_area(float c, float s) {
    float cot = min(c / max(s, 1e-10), 8.0);
    float e = exp(-cot * cot);
    return c * (2.0 - erfc_scaled(cot) * e) + s * INV_SQRT_PI * e;
}

// Area of the visible microfacets projected along w, per unit of surface: w.z / G1 with the exact G1, finite at grazing
// angles. Visible normals have density D(m) max(w.m, 0) / area, which integrates to 1.
float microfacet_area(bool ggx, vec3 w, float alpha) {
    float t = alpha * sqrt(dot(w.xy, w.xy));
    if (is_ggx(ggx)) return 0.5 * (w.z + sqrt(w.z * w.z + t * t));
    return 0.5 * beckmann_area(w.z, t);
}

// Visible GGX normal by spherical caps (Dupuy and Benyoub 2023), for `w` stretched to alpha 1; not normalised. 1 - z is computed
// without subtraction, so that narrow lobes keep their digits; the last component's lower limit keeps the sum of two opposite
// directions from vanishing.
vec3 ggx_visible_normal(vec3 w, vec2 u) {
    float t = u.y * (1.0 + w.z);
    return vec3(sqrt(t * (2.0 - t)) * circle_point(u.x) + w.xy, max(1.0 - t + w.z, 1e-6));
}

// One Halley step towards the slope b whose visible area c (1 + erf b) + s exp(-b^2) / sqrt(pi) is `target`.
// `mass` = 1 + erf(b).
float beckmann_step(float b, float mass, float c, float s, float target) {
    float e = INV_SQRT_PI * exp(-b * b);
    float visible = max(c - s * b, 1e-6);
    float newton = (c * mass + s * e - target) / (2.0 * e * visible);
    float curvature = -2.0 * b - s / visible;
    return b - newton / clamp(1.0 - 0.5 * newton * curvature, 0.25, 4.0);
}

// Slope along the azimuth of (s, 0, c) from u: inverts the marginal distribution of Heitz and d'Eon (2014). Jakob (2014)
// iterates in erf(slope) from a power-law guess. Departure: this takes two third-order steps in the slope itself, which need one
// erf and one inverse, and meets the CDF to about 1e-6. Slopes beyond 4 have less probability than a step of u.
float beckmann_slope(float c, float s, float u) {
    float cot = min(c / max(s, 1e-10), 4.0);
    float e = exp(-cot * cot);
    float mass = 2.0 - erfc_scaled(cot) * e;
    float target = u * (c * mass + s * INV_SQRT_PI * e);
    mass = clamp(mass - mass * pow(1.0 - u, 1.0 + s * (0.3054 * s - 0.9062)), 1e-7, 1.9999998);
    float b = clamp(beckmann_step(erf_inverse(mass - 1.0), mass, c, s, target), -4.0, cot);
    float tail = erfc_scaled(abs(b)) * exp(-b * b);
    return clamp(beckmann_step(b, b < 0.0 ? tail : 2.0 - tail, c, s, target), -4.0, cot);
}

// Visible Beckmann normal for `w` stretched to alpha 1; not normalised.
vec3 beckmann_visible_normal(vec3 w, vec2 u) {
    float s2 = dot(w.xy, w.xy);
    float s = sqrt(s2);
    vec2 azimuth = s2 > 1e-14 ? w.xy / s : vec2(1.0, 0.0);
    float along = beckmann_slope(w.z, s, u.x);
    float across = erf_inverse(2.0 * u.y - 1.0);
    return vec3(-along * azimuth + across * vec2(azimuth.y, -azimuth.x), 1.0);
}

// Samples a normal visible from w with the density D(m) max(w.m, 0) / microfacet_area(w).
vec3 microfacet_sample(bool ggx, vec3 w, float alpha, vec2 u) {
    vec3 stretched = normalize(vec3(alpha * w.xy, w.z));
    vec3 m = is_ggx(ggx) ? ggx_visible_normal(stretched, u) : beckmann_visible_normal(stretched, u);
    return normalize(vec3(alpha * m.xy, m.z));
}
