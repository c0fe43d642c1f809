#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// Says of each pixel of a new frame whether it is at an edge, in the key of an offer that every other wins against.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer guide; // of Guide
layout(binding = 12) uniform usamplerBuffer points; // of SurfacePoint
layout(scalar, binding = 16) writeonly buffer Winners { uint winner[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/surface_point.glsl"
#include "shared/history.glsl"
#include "shared/whole_pixel.glsl"

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i;
    SurfacePoint at = SurfacePoint_load(points, pixel);
    bool edge = at.triangle != NONE && !is_whole(pixel, surface_of(at).geometric, pixel_width(camera, push.size));
    winner[i] = (edge ? AT_EDGE : 0u) | NO_OFFER;
}
