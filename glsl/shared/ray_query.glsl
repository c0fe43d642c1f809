// The same closest and any hits as by the traversal of traverse.glsl, found by the device itself (VK_KHR_ray_query). It goes through
// structures that it built of the same triangles: see src/render/world.rs. What it cannot decide comes back as a candidate: a
// surface with a mask, a sphere, and the triangle that the ray leaves.
#extension GL_EXT_ray_query : require
#include "shared/finite.glsl"
layout(binding = 19) uniform accelerationStructureEXT world;

rayQueryEXT query;

// Whether every triangle on the way has to be looked at.
const bool EVERY_CANDIDATE = FX_ALPHA_MASKS || FX_SPHERES;

// What the device calls a hit, as index in leaf order and instance: a mesh counts its triangles from its own first one, which the
// instance has as its offset.
uvec2 device_surface(uint first, uint primitive, uint instance, uint root) {
    bool two_levels = FX_INSTANCES && (root & ROOT_OF_INSTANCES) != 0u;
    return uvec2(first + primitive, two_levels ? instance : NONE);
}

uvec2 candidate_surface(uint root) {
    return device_surface(rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, false),
                      rayQueryGetIntersectionPrimitiveIndexEXT(query, false),
                      rayQueryGetIntersectionInstanceCustomIndexEXT(query, false), root);
}

// Whether a triangle stops the ray. Spheres lie among the triangles, and the device takes their numbers for corners.
bool triangle_stops(uvec2 surface, uint mask_seed, uvec2 from) {
    if (is_left(surface.x, surface.y, from) || (FX_SPHERES && is_sphere(surface.x))) return false;
    vec2 barycentric = rayQueryGetIntersectionBarycentricsEXT(query, false);
    vec3 direction = rayQueryGetIntersectionObjectRayDirectionEXT(query, false);
    return !FX_ALPHA_MASKS || mask_blocks(surface.x, surface.y, barycentric, direction, mask_seed);
}

// Tests the sphere in the box that the ray meets, which is none where a triangle lies between spheres; `normal` is that of the
// nearest sphere so far.
void decide_sphere(uvec2 surface, Segment ray, uvec2 from, inout vec2 normal) {
    if (!is_sphere(surface.x)) return;
    RaySpace space = ray_space(rayQueryGetIntersectionObjectRayOriginEXT(query, false),
                               rayQueryGetIntersectionObjectRayDirectionEXT(query, false));
    bool found = rayQueryGetIntersectionTypeEXT(query, true) != gl_RayQueryCommittedIntersectionNoneEXT;
    float t_max = found ? rayQueryGetIntersectionTEXT(query, true) : ray.t_max;
    Hit hit = Hit(t_max, NONE, NONE, 0.0, 0.0);
    intersect_masked(hit, space, surface.x, surface.y, ray.mask_seed, from, true);
    if (hit.triangle == NONE) return;
    rayQueryGenerateIntersectionEXT(query, hit.t);
    normal = vec2(hit.b1, hit.b2);
}

// What the device has settled on; `normal` is that of a sphere.
Hit committed_hit(Segment ray, uint root, vec2 normal) {
    uint kind = rayQueryGetIntersectionTypeEXT(query, true);
    if (kind == gl_RayQueryCommittedIntersectionNoneEXT) return Hit(ray.t_max, NONE, NONE, 0.0, 0.0);
    uvec2 surface = device_surface(rayQueryGetIntersectionInstanceShaderBindingTableRecordOffsetEXT(query, true),
                               rayQueryGetIntersectionPrimitiveIndexEXT(query, true),
                               rayQueryGetIntersectionInstanceCustomIndexEXT(query, true), root);
    vec2 at = normal;
    if (!FX_SPHERES || kind == gl_RayQueryCommittedIntersectionTriangleEXT) at = rayQueryGetIntersectionBarycentricsEXT(query, true);
    return Hit(rayQueryGetIntersectionTEXT(query, true), surface.x, surface.y, at.x, at.y);
}

// The closest hit of a ray, or with `any_hit` some hit. Where no surface has a mask, the device decides alone, and only a ray that
// meets the triangle which it leaves is traced again, with a look at every candidate: such rays are few. Vulkan leaves open what
// becomes of numbers that make no ray, which here meet nothing.
Hit query_hit(Segment ray, bool any_hit, uint root, uvec2 from) {
    bool is_ray = finite(ray.origin) && finite(ray.direction) && ray.t_max > 0.0;
    if (!is_ray) return Hit(ray.t_max, NONE, NONE, 0.0, 0.0);
    uint end = any_hit ? gl_RayFlagsTerminateOnFirstHitEXT : gl_RayFlagsNoneEXT;
    bool every = EVERY_CANDIDATE, again;
    Hit hit;
    do {
        uint flags = end | (every ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsOpaqueEXT);
        vec2 normal = vec2(0.0);
        rayQueryInitializeEXT(query, world, flags, 0xffu, ray.origin, 0.0, ray.direction, ray.t_max);
        while (rayQueryProceedEXT(query)) {
            uvec2 surface = candidate_surface(root);
            bool box = rayQueryGetIntersectionTypeEXT(query, false) == gl_RayQueryCandidateIntersectionAABBEXT;
            if (FX_SPHERES && box) decide_sphere(surface, ray, from, normal);
            else if (!box && triangle_stops(surface, ray.mask_seed, from)) rayQueryConfirmIntersectionEXT(query);
        }
        hit = committed_hit(ray, root, normal);
        again = !every && hit.triangle != NONE && is_left(hit.triangle, hit.instance, from);
        every = true;
    } while (again);
    return hit;
}

// The closest hit of a ray that leaves no triangle.
Hit traverse(Segment ray, uint root) { return query_hit(ray, false, root, uvec2(NONE)); }

// Finds out first, where `shadowed`, whether anything blocks `shadow`, which replaces `shadowed`; then, where `alive`, the closest
// hit of `ray`. Both rays leave the same triangle.
Hit trace_shadow_then_closest(Segment shadow, inout bool shadowed, Segment ray, bool alive, uint root, uvec2 from) {
    if (FX_CLEAR_WALLS) wall_depth = uvec3(0u);
    if (shadowed) shadowed = query_hit(shadow, true, root, from).triangle != NONE;
    Hit hit = Hit(ray.t_max, NONE, NONE, 0.0, 0.0);
    if (alive) hit = query_hit(ray, false, root, from);
    return hit;
}
