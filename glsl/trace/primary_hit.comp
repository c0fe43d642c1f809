#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// Traces the ray through the centre of one pixel per thread, from the middle of the lens, and writes its hit as a Guide, which
// sample placement uses, and what it shows as another, which filters use.
layout(local_size_x_id = 100) in;
layout(constant_id = 110) const bool POINTS = false; // writes where the surface was hit, too
layout(scalar, binding = 11) writeonly buffer Guides { Guide guides[]; };
layout(scalar, binding = 12) writeonly buffer Points { SurfacePoint points[]; };
layout(scalar, binding = 13) writeonly buffer Seen { Guide seen[]; };
layout(scalar, push_constant) uniform Push { PathPush push; };

#include "shared/first_hit.glsl"

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i;
    vec2 centre = vec2(pixel % push.constants.size.x, pixel / push.constants.size.x) + 0.5;
    Camera pinhole = camera;
    pinhole.lens_radius = 0.0;
    Ray ray = camera_ray(pinhole, film_from_pixel(centre, push.constants.size), vec2(0.5));
    Guide guide;
    Hit hit;
    vec3 kept;
    Guide shown = seen_hit(ray, pcg(pixel), guide, hit, kept);
    guides[i] = guide;
    if (FX_SMOOTH) seen[i] = shown;
    if (POINTS) {
        points[i].triangle = hit.triangle;
        points[i].instance = hit.instance;
        points[i].weights = vec2(hit.b1, hit.b2);
    }
}
