// Whether samples still hold in a new frame. Needs surface_point.glsl, history.glsl, light_around.glsl, and before them `previous`,
// `guide` (of the new frame), `history` and `push` (ReprojectPush).

// A hit is of the surface of a point if it lies no farther from the plane there than this, in widths of a pixel.
const float PLANE_DISTANCE = 0.5;
// An albedo below this does not make more of the light that arrives: the quotient would only show noise.
const float LEAST_ALBEDO = 0.05;

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

// Largest channel of |f_r(new view) - f_r(old view)| * irradiance (Schalk 2018, equation 15, where the albedo is a factor of its
// own). The direction that light comes from is not kept: it is taken to be the worst of the mirror images of the two views,
// where a lobe is largest.
float view_error(Surface s, uint pixel, vec3 before, vec3 after) {
    Bsdf bsdf = surface_bsdf(s);
    if (!bsdf_is_specular(bsdf)) return 0.0;
    float side = dot(s.normal, before) < 0.0 ? -1.0 : 1.0;
    vec3 irradiance = PI * light_around(pixel, push.size) / max(bsdf_albedo(bsdf, abs(dot(s.normal, before))), vec3(LEAST_ALBEDO));
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

// By how much the changed view moves the light of a surface, whose samples in the last frame are around `pixel`: in shares of what is
// allowed.
float view_change(Surface s, uint pixel) {
    if (!DEPENDS_ON_VIEW) return 0.0;
    vec3 before = normalize(previous.position - s.position), after = normalize(camera.position - s.position);
    return view_error(s, pixel, before, after) / max(push.max_error, 1e-30);
}
