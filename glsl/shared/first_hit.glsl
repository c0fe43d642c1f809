// What a camera ray meets and shows.
#include "shared/camera.glsl"
#include "shared/largest_channel.glsl"
#include "shared/trace.glsl"
#include "shared/surface.glsl"

// A ray on its way through smooth surfaces.
struct Sight {
    Ray way;
    float walked;    // length of the way until its last surface
    vec3 throughput; // what the light from the end of the way is multiplied by
    vec3 albedo;     // as a path keeps it that goes the same way: see path_step.glsl
    float share;     // probability that a path does
};

// The hit of `ray` at the surface `s`, as a Guide.
Guide guide_of(Ray ray, Hit hit, Surface s, Bsdf bsdf) {
    Guide guide = Guide_zero();
    guide.normal = side_of(s, -ray.direction) * s.normal;
    guide.depth = hit.t + camera.near;
    guide.position = s.position;
    guide.object = s.object;
    guide.albedo = bsdf_albedo(bsdf, -dot(s.normal, ray.direction));
    guide.material = s.material;
    return guide;
}

// Takes the albedo of the surface `s`, and goes on from a smooth one by the stronger way wherever light may take two. Returns false
// where none goes on.
bool look_on(inout Sight sight, Surface s, Bsdf bsdf) {
    View view = view_of(s, bsdf, facing_of(s, bsdf, -sight.way.direction), -sight.way.direction);
    bool smooth_here = FX_SMOOTH && bsdf_is_delta(bsdf);
    sight.albedo = seen_albedo(sight.throughput, bsdf_albedo(bsdf, view.wo.z), sight.share);
    if (!smooth_here) return false;
    BsdfSample next;
    bool goes_on = bsdf_sample(bsdf, view.wo, 0.5, vec2(0.5), next);
    sight.way.direction = view.basis * next.wi;
    sight.way.origin = ray_origin(s, sight.way.direction);
    sight.throughput *= next.weight * light_share(s, view.facing, sight.way.direction, next.wi.z);
    sight.share *= bsdf_share(bsdf, view.wo, 0.5);
    if (sight.share < 1.0) sight.albedo = seen_albedo(sight.throughput, vec3(1.0), 1.0);
    return goes_on && largest_channel(sight.throughput) > 0.0;
}

// The first surface that `ray` shows, behind smooth ones, or the sky. Depth and position are as if the way had been straight, so
// that they change as the image does; a normal that points back along the way tells where in the sky it ends. The sky has the object and the
// material of the smooth surface, as filters take what has neither for sky that is seen by itself. The albedo is what the light from there is
// multiplied by on its way. `first` becomes the first hit, smooth or not, and `kept` the albedo that paths keep which begin like this: see
// `seen_albedo`.
Guide seen_hit(Ray ray, uint seed, out Guide first, out Hit first_hit, out vec3 kept) {
    Sight sight = Sight(ray, 0.0, vec3(1.0), vec3(0.0), 1.0);
    Guide seen;
    bool on;
    uint bounce = 0u;
    // Rays are traced and surfaces read in one place of the code, whose size decides how long the kernels take to compile.
    do {
        Segment way = Segment(sight.way.origin, sight.way.direction, INFINITE_DISTANCE, path_mask_seed(seed, bounce));
        Hit hit = traverse(way, push.constants.root);
        seen = Guide_zero();
        seen.object = seen.material = NONE;
        bool sky = hit.triangle == NONE;
        vec3 towards = sight.way.direction, throughput = sight.throughput;
        float from_start = sight.walked + (sky ? 0.0 : hit.t);
        on = false;
        if (!sky) {
            Surface s = surface_at(hit);
            Bsdf bsdf = surface_bsdf(s);
            seen = guide_of(sight.way, hit, s, bsdf);
            if (bounce + 1u < push.constants.max_depth) on = look_on(sight, s, bsdf);
        }
        if (bounce == 0u) {
            first = seen;
            first_hit = hit;
        } else {
            seen.normal = sky ? -towards : seen.normal;
            seen.depth = from_start + camera.near;
            seen.position = ray.origin + from_start * ray.direction;
            seen.albedo = throughput * (sky ? vec3(1.0) : seen.albedo);
            if (sky) {
                seen.object = first.object;
                seen.material = first.material;
            }
        }
        sight.walked = from_start;
        bounce++;
    } while (FX_SMOOTH && on);
    kept = sight.albedo;
    return seen;
}
