#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/frame.glsl"

// Starts each pixel of a new frame with the samples that won it, or with none. Carried samples keep the point that they are of, so
// that they move on from there and not from the centre of a pixel. The point of the new frame's samples takes over where those will
// outnumber them, and where they come from beyond the pixel: what moved on from there would take new samples along to a neighbour.
layout(local_size_x_id = 100) in;
layout(binding = 12) uniform usamplerBuffer history; // of History
layout(binding = 13) uniform usamplerBuffer history_light; // of HistoryLight
layout(binding = 14) uniform usamplerBuffer offered; // of uint
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) writeonly buffer Stats { PixelStatsWords stats[]; }; // of PixelStats
layout(scalar, binding = 18) writeonly buffer Lights { PixelLightWords light[]; }; // of PixelLight
layout(scalar, binding = 19) buffer Points { SurfacePoint points[]; };
layout(scalar, binding = 20) buffer Winners { uint winner[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/history.glsl"

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i, key = winner[i], from = key & ((1u << PIXEL_BITS) - 1u), word = 0u;
    bool still = push.moved == 0u && previous == camera;
    PixelStats s = PixelStats_zero();
    PixelLight l = PixelLight_zero();
    if ((key & NO_OFFER) != NO_OFFER) word = texelFetch(offered, int(from)).x;
    else if ((key & AT_EDGE) != 0u) word = dropped(DROPPED_EDGE);
    Carried c = carried_of(word);
    if (c.count > 0u) {
        History h = History_load(history, from);
        s.mean = h.mean;
        s.m2 = still ? h.variance : h.variance * float(c.count - 1u); // of one sample there are no deviations
        s.count = c.count;
        if (FX_SPLIT) {
            HistoryLight taken = HistoryLight_load(history_light, from);
            l.direct = taken.direct;
            l.albedo = taken.albedo;
            l.remainder = taken.remainder;
            l.indirect_m2 = still ? taken.indirect_variance : taken.indirect_variance * float(c.count - 1u);
        }
        bool inside = (key >> PIXEL_BITS & FARTHEST) <= FARTHEST / 2u;
        if (c.count >= push.spp && inside) {
            points[i].triangle = h.triangle;
            points[i].instance = h.instance;
            points[i].weights = h.weights;
        }
    }
    stats[i] = PixelStats_words(s);
    if (FX_SPLIT) light[i] = PixelLight_words(l);
    winner[i] = word;
}
