// What a primary ray meets. Needs `push` (PathPush), bsdf.glsl, camera.glsl, traverse.glsl and surface.glsl before it.

// `delta`: a smooth surface, all of whose light counts as direct.
Guide first_hit(Ray ray, uint mask_seed, out bool delta) {
    Hit hit = traverse(Segment(ray.origin, ray.direction, 3e38, mask_seed), push.root);
    delta = false;
    if (hit.triangle == NONE) return Guide(vec3(0.0), 0.0, vec3(0.0), NONE, vec3(0.0), NONE);
    Surface s = surface_at(hit);
    Bsdf bsdf = surface_bsdf(s);
    delta = bsdf_is_delta(bsdf);
    vec3 normal = side_of(s, -ray.direction) * s.normal;
    vec3 albedo = bsdf_albedo(bsdf, -dot(s.normal, ray.direction));
    return Guide(normal, hit.t + push.camera.near, s.position, s.object, albedo, s.material);
}
