// The first hit of a camera ray, as a Guide. Needs frame.glsl, bsdf.glsl, camera.glsl, traverse.glsl and surface.glsl before it.

// `delta` becomes true for a smooth surface, which shows what is behind it.
Guide first_hit(Ray ray, uint mask_seed, out bool delta, out Hit hit) {
    hit = traverse(Segment(ray.origin, ray.direction, 3e38, mask_seed), push.constants.root);
    delta = false;
    Guide guide = Guide_zero();
    guide.object = guide.material = NONE;
    if (hit.triangle == NONE) return guide;
    Surface s = surface_at(hit);
    Bsdf bsdf = surface_bsdf(s);
    delta = bsdf_is_delta(bsdf);
    guide.normal = side_of(s, -ray.direction) * s.normal;
    guide.depth = hit.t + camera.near;
    guide.position = s.position;
    guide.object = s.object;
    guide.albedo = bsdf_albedo(bsdf, -dot(s.normal, ray.direction));
    guide.material = s.material;
    return guide;
}
