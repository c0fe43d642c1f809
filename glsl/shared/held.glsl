// Whether samples still hold in a new frame. Needs surface_point.glsl, history.glsl, probe_cell.glsl, and before them `previous`,
// `guide` (of the new frame), `history`, `changes` and `push` (ReprojectPush).
#include "shared/largest_channel.glsl"

// A hit is of the surface of a point if it lies no farther from the plane there than this, in widths of a pixel.
const float PLANE_DISTANCE = 0.5;

bool shows(uint pixel, Surface s) {
    float off = abs(dot(s.geometric, Guide_position(guide, pixel) - s.position));
    bool near = off <= PLANE_DISTANCE * pixel_width(camera, push.size) * Guide_depth(guide, pixel);
    return near && Guide_object(guide, pixel) == s.object && Guide_material(guide, pixel) == s.material;
}

// The BSDF towards `wo`, without the cosine, for light from `wi`; both in world space.
vec3 scattered(Surface s, Bsdf bsdf, vec3 wo, vec3 wi) {
    bool turns = (s.flags & MATERIAL_TWO_SIDED) != 0u;
    View view = view_of(s, bsdf, facing_normals(s, wo, turns, true), wo);
    vec3 from = wi * view.basis;
    return bsdf_evaluate(bsdf, view.wo, from).rgb / max(from.z, 1e-3);
}

// Square of the share by which the changed view may move a surface's light. The direction that light comes from is not kept: at worst it
// is on the flank of a lobe, where as a share of the peak radiance changes by the square root of what the peak loses, nearly: the peak of
// GGX (1 + x^2)^-2 loses 2 x^2 over an angle x, and its steepest flank 1.04 x. The peaks are at the mirror images of both views.
// Departure from Schalk 2018, equation 15, where peaks change by so much times the irradiance, of which only noise tells.
float view_change(Surface s) {
    if (!DEPENDS_ON_VIEW) return 0.0;
    Bsdf bsdf = surface_bsdf(s);
    if (!bsdf_is_specular(bsdf)) return 0.0;
    vec3 before = normalize(previous.position - s.position), after = normalize(camera.position - s.position);
    float side = dot(s.normal, before) < 0.0 ? -1.0 : 1.0, change = 0.0;
    for (int k = 0; k < 2; k++) {
        vec3 from = mirror(k == 0 ? before : after, side * s.normal);
        vec3 a = scattered(s, bsdf, before, from), b = scattered(s, bsdf, after, from);
        vec3 share = abs(b - a) / max(max(a, b), vec3(1e-30));
        change = max(change, largest_channel(share));
    }
    return change;
}

// How many of `count` samples of a pixel of the last frame are worth handing on after that change, beside their noise.
uint worth_in_view(uint count, float change, uint pixel) {
    return worth(count, change / max(push.view * push.view * History_noise(history, pixel), 1e-30));
}

// How many of `count` samples of a pixel of the last frame are worth handing on after light has changed, where more than the camera has.
uint worth_in_light(uint count, uint pixel) {
    if (push.moved == 0u) return count;
    float light = LightChange_change(changes, probe_cell_of(pixel, push.size)) / max(push.noise, 1e-15);
    return worth(count, light * light);
}

// Of samples that several new pixels take, because each of them is smaller at the point than the old one was, a share each: filters take
// the noise of neighbours for independent. A zoom by 1.4 of the area a frame leaves .65 to 1.04 of the error of frames that carry nothing
// behind `auto`, in place of 1.04 to 2.95. Where no filter is to follow all count, since .14 of that error would become .25.
uint shared_out(uint count, vec3 point) {
    if (!FX_SPLIT) return count;
    vec3 before = point - previous.position, after = point - camera.position;
    float ratio = pixel_width(previous, push.size) / max(pixel_width(camera, push.size), 1e-30);
    float magnified = ratio * ratio * dot(before, before) / max(dot(after, after), 1e-30);
    return magnified > 1.0 ? uint(max(float(count) / magnified + 0.5, 1.0)) : count;
}
