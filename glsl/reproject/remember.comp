#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// At the end of a frame, before anything changes, writes what each pixel hands on to the next: the point that its samples are of, and
// their statistics.
// Pixels of specular surfaces and of edges hand on nothing (Schalk 2018, 3.2), unless nothing has moved: then every pixel keeps
// all that it has.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer guide; // of Guide
layout(binding = 12) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 13) uniform usamplerBuffer light; // of PixelLight
layout(binding = 14) uniform usamplerBuffer points; // of SurfacePoint
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) readonly buffer CarriedWords { uint carried[]; };
layout(scalar, binding = 18) writeonly buffer Histories { HistoryWords history[]; }; // of History
layout(scalar, binding = 19) writeonly buffer HistoryLights { HistoryLight history_light[]; };
layout(scalar, binding = 20) writeonly buffer Offers { uint offered[]; };
// By its number in the last frame, that in the new one, of instances and of triangles.
layout(scalar, binding = 21) readonly buffer InstanceNow { uint instance_now[]; };
layout(scalar, binding = 22) readonly buffer TriangleNow { uint triangle_now[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/surface_point.glsl"
#include "shared/history.glsl"
#include "shared/whole_pixel.glsl"

// Whether the surface shows a sharp image of what is around it, or lets light through.
bool is_sharp(Bsdf b) {
    if (is_kind(FX_METALLIC, b, BSDF_METALLIC)) {
        bool coat = has_coat(b.metallic) && smooth_alpha(b.metallic.coat_alpha);
        return coat || smooth_alpha(b.metallic.alpha) || b.metallic.through != vec3(0.0);
    }
    return is_kind(FX_DIELECTRIC, b, BSDF_DIELECTRIC) || (bsdf_is_specular(b) && is_smooth(b));
}

// 0 where the pixel's samples may move. `back` says which side of the surface they show.
uint reason_to_keep(uint pixel, SurfacePoint at, out bool back) {
    back = false;
    if (at.triangle == NONE) return DROPPED_SKY;
    Surface s = surface_of(at);
    back = dot(s.geometric, previous.position - s.position) < 0.0;
    if (is_sharp(surface_bsdf(s))) return DROPPED_SPECULAR;
    return is_whole(pixel, s.geometric, pixel_width(previous, push.size)) ? 0u : DROPPED_EDGE;
}

// The point as the new frame numbers it.
SurfacePoint numbered_anew(SurfacePoint at) {
    if (FX_INSTANCES && push.instances != 0u && at.instance != NONE) at.instance = instance_now[at.instance];
    if (push.triangles != 0u && at.triangle != NONE) at.triangle = triangle_now[at.triangle];
    return at;
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i;
    bool still = push.moved == 0u && previous == camera;
    PixelStats s = PixelStats_load(stats, pixel);
    SurfacePoint at = SurfacePoint_load(points, pixel);
    bool back = false;
    uint reason = still || s.count == 0u ? 0u : reason_to_keep(pixel, at, back);
    uint kept = min(s.count, still ? MOST_CARRIED : push.max_samples);
    Carried before = carried_of(carried[pixel]);
    // A pixel that took nothing has samples of age and error 0, whatever its word says of why.
    Carried now = Carried(kept, before.count > 0u ? before.age : 0u, before.count > 0u ? before.error : 0u, back);
    offered[i] = reason == 0u ? word_of(now) : dropped(reason);
    vec3 m2 = vec3(part_of_m2(s.m2.x, kept, s.count), part_of_m2(s.m2.y, kept, s.count), part_of_m2(s.m2.z, kept, s.count));
    at = numbered_anew(at);
    history[i] = History_words(History(at.triangle, at.instance, at.weights, s.mean, m2));
    if (FX_SPLIT) {
        PixelLight l = PixelLight_load(light, pixel);
        // Not as 64-bit words: seven words are no multiple of those.
        history_light[i] = HistoryLight(l.direct, l.albedo, part_of_m2(l.indirect_m2, kept, s.count));
    }
}
