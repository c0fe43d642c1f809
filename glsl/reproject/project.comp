#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// Finds for each pixel of the last frame the pixel of the new one that its point has moved to (forward reprojection, Schalk 2018,
// 3.2), and offers its samples there if that pixel shows the same surface and the light towards the new view differs little. Of
// several offers the one nearest to the pixel's centre wins, then that of the lowest old pixel: an atomic minimum of integers,
// whose result does not depend on the order of threads.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer history; // of History
layout(binding = 12) uniform usamplerBuffer points; // of SurfacePoint
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) buffer Offers { uint offered[]; };
layout(scalar, binding = 18) buffer Winners { uint winner[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/surface_point.glsl"
#include "shared/history.glsl"

// A key's upper 6 bits are the distance from the pixel's centre, its lower 26 the old pixel.
const uint PIXEL_BITS = 26u;
// Two hits are of one surface if one lies no farther from the plane of the other than this, in widths of a pixel there, and if
// the normals of their triangles are no farther apart than this cosine. Neighbours of a curved mesh differ by less.
const float PLANE_DISTANCE = 0.5, NORMAL_COSINE = 0.9;
// An albedo below this does not make more of the light that arrives: the quotient would only show noise.
const float LEAST_ALBEDO = 0.05;

bool same_surface(Surface old, Surface seen) {
    float width = pixel_width(camera, push.size) * distance(seen.position, camera.position);
    bool plane = abs(dot(seen.geometric, old.position - seen.position)) <= PLANE_DISTANCE * width;
    bool side = dot(old.geometric, previous.position - old.position) * dot(old.geometric, camera.position - old.position) > 0.0;
    bool alike = old.object == seen.object && old.material == seen.material;
    return alike && side && plane && dot(old.geometric, seen.geometric) >= NORMAL_COSINE;
}

// Light of the pixels around one: that of a single pixel would let noise decide, and dark samples would be kept more often.
vec3 light_around(uint pixel) {
    ivec2 size = ivec2(push.size), at = ivec2(pixel % push.size.x, pixel / push.size.x);
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 9; k++) {
        ivec2 q = clamp(at + ivec2(k % 3 - 1, k / 3 - 1), ivec2(0), size - 1);
        sum += History_mean(history, uint(q.y * size.x + q.x));
    }
    return sum / 9.0;
}

// The BSDF towards `wo`, without the cosine, for light from `wi`; both in world space.
vec3 scattered(Surface s, Bsdf bsdf, vec3 wo, vec3 wi) {
    bool turns = (s.flags & MATERIAL_TWO_SIDED) != 0u;
    Facing facing = facing_normals(s, wo, turns, true);
    mat3 basis = basis_from_normal(facing.normal);
    vec3 towards = wo * basis, from = wi * basis;
    bsdf_view(bsdf, towards);
    return bsdf_evaluate(bsdf, towards, from).rgb / max(from.z, 1e-3);
}

// Largest channel of |f_r(new view) - f_r(old view)| * irradiance (Schalk 2018, equation 15, where the albedo is a factor of its
// own). The direction that light comes from is not kept: it is taken to be the worst of the mirror images of the two views,
// where a lobe is largest.
float view_error(Surface s, uint pixel, vec3 before, vec3 after) {
    Bsdf bsdf = surface_bsdf(s);
    if (!bsdf_is_specular(bsdf)) return 0.0;
    float side = dot(s.normal, before) < 0.0 ? -1.0 : 1.0;
    vec3 irradiance = PI * light_around(pixel) / max(bsdf_albedo(bsdf, abs(dot(s.normal, before))), vec3(LEAST_ALBEDO));
    float error = 0.0;
    for (int k = 0; k < 2; k++) {
        vec3 from = mirror(k == 0 ? before : after, side * s.normal);
        vec3 change = abs(scattered(s, bsdf, after, from) - scattered(s, bsdf, before, from)) * irradiance;
        error = max(error, max(change.r, max(change.g, change.b)));
    }
    return error;
}

// Lambertian reflection alone is the same in every direction.
const bool DEPENDS_ON_VIEW = !ONE_KIND || !FX_DIFFUSE;

// Returns the word of the samples in their new pixel, or why they stay behind; `key` is what they offer to the pixel `to`.
uint moved(uint pixel, Carried c, out uint to, out uint key) {
    to = 0u;
    key = NONE;
    Surface s = surface_of(History_triangle(history, pixel), History_instance(history, pixel), History_weights(history, pixel));
    vec3 film = film_from_point(camera, s.position, push.size);
    bool inside = film.x >= 0.0 && film.y >= 0.0 && film.x < float(push.size.x) && film.y < float(push.size.y);
    if (!(film.z > 0.0) || !inside) return dropped(DROPPED_OUTSIDE);
    to = min(uint(film.y), push.size.y - 1u) * push.size.x + min(uint(film.x), push.size.x - 1u);
    SurfacePoint at = SurfacePoint_load(points, to);
    if (at.triangle == NONE || !same_surface(s, surface_of(at))) return dropped(DROPPED_HIDDEN);
    if (DEPENDS_ON_VIEW) {
        float error = view_error(s, pixel, normalize(previous.position - s.position), normalize(camera.position - s.position));
        if (!(error <= push.max_error)) return dropped(DROPPED_VIEW);
        c.error += uint(ceil(error * float(ERROR_PARTS) / max(push.max_error, 1e-30)));
        if (c.error > ERROR_PARTS) return dropped(DROPPED_VIEW);
    }
    vec2 off = abs(fract(film.xy) - 0.5);
    key = uint(max(off.x, off.y) * 126.0) << PIXEL_BITS | pixel;
    return word_of(Carried(c.count, c.age + 1u, c.error));
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i;
    Carried c = carried_of(offered[pixel]);
    if (c.count == 0u) return;
    uint to = pixel, key = pixel;
    if (push.moved != 0u || previous != camera) {
        offered[pixel] = c.age < push.max_age ? moved(pixel, c, to, key) : dropped(DROPPED_OLD);
        if (c.age >= push.max_age) return;
    }
    if (key != NONE) atomicMin(winner[to], key);
}
