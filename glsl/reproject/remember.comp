#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"

// At the end of a frame, before anything changes, writes what each pixel hands on to the next: the point that its samples are of, and
// their statistics.
// Pixels of specular surfaces hand on nothing (Schalk 2018, 3.2), nor do those of surfaces that are partly opaque, unless nothing has
// moved: then every pixel keeps all that it has.
// Departures from there: pixels hand on as many samples as are worth it by what their neighbours show, and those of edges hand them
// on to pixels of edges.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer guide; // of Guide
layout(binding = 12) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 13) uniform usamplerBuffer light; // of PixelLight
layout(binding = 14) uniform usamplerBuffer points; // of SurfacePoint
layout(scalar, binding = 16) uniform Previous { Camera previous; };
layout(scalar, binding = 17) readonly buffer CarriedWords { uint carried[]; };
layout(scalar, binding = 18) writeonly buffer Histories { HistoryWords history[]; }; // of History
layout(scalar, binding = 19) writeonly buffer HistoryLights { HistoryLightWords history_light[]; }; // of HistoryLight
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

// Whether samples of the pixel may have passed through a surface that its guide shows, or been stopped by one that its guide has passed
// through: they are of several points then, of which but one is known. Holes of a texture have an opacity of 1 beside them.
bool is_veiled(uint pixel, SurfacePoint at, Surface s) {
    if (!FX_ALPHA_MASKS) return false;
    bool veiled = surface_opacity(s.material, at.triangle, at.weights) < 1.0;
    for (int k = 0; k < 9; k++) {
        uint material = Guide_material(guide, neighbour(pixel, k));
        veiled = veiled || material != NONE && Material_opacity(materials, material) < 1.0;
    }
    return veiled;
}

// From one frame to the next a pixel moves against an edge, and the share of it that shows the other surface changes: by how far
// the pixel's centre has moved against the point. The square of the distance of a point from the centre is 1/12 on average, and 1/2 for
// the fifth of points that come in from outside: 1/12 before and 1/6 after.
const float VARIANCE_OF_MOVE = 0.25;

// How many of the samples of a pixel are worth handing on; of one at an edge so many that their mean is as good as new samples are, by
// the variance of one and the square of what the move shifts them by, which grows with the difference of the surfaces' light. None
// beside a lamp, whose light exceeds that of all around it.
// Most pixels are at none: lavapipe leaves a loop of no lane, and executes a branch that no lane takes.
uint kept_of_edge(uint pixel, vec3 plane, uint count, bool edge) {
    int neighbours = edge ? 9 : 0, k = 0;
    float width = pixel_width(previous, push.size);
    vec4 own = vec4(0.0), others = vec4(0.0); // sum of radiance, samples
    float squares = 0.0;
    bool lamp = false;
    do {
        uint q = neighbour(pixel, k), material = Guide_material(guide, q);
        PixelStats s = PixelStats_load(stats, q);
        bool same = shows_same(pixel, q, plane, width);
        vec4 sum = float(s.count) * vec4(s.mean, 1.0);
        own += same ? sum : vec4(0.0);
        others += same ? vec4(0.0) : sum;
        squares += s.m2.r + s.m2.g + s.m2.b + dot(sum.rgb, s.mean);
        lamp = lamp || material != NONE && Material_emission(materials, material) != vec3(0.0);
        k++;
    } while (k < neighbours);
    if (!edge) return count;
    if (lamp || own.w == 0.0 || others.w == 0.0) return 0u;
    vec3 mean = own.rgb / own.w, beside = others.rgb / others.w, contrast = mean - beside;
    // Of one sample, about the mean of its surface.
    float variance = (squares - dot(own.rgb, mean) - dot(others.rgb, beside)) / max(own.w + others.w - 2.0, 1.0);
    return worth(count, VARIANCE_OF_MOVE * dot(contrast, contrast) / max(variance, 1e-30));
}

// Textures, shadows and thin things make pixels differ that lie near each other. A pixel that moves by less than its width shows
// something else altogether where they are finer than that, and then its squared difference is twice the variance among pixels.
const float SHARE_OF_SPREAD = 2.0;
const float SHARE_AT_EDGE = 0.5; // a straight edge is coarse
// That variance counts from so many times on what noise alone would give: that of 18 means has a standard deviation of a third of it.
const float SURE_SPREAD = 1.5;
const float LEAST_SPREAD = 1.52587890625e-5; // 2^-16: of the square of a pixel's radiance, a difference of 1/256 is let be
const int NEAR = 18; // the squares of nine pixels, and of nine that lie two apart

const float UNKNOWN_NOISE = 1e15; // so much that no change of the view matters

// How many of the samples of a pixel are worth handing on by what the means of pixels around differ by, beyond their noise. New
// samples are stratified within the pixel, where they take in without noise what varies so: only what else is in the variance of one
// counts. Away from edges other surfaces do not.
// `noise` is that of History_noise: of the other pixels alone, since with the pixel's own, bright samples would go and dark ones stay.
uint kept_by_spread(uint pixel, vec3 plane, uint count, bool edge, out float noise) {
    ivec2 size = ivec2(push.size), at = ivec2(pixel % push.size.x, pixel / push.size.x);
    vec3 sum = vec3(0.0), origin = PixelStats_mean(stats, pixel);
    vec3 beside = vec3(0.0); // sum of the others' means
    vec3 others = vec3(0.0); // squared deviations, degrees of freedom, number
    float squares = 0.0, within = 0.0, degrees = 0.0, inverse = 0.0, n = 0.0, width = pixel_width(previous, push.size);
    for (int k = 0; k < NEAR; k++) {
        ivec2 q = clamp(at + (k < 9 ? 1 : 2) * ivec2(k % 3 - 1, k % 9 / 3 - 1), ivec2(0), size - 1);
        uint other = uint(q.y * size.x + q.x);
        if (!edge && k >= 9 && !shows_same(pixel, other, plane, width)) continue;
        PixelStats s = PixelStats_load(stats, other);
        if (s.count == 0u) continue; // it is not black, but unknown
        vec3 off = s.mean - origin;
        n += 1.0;
        sum += off;
        squares += dot(off, off);
        vec3 own = vec3(s.m2.r + s.m2.g + s.m2.b, float(s.count - 1u), 1.0);
        within += own.x;
        degrees += own.y;
        if (DEPENDS_ON_VIEW && other != pixel) {
            beside += s.mean;
            others += own;
        }
        inverse += 1.0 / float(s.count);
    }
    float variance = within / max(degrees, 1.0), spread = (squares - dot(sum, sum) / n) / max(n - 1.0, 1.0);
    float beyond = max(spread - SURE_SPREAD * variance * inverse / n - LEAST_SPREAD * dot(origin, origin), 0.0);
    noise = others.y > 0.0 ? others.x / others.y * others.z * others.z / max(dot(beside, beside), 1e-30) : UNKNOWN_NOISE;
    // Single samples do not tell their noise.
    return degrees > 0.0 ? worth(count, (edge ? SHARE_AT_EDGE : SHARE_OF_SPREAD) * beyond / max(variance - beyond, 1e-30)) : count;
}

// 0 where the pixel's samples may move: so many, of that side of the surface, of an edge or not. Where they do not have to, all rest.
uint reason_to_keep(uint pixel, SurfacePoint at, inout Carried c, out float noise, out uint resting) {
    noise = UNKNOWN_NOISE;
    resting = 0u;
    if (at.triangle == NONE) return DROPPED_SKY;
    Surface s = surface_of(at);
    c.back = dot(s.geometric, previous.position - s.position) < 0.0;
    if (is_sharp(surface_bsdf(s)) || is_veiled(pixel, at, s)) return DROPPED_SPECULAR;
    c.edge = !is_whole(pixel, s.geometric, pixel_width(previous, push.size));
    resting = word_of(c);
    c.count = min(kept_by_spread(pixel, s.geometric, c.count, c.edge, noise), kept_of_edge(pixel, s.geometric, c.count, c.edge));
    return c.count > 0u ? 0u : DROPPED_EDGE;
}

// What is known of all samples of a pixel, of which it had c.count at the start of the frame. Their age is the mean of theirs, and new
// ones have none. Where it is at the limit fewer count, so that new ones keep it there: were all dropped at once, a whole film would
// begin anew in one frame.
Carried older(Carried c, uint count, bool still) {
    uint age = (c.age * c.count + count / 2u) / max(count, 1u);
    c.count = min(count, still ? MOST_CARRIED : push.max_samples);
    bool old = !still && age >= push.max_age;
    c.count = old ? c.count * push.max_age / (age + 1u) : c.count;
    c.age = old ? max(push.max_age, 1u) - 1u : age;
    return c;
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
    Carried c = carried_of(carried[pixel]);
    // A pixel that took nothing has samples of age 0, whatever its word says of why.
    if (c.count == 0u) c = carried_of(0u);
    c = older(c, s.count, still);
    c.edge = c.back = false;
    float noise = UNKNOWN_NOISE;
    uint resting = 0u;
    uint reason = still || s.count == 0u ? 0u : c.count == 0u ? DROPPED_OLD : reason_to_keep(pixel, at, c, noise, resting);
    offered[i] = reason == 0u ? word_of(c) : dropped(reason);
    at = numbered_anew(at);
    // Where nothing moves sums are handed on as they are, but for samples that MOST_CARRIED leaves out.
    float share = still ? freedom(c.count) / freedom(s.count) : 1.0, divisor = still ? 1.0 : freedom(s.count);
    History h = History_zero();
    h.triangle = at.triangle;
    h.instance = at.instance;
    h.weights = at.weights;
    h.mean = s.mean;
    h.variance = s.m2 * share / divisor;
    h.noise = noise;
    h.resting = resting;
    history[i] = History_words(h);
    if (FX_SPLIT) {
        PixelLight l = PixelLight_load(light, pixel);
        HistoryLight h = HistoryLight_zero();
        h.direct = l.direct;
        h.albedo = l.albedo;
        h.remainder = l.remainder;
        h.indirect_variance = l.indirect_m2 * share / divisor;
        history_light[i] = HistoryLight_words(h);
    }
}
