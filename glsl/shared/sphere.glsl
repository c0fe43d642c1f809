// Spheres, stored in place of triangles, and their texture coordinates. In place of two barycentric weights a hit holds the unit
// normal, from the centre, as an octahedral point, which needs no trigonometry.
#include "shared/octahedral.glsl"
#include "shared/warp.glsl"

struct Sphere {
    vec3 centre;
    vec3 pole;     // from the centre to v = 1
    vec3 meridian; // from the centre to u = 0 on the equator
    uint flags;    // SPHERE_ bits
};

bool is_sphere(uint triangle) { return (Triangle_primitive(triangles, triangle) & SPHERE) != 0u; }

Sphere sphere_of(uint triangle) {
    Triangle t = Triangle_load(triangles, triangle);
    return Sphere(t.v0, t.v1, t.v2, t.primitive);
}

// Vector from the centre to the equator a quarter turn of azimuth from `meridian`, as long as the radius.
vec3 sphere_side(Sphere s) {
    vec3 side = cross(s.pole, s.meridian) * inversesqrt(dot(s.pole, s.pole));
    return (s.flags & SPHERE_MIRRORED) != 0u ? -side : side;
}

// u is the azimuth, v rises from pole to pole, as on the tessellated shape. At a pole atan(0, 0) may be no number.
vec2 sphere_coordinates(Sphere s, vec3 normal) {
    float x = dot(normal, s.meridian), y = dot(normal, sphere_side(s));
    float u = x != 0.0 || y != 0.0 ? atan(y, x) * (0.5 / PI) : 0.0;
    return vec2(u < 0.0 ? u + 1.0 : u, 1.0 - atan(length(vec2(x, y)), dot(normal, s.pole)) / PI);
}
