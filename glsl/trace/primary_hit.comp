#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// Traces the ray through the centre of one pixel per thread, from the middle of the lens, and writes its hit as a Guide, which
// sample placement uses, and what it shows as another, which filters use: through a lens the mean of what LENS_RAYS rays show.
layout(local_size_x_id = 100) in;
layout(constant_id = 110) const bool POINTS = false; // writes where the surface was hit, too
layout(scalar, binding = 11) writeonly buffer Guides { Guide guides[]; };
layout(scalar, binding = 12) writeonly buffer Points { SurfacePoint points[]; };
layout(scalar, binding = 13) writeonly buffer Seen { Guide seen[]; };
layout(scalar, binding = 14) writeonly buffer Blur { float blur[]; };
layout(scalar, push_constant) uniform Push { PathPush push; };

#include "shared/first_hit.glsl"
#include "shared/lens.glsl"

// With four rays `auto` had 1.02 to 1.09 times the error, with 16 up to 4 % less, and the rays took .4 of the time of four samples.
const uint LENS_RAYS = 8u;

// A point of the lens for each ray, all of them spread evenly over the unit square (Hammersley 1960). All pixels have the same: noise in
// guides would keep filters from neighbours that are alike.
vec2 lens_point(uint k) { return vec2((float(k) + 0.5) / float(LENS_RAYS), unit_interval(bitfieldReverse(k))); }

// Sums over the rays. What meets nothing has no position, and counts with a normal and a depth of 0.
struct ThroughLens {
    Guide guide;
    uint hits;
    float blur;
};

void add_ray(inout ThroughLens sum, Guide shown, Ray ray) {
    bool hit = shown.depth > 0.0;
    sum.blur += lens_blur((hit ? shown.depth : INFINITE_DISTANCE) * dot(ray.direction, camera.forward), push.constants.size);
    if (!hit) return;
    sum.hits++;
    sum.guide.normal += shown.normal;
    sum.guide.depth += shown.depth;
    sum.guide.position += shown.position;
    sum.guide.albedo += shown.albedo;
}

// Of several surfaces, none is named: see shared/blurred.glsl.
Guide mean_guide(ThroughLens sum) {
    const float SHARE = 1.0 / float(LENS_RAYS);
    Guide mean = sum.guide;
    mean.object = sum.hits > 0u ? 0u : NONE;
    mean.material = sum.blur > 0.0 ? NONE : 0u;
    float len = length(sum.guide.normal);
    mean.normal = len > 0.0 ? sum.guide.normal / len : vec3(0.0);
    mean.depth = SHARE * sum.guide.depth;
    mean.position = sum.guide.position / float(max(sum.hits, 1u));
    mean.albedo = SHARE * sum.guide.albedo;
    return mean;
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i;
    vec2 centre = vec2(pixel % push.constants.size.x, pixel / push.constants.size.x) + 0.5;
    vec2 film = film_from_pixel(centre, push.constants.size);
    Guide shown;
    ThroughLens sum = ThroughLens(Guide_zero(), 0u, 0.0);
    uint k = 0u;
    // The first ray is that through the middle of the lens. Rays are traced in one place, in a loop that is tested at its end: see
    // shared/first_hit.glsl and shared/traverse.glsl.
    do {
        Camera lens = camera;
        lens.lens_radius = k == 0u ? 0.0 : camera.lens_radius;
        Ray ray = camera_ray(lens, film, k == 0u ? vec2(0.5) : lens_point(k - 1u));
        Guide guide;
        Hit hit;
        vec3 kept;
        Guide seen_here = seen_hit(ray, STRONGER_WAY, guide, hit, kept);
        if (k == 0u) {
            shown = seen_here;
            guides[i] = guide;
            if (POINTS) {
                points[i].triangle = hit.triangle;
                points[i].instance = hit.instance;
                points[i].weights = vec2(hit.b1, hit.b2);
            }
        } else {
            add_ray(sum, seen_here, ray);
        }
    } while (FX_LENS && k++ < LENS_RAYS);
    if (FX_LENS) {
        shown = mean_guide(sum);
        blur[i] = sum.blur / float(LENS_RAYS);
    }
    if (FX_SMOOTH || FX_LENS) seen[i] = shown;
}
