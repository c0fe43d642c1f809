// Maps from the unit square to directions, triangles, lenses and pixel filters. Inputs in [0, 1).

const float PI = 3.14159265358979;
const float INV_PI = 0.318309886183791;

// (cos, sin) of 2 pi u by polynomials on a half turn (error below 3e-7), which are cheaper than two library calls and the same on
// every device up to rounding.
vec2 circle_point(float u) {
    float x = u - 0.5;
    float q = abs(x) - 0.25;
    float q2 = q * q;
    float s = q * (6.2831853 + q2 * (-41.341681 + q2 * (81.602481 + q2 * (-76.581285 + q2 * 39.760722))));
    float c = 1.0 + q2 * (-19.739206 + q2 * (64.937843 + q2 * (-85.332222 + q2 * 57.026768)));
    return vec2(s, x < 0.0 ? c : -c);
}

// Sine and cosine of an angle from 0 to pi (errors below 1e-6), up to pi/2 the sine to a share of itself: a driver's own may be off by 5e-4
// (Vulkan, "Precision and Operation of SPIR-V Instructions"), which is more than a small angle.
vec2 sine_cosine(float angle) {
    float h = 0.5 * angle, q = h * h;
    float s = h + h * q * (-0.16666667 + q * (0.0083333333 + q * (-1.9841270e-4 + q * (2.7557319e-6 + q * -2.5052108e-8))));
    float c = 1.0 + q * (-0.5 + q * (0.041666667 + q * (-0.0013888889 + q * (2.4801587e-5 + q * (-2.7557319e-7 + q * 2.0876757e-9)))));
    return vec2(2.0 * s * c, 1.0 - 2.0 * s * s);
}

// A point uniformly distributed on the unit disk.
vec2 warp_disk(vec2 u) {
    return sqrt(u.x) * circle_point(u.y);
}

// A direction around +z with density cos / pi. The map is polar, not concentric, and so has no branch; z stays above 2e-4 because
// u.x < 1.
vec3 warp_cosine_hemisphere(vec2 u) {
    return vec3(warp_disk(u), sqrt(1.0 - u.x));
}

// A direction uniformly distributed on the unit sphere, density 1 / (4 pi).
vec3 warp_sphere(vec2 u) {
    return vec3(2.0 * sqrt(u.x * (1.0 - u.x)) * circle_point(u.y), 1.0 - 2.0 * u.x);
}

// A direction uniformly distributed in the cone around z, density 1 / (2 pi (1 - cos_max)). The sine is computed from 1 - z, which
// is exact for narrow cones.
vec3 warp_cone(vec2 u, float one_minus_cos_max) {
    float t = u.x * one_minus_cos_max;
    return vec3(sqrt(t * (2.0 - t)) * circle_point(u.y), 1.0 - t);
}

// Barycentric weights of vertices 1 and 2 of a point uniformly distributed by area (low-distortion map, Heitz 2019).
vec2 warp_triangle(vec2 u) {
    vec2 h = 0.5 * u;
    return u.x < u.y ? vec2(h.x, u.y - h.x) : vec2(u.x - h.y, h.y);
}

// An offset in [-1, 1] pixels along one axis, distributed as the triangle filter of radius 1.
float warp_tent(float u) {
    float v = 2.0 * u - 1.0;
    float r = 1.0 - sqrt(1.0 - abs(v));
    return v < 0.0 ? -r : r;
}

// erfc(x) exp(x^2) for x >= 0, error 1.5e-7 before the exponential (Abramowitz and Stegun 7.1.26).
float erfc_scaled(float x) {
    float t = 1.0 / (1.0 + 0.3275911 * x);
    return t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
}

// Inverse error function (Giles 2010, single precision). Finite on [-1, 1]: the ends count as +-(1 - 6e-8).
float erf_inverse(float x) {
    float w = -log(max((1.0 - x) * (1.0 + x), 1.2e-7));
    bool tail = w >= 5.0;
    w = tail ? sqrt(w) - 3.0 : w - 2.5;
    float p = tail ? -0.000200214257 : 2.81022636e-08;
    p = (tail ? 0.000100950558 : 3.43273939e-07) + p * w;
    p = (tail ? 0.00134934322 : -3.5233877e-06) + p * w;
    p = (tail ? -0.00367342844 : -4.39150654e-06) + p * w;
    p = (tail ? 0.00573950773 : 0.00021858087) + p * w;
    p = (tail ? -0.0076224613 : -0.00125372503) + p * w;
    p = (tail ? 0.00943887047 : -0.00417768164) + p * w;
    p = (tail ? 1.00167406 : 0.246640727) + p * w;
    p = (tail ? 2.83297682 : 1.50140941) + p * w;
    return p * x;
}

// An offset along one axis, distributed as the Gaussian filter of standard deviation 0.5 pixels, cut at 2 pixels.
// 0.99993666 = erf(2 / (0.5 sqrt 2)).
float warp_gaussian(float u) {
    return clamp(0.707106781 * erf_inverse(0.99993666 * (2.0 * u - 1.0)), -2.0, 2.0);
}

// A right-handed frame around any unit n (Duff et al. 2017); its columns are tangent, bitangent, n.
mat3 basis_from_normal(vec3 n) {
    float s = n.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (s + n.z);
    float b = n.x * n.y * a;
    return mat3(1.0 + s * n.x * n.x * a, s * b, -s * n.x, b, s + n.y * n.y * a, -n.y, n);
}
