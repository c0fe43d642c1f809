#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// Starts each pixel of a new frame with the samples that won it, or with none. A pixel at an edge takes none: what it shows is a
// mixture that no sample of one surface stands for. Carried samples keep the point that they are of, so that they move on from
// there and not from the centre of a pixel; where the new frame's samples will outnumber them, its point takes over.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer guide; // of Guide
layout(binding = 12) uniform usamplerBuffer history; // of History
layout(binding = 13) uniform usamplerBuffer history_light; // of HistoryLight
layout(binding = 14) uniform usamplerBuffer offered; // of uint
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) writeonly buffer Stats { PixelStatsWords stats[]; }; // of PixelStats
layout(scalar, binding = 18) writeonly buffer Lights { PixelLightWords light[]; }; // of PixelLight
layout(scalar, binding = 19) buffer Points { SurfacePoint points[]; };
layout(scalar, binding = 20) buffer Winners { uint winner[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/surface_point.glsl"
#include "shared/history.glsl"
#include "shared/whole_pixel.glsl"

const uint OLD_PIXEL = 67108863u; // the lower 26 bits of a key, see project.comp

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i, key = winner[i], from = key & OLD_PIXEL, word = 0u;
    PixelStats s = PixelStats_zero();
    PixelLight l = PixelLight_zero();
    if (key != NONE) {
        word = texelFetch(offered, int(from)).x;
        if (push.moved != 0u || previous != camera) {
            Surface seen = surface_of(points[i]);
            if (!is_whole(pixel, seen.geometric, pixel_width(camera, push.size))) word = dropped(DROPPED_EDGE);
        }
    }
    Carried c = carried_of(word);
    if (c.count > 0u) {
        History h = History_load(history, from);
        s.mean = h.mean;
        s.m2 = h.m2;
        s.count = c.count;
        if (FX_SPLIT) {
            HistoryLight taken = HistoryLight_load(history_light, from);
            l.direct = taken.direct;
            l.albedo = taken.albedo;
            l.indirect_m2 = taken.indirect_m2;
        }
        if (c.count >= push.spp) points[i] = SurfacePoint(h.triangle, h.instance, h.weights);
    }
    stats[i] = PixelStats_words(s);
    if (FX_SPLIT) light[i] = PixelLight_words(l);
    winner[i] = word;
}
