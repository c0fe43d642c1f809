// What is seen in smooth surfaces. Needs first_hit.glsl.

// The first surface that is not smooth, or the sky, by the stronger way wherever light may take two. `guide` is that of the smooth
// surface at the start of `ray`. Depth and position are as if the way had been straight, so that they change as the image
// does; a normal that points back along the way tells where in the sky it ends. The albedo is what the light from there is
// multiplied by on its way.
Guide seen_hit(Ray ray, Hit hit, Guide guide, uint mask_seed) {
    Ray way = ray;
    float length = 0.0;
    vec3 throughput = vec3(1.0);
    bool smooth_here = true;
    for (uint bounce = 1u; smooth_here && bounce < push.constants.max_depth; bounce++) {
        length += hit.t;
        Surface s = surface_at(hit);
        Bsdf bsdf = surface_bsdf(s);
        bool turns = (s.flags & MATERIAL_TWO_SIDED) != 0u && !is_kind(FX_DIELECTRIC, bsdf, BSDF_DIELECTRIC);
        Facing facing = facing_normals(s, -way.direction, turns, true);
        mat3 basis = shading_basis(s, bsdf, facing.normal);
        vec3 wo = -way.direction * basis;
        if (FX_COAT_NORMALS) bsdf.metallic.coat_normal = local_coat_normal(s, facing, basis, wo);
        BsdfSample next;
        if (!bsdf_sample(bsdf, wo, 0.5, vec2(0.5), next)) break;
        way.direction = basis * next.wi;
        way.origin = ray_origin(s, way.direction);
        throughput *= next.weight;
        guide = first_hit(way, pcg(mask_seed + bounce), smooth_here, hit);
        bool sky = hit.triangle == NONE;
        guide.normal = sky ? -way.direction : guide.normal;
        guide.depth = length + (sky ? 0.0 : hit.t) + camera.near;
        guide.position = ray.origin + (length + (sky ? 0.0 : hit.t)) * ray.direction;
        guide.albedo = throughput * (sky ? vec3(1.0) : guide.albedo);
    }
    return guide;
}
