#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"
#include "shared/luminance.glsl"

// Starts each pixel of a new frame with samples of the last, or with none, from the new pixel's side (backward reprojection): finds
// where on the last film its point was, and takes the four pixels around that hold, weighted bilinearly. Stands for edges.comp,
// project.comp and carry.comp; the point that samples are of is always that of the pixel's centre.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer guide; // of Guide
layout(binding = 12) uniform usamplerBuffer points; // of SurfacePoint
layout(binding = 13) uniform usamplerBuffer history; // of History
layout(binding = 14) uniform usamplerBuffer history_light; // of HistoryLight
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(binding = 17) uniform usamplerBuffer offered; // of uint
layout(binding = 18) uniform usamplerBuffer changes; // of LightChange
layout(scalar, binding = 19) writeonly buffer Stats { PixelStatsWords stats[]; }; // of PixelStats
layout(scalar, binding = 20) writeonly buffer Lights { PixelLightWords light[]; }; // of PixelLight
layout(scalar, binding = 21) writeonly buffer CarriedWords { uint carried[]; };
layout(scalar, push_constant) uniform Push { ReprojectPush push; };

#include "shared/surface_point.glsl"
#include "shared/history.glsl"
#include "shared/whole_pixel.glsl"
#include "shared/probe_cell.glsl"
#include "shared/held.glsl"
#include "shared/rests.glsl"
#include "shared/sample_marks.glsl"

// Steps towards where a point was on the last film. Where nothing but the camera moves the first place is exact.
const int STEPS = 4;
const float MOST_M2 = 1e35; // the largest sum of squares, as of accumulate.comp

// Samples of several pixels, merged by Chan's rule, and sums of their weights.
struct Merged {
    PixelStats stats;
    PixelLight light;
    float samples; // sum of weight * count
    float squares; // sum of weight^2 * count
    float weight;
    Carried c;
};

void merge(inout Merged m, uint from, Carried c, float weight) {
    History h = History_load(history, from);
    float count = float(c.count), samples = m.samples + weight * count, part = weight * count / samples;
    vec3 off = h.mean - m.stats.mean;
    m.stats.m2 += weight * (count - 1.0) * h.variance + off * (off * (m.samples * part));
    if (FX_SPLIT) {
        HistoryLight l = HistoryLight_load(history_light, from);
        bool passed_over = (l.remainder & ALL_PASSED_OVER) != 0u;
        bool all_before = m.samples == 0.0 || (m.light.remainder & ALL_PASSED_OVER) != 0u;
        uint bare = (m.light.remainder | l.remainder) & SOME_BARE;
        // What knows nothing of the key light counts as what does.
        if (bare == 0u && passed_over && !all_before) l.direct = m.light.direct;
        if (bare == 0u && !passed_over && all_before) m.light.direct = l.direct;
        m.light.remainder = bare | (passed_over && all_before ? ALL_PASSED_OVER : 0u);
        float other = luminance(h.mean - l.direct) - luminance(m.stats.mean - m.light.direct);
        m.light.indirect_m2 += weight * (count - 1.0) * l.indirect_variance + other * (other * (m.samples * part));
        m.light.direct += (l.direct - m.light.direct) * part;
        m.light.albedo += (l.albedo - m.light.albedo) * part;
    }
    m.stats.mean += off * part;
    m.samples = samples;
    m.squares += weight * weight * count;
    m.weight += weight;
    m.c.age = max(m.c.age, c.age + 1u);
}

// The word of what was merged, whose statistics become those of so many samples of equal weight.
uint finish(inout Merged m, bool edge) {
    m.c.count = min(uint(m.samples / m.weight + 0.5), MOST_CARRIED);
    m.c.edge = edge;
    // Of single samples beside one that nearly all is of, the difference would be rounding. One sample has no deviations.
    float variance = float(m.c.count - 1u) / max(m.samples - m.squares / m.samples, 1e-4 * m.samples);
    m.stats.count = m.c.count;
    m.stats.m2 = min(m.stats.m2 * variance, MOST_M2);
    m.light.indirect_m2 = min(m.light.indirect_m2 * variance, MOST_M2);
    return word_of(m.c);
}

// Where on the last film the point was that a pixel shows now; z as of film_from_point. What the pixels of the last frame show has
// moved from their centres to where it is now: a point between them has moved by as much.
vec3 was_at(Surface s, vec2 centre) {
    ivec2 size = ivec2(push.size);
    vec3 at = film_from_point(previous, s.position, push.size);
    for (int k = 0; k < STEPS && push.moved != 0u && finite(at); k++) {
        ivec2 q = ivec2(floor(clamp(at.xy, vec2(0.0), vec2(size) - 0.5)));
        uint from = uint(q.y * size.x + q.x), triangle = History_triangle(history, from);
        if (triangle == NONE) break;
        Surface shown = surface_of(triangle, History_instance(history, from), History_weights(history, from));
        vec3 now = film_from_point(camera, shown.position, push.size);
        at = vec3(vec2(q) + 0.5 + centre - now.xy, now.z);
    }
    return at;
}

// Why a pixel cannot take samples of an old one, or 0: those are what `c` says then.
uint reason_to_leave(uint pixel, uint from, bool edge, float view, inout Carried c) {
    if (c.edge != edge) return DROPPED_HIDDEN;
    Surface s = surface_of(History_triangle(history, from), History_instance(history, from), History_weights(history, from));
    if (c.back != (dot(s.geometric, camera.position - s.position) < 0.0) || !shows(pixel, s)) return DROPPED_HIDDEN;
    c.count = worth_in_light(c.count, from);
    if (c.count == 0u) return DROPPED_LIGHT;
    c.count = worth_in_view(c.count, view, from);
    if (c.count == 0u) return DROPPED_VIEW;
    c.count = shared_out(c.count, s.position);
    return 0u;
}

// What a pixel takes of the four around a point of the last film; or why none, in its word.
uint take(uint pixel, inout Merged m) {
    SurfacePoint p = SurfacePoint_load(points, pixel);
    if (p.triangle == NONE) return 0u;
    Surface s = surface_of(p);
    ivec2 size = ivec2(push.size);
    bool edge = !is_whole(pixel, s.geometric, pixel_width(camera, push.size));
    Carried rests = resting(pixel, texelFetch(offered, int(pixel)).x, edge);
    if (rests.count > 0u) {
        rests.count = worth_in_light(rests.count, pixel);
        if (rests.count == 0u) return dropped(DROPPED_LIGHT);
        merge(m, pixel, rests, 1.0);
        return finish(m, edge);
    }
    vec3 film = was_at(s, vec2(pixel % push.size.x, pixel / push.size.x) + 0.5);
    if (!(film.z > 0.0 && finite(film))) return dropped(DROPPED_OUTSIDE);
    vec2 at = clamp(film.xy, vec2(-2.0), vec2(size) + 2.0) - 0.5, low = floor(at);
    float view = view_change(s);
    uint reason = DROPPED_OUTSIDE;
    for (int k = 0; k < 4; k++) {
        ivec2 q = ivec2(low) + ivec2(k & 1, k >> 1);
        if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, size))) continue;
        uint from = uint(q.y * size.x + q.x);
        vec2 share = 1.0 - abs(at - vec2(q));
        Carried c = carried_of(texelFetch(offered, int(from)).x);
        uint why = c.count > 0u ? reason_to_leave(pixel, from, edge, view, c) : c.age > 0u ? DROPPED_HIDDEN : 0u;
        float weight = share.x * share.y;
        if (why == 0u && c.count > 0u && weight > 0.0) merge(m, from, c, weight);
        if (reason != 0u) reason = why;
    }
    return m.weight == 0.0 ? dropped(edge ? DROPPED_EDGE : reason) : finish(m, edge);
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uint pixel = push.first_pixel + i, word;
    Merged m = Merged(PixelStats_zero(), PixelLight_zero(), 0.0, 0.0, 0.0, carried_of(0u));
    if (push.moved == 0u && previous == camera) {
        word = texelFetch(offered, int(pixel)).x;
        if (carried_of(word).count > 0u) {
            History h = History_load(history, pixel);
            m.stats.mean = h.mean;
            m.stats.count = carried_of(word).count;
            m.stats.m2 = h.variance;
            if (FX_SPLIT) {
                HistoryLight l = HistoryLight_load(history_light, pixel);
                m.light.direct = l.direct;
                m.light.indirect_m2 = l.indirect_variance;
                m.light.albedo = l.albedo;
                m.light.remainder = l.remainder;
            }
        }
    } else {
        word = take(pixel, m);
    }
    stats[i] = PixelStats_words(m.stats);
    if (FX_SPLIT) light[i] = PixelLight_words(m.light);
    carried[i] = word;
}
