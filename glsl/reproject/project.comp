#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// Finds for each pixel of the last frame the point of the new film that its samples' point has moved to (forward reprojection,
// Schalk 2018, 3.2), and offers its samples to the four pixels around, where those show the same surface, fewer of them where the light
// towards the new view differs. Where something else has moved, points have moved with it, and what has become of their light is known
// from probes: as if the scene changed first, before the last camera, and then the camera moved.
//
// Of several offers the one nearest to the pixel's centre wins, then that of the lowest old pixel: an atomic minimum of integers,
// whose result does not depend on the order of threads. A point within a pixel is nearer than one outside, which so comes in where
// there is no other: departure from the paper, which offers to one pixel alone. Where the image grows or shrinks by 1 % a frame, a
// quarter of all pixels would find no point within them, and after 16 frames a pixel would have two samples, not 17. Where so few
// samples are worth it that new ones outnumber them, points farther than this, from the centre along either axis, would bring the other
// side of an edge of a texture.
const float FARTHEST_OF_FEW = 0.75;

layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer history; // of History
layout(binding = 12) uniform usamplerBuffer guide; // of Guide
layout(binding = 13) uniform usamplerBuffer changes; // of LightChange
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) buffer Offers { uint offered[]; };
layout(scalar, binding = 18) buffer Winners { uint winner[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/surface_point.glsl"
#include "shared/history.glsl"
#include "shared/probe_cell.glsl"
#include "shared/held.glsl"
#include "shared/whole_pixel.glsl"
#include "shared/rests.glsl"

// Offers the samples of a pixel to those around `film`, a point of the film, of an edge to edges alone. Returns why none takes them,
// or 0.
uint offer(uint pixel, Surface s, vec2 film, bool edge, bool few) {
    ivec2 size = ivec2(push.size), corner = ivec2(floor(clamp(film, vec2(-2.0), vec2(size) + 2.0) - 0.5));
    uint reason = DROPPED_OUTSIDE;
    for (int k = 0; k < 4; k++) {
        ivec2 at = corner + ivec2(k & 1, k >> 1);
        if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, size))) continue;
        uint to = uint(at.y * size.x + at.x);
        uint at_edge = winner[to] & AT_EDGE; // what others offer does not change it
        vec2 off = abs(film - vec2(at) - 0.5);
        float distance = max(off.x, off.y);
        if (few && distance > FARTHEST_OF_FEW) continue;
        bool taken = edge == (at_edge != 0u) && shows(to, s);
        if (taken) atomicMin(winner[to], at_edge | min(uint(distance * float(FARTHEST + 1u)), FARTHEST) << PIXEL_BITS | pixel);
        reason = taken ? 0u : reason == 0u ? 0u : DROPPED_HIDDEN;
    }
    return reason;
}

// Moves the samples of a pixel. Returns their word in their new pixel, or why they stay behind.
uint moved(uint pixel, Carried c) {
    Surface s = surface_of(History_triangle(history, pixel), History_instance(history, pixel), History_weights(history, pixel));
    if (c.back != (dot(s.geometric, camera.position - s.position) < 0.0)) return dropped(DROPPED_HIDDEN);
    c.count = worth_in_light(c.count, pixel);
    if (c.count == 0u) return dropped(DROPPED_LIGHT);
    c.count = worth_in_view(c.count, view_change(s), pixel);
    if (c.count == 0u) return dropped(DROPPED_VIEW);
    c.count = shared_out(c.count, s.position);
    vec3 film = film_from_point(camera, s.position, push.size);
    uint reason = film.z > 0.0 && finite(film) ? offer(pixel, s, film.xy, c.edge, c.count < push.spp) : DROPPED_OUTSIDE;
    return reason == 0u ? word_of(Carried(c.count, c.age + 1u, c.edge, c.back)) : dropped(reason);
}

// Leaves the samples of a pixel that rests where they are. Returns their word, or why they go.
uint kept(uint pixel, Carried c) {
    c.count = worth_in_light(c.count, pixel);
    if (c.count == 0u) return dropped(DROPPED_LIGHT);
    atomicMin(winner[pixel], (c.edge ? AT_EDGE : 0u) | pixel); // at no distance from the centre
    return word_of(Carried(c.count, c.age + 1u, c.edge, c.back));
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i;
    Carried c = carried_of(offered[pixel]);
    if (push.moved == 0u && previous == camera) {
        if (c.count > 0u) winner[pixel] = pixel;
        return;
    }
    Carried resting = resting(pixel, offered[pixel], (winner[pixel] & AT_EDGE) != 0u);
    if (resting.count > 0u) offered[pixel] = kept(pixel, resting);
    else if (c.count > 0u) offered[pixel] = moved(pixel, c);
}
