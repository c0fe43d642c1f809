#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"
#include "shared/finite.glsl"

// Finds for each pixel of the last frame the point of the new film that its samples' point has moved to (forward reprojection,
// Schalk 2018, 3.2), and offers its samples to the four pixels around, where those show the same surface and the light towards the
// new view differs little. Where something else has moved, points have moved with it, and what has become of their light is known
// from probes: as if the scene changed first, before the last camera, and then the camera moved.
//
// Of several offers the one nearest to the pixel's centre wins, then that of the lowest old pixel: an atomic minimum of integers,
// whose result does not depend on the order of threads. A point within a pixel is nearer than one outside, which so comes in where
// there is no other: departure from the paper, which offers to one pixel alone. Where the image grows or shrinks by 1 % a frame, a
// quarter of all pixels would find no point within them, and after 16 frames a pixel would have two samples, not 17.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer history; // of History
layout(binding = 12) uniform usamplerBuffer guide; // of Guide
layout(binding = 13) uniform usamplerBuffer changes; // of LightChange
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) buffer Offers { uint offered[]; };
layout(scalar, binding = 18) buffer Winners { uint winner[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/surface_point.glsl"
#include "shared/history.glsl"
#include "shared/cell.glsl"

// A hit is of the surface of a point if it lies no farther from the plane there than this, in widths of a pixel.
const float PLANE_DISTANCE = 0.5;
// An albedo below this does not make more of the light that arrives: the quotient would only show noise.
const float LEAST_ALBEDO = 0.05;

bool shows(uint pixel, Surface s) {
    float off = abs(dot(s.geometric, Guide_position(guide, pixel) - s.position));
    bool near = off <= PLANE_DISTANCE * pixel_width(camera, push.size) * Guide_depth(guide, pixel);
    return near && Guide_object(guide, pixel) == s.object && Guide_material(guide, pixel) == s.material;
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
    mat3 basis = shading_basis(s, bsdf, facing.normal);
    vec3 towards = wo * basis, from = wi * basis;
    if (FX_COAT_NORMALS) bsdf.metallic.coat_normal = local_coat_normal(s, facing, basis, towards);
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

// Offers the samples of a pixel to those around `film`, a point of the film, of an edge to edges alone. Returns why none takes them,
// or 0.
uint offer(uint pixel, Surface s, vec2 film, bool edge) {
    ivec2 size = ivec2(push.size), corner = ivec2(floor(clamp(film, vec2(-2.0), vec2(size) + 2.0) - 0.5));
    uint reason = DROPPED_OUTSIDE;
    for (int k = 0; k < 4; k++) {
        ivec2 at = corner + ivec2(k & 1, k >> 1);
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
        uint to = uint(at.y * size.x + at.x);
        uint at_edge = winner[to] & AT_EDGE; // what others offer does not change it
        bool taken = edge == (at_edge != 0u) && shows(to, s);
        vec2 off = abs(film - vec2(at) - 0.5);
        if (taken) atomicMin(winner[to], at_edge | min(uint(max(off.x, off.y) * 64.0), 63u) << PIXEL_BITS | pixel);
        reason = taken ? 0u : reason == 0u ? 0u : DROPPED_HIDDEN;
    }
    return reason;
}

// Moves the samples of a pixel. Returns their word in their new pixel, or why they stay behind.
uint moved(uint pixel, Carried c) {
    Surface s = surface_of(History_triangle(history, pixel), History_instance(history, pixel), History_weights(history, pixel));
    if (c.back != (dot(s.geometric, camera.position - s.position) < 0.0)) return dropped(DROPPED_HIDDEN);
    if (push.moved != 0u) {
        float light = LightChange_change(changes, cell_of(pixel, push.size)) / max(push.noise, 1e-15);
        c.count = worth(c.count, light * light);
        if (c.count == 0u) return dropped(DROPPED_LIGHT);
    }
    float view = 0.0; // in shares of what is allowed
    if (DEPENDS_ON_VIEW) {
        vec3 before = normalize(previous.position - s.position), after = normalize(camera.position - s.position);
        view = view_error(s, pixel, before, after) / max(push.max_error, 1e-30);
    }
    bool small = view <= 1.0;
    c.error += small ? uint(ceil(view * float(ERROR_PARTS))) : 0u;
    if (!small || c.error > ERROR_PARTS) return dropped(DROPPED_VIEW);
    vec3 film = film_from_point(camera, s.position, push.size);
    uint reason = film.z > 0.0 && finite(film) ? offer(pixel, s, film.xy, c.edge) : DROPPED_OUTSIDE;
    return reason == 0u ? word_of(Carried(c.count, c.age + 1u, c.error, c.edge, c.back)) : dropped(reason);
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i;
    Carried c = carried_of(offered[pixel]);
    if (c.count == 0u) return;
    if (push.moved == 0u && previous == camera) winner[pixel] = pixel;
    else offered[pixel] = c.age < push.max_age ? moved(pixel, c) : dropped(DROPPED_OLD);
}
