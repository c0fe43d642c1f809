#include "shared/thread.glsl"
#include "shared/noisy.glsl"
#include "shared/albedo.glsl"
#include "shared/luminance.glsl"
#include "shared/gloss_cell.glsl"

// Takes one pixel per thread of a noisy image apart for a filter: colour = sharp + factor * filtered, where `sharp` is not
// filtered and `filtered` is light before albedo. Twin: denoise::twin::demodulate.
layout(local_size_x = 64) in;
const uint LIGHT = 0u, ALBEDO = 1u; // values of denoise::Demodulation
layout(constant_id = 110) const uint DEMODULATION = LIGHT;
layout(constant_id = 112) const bool INDIRECT_VARIANCE = true; // LIGHT: indirect_m2 is known
layout(constant_id = 113) const bool MEASURED = true; // any variance of what is filtered is known
layout(constant_id = 116) const bool LENS = false; // what the lens blurs is filtered as it is
layout(constant_id = 117) const bool GLOSS = false; // LIGHT: light that does not follow albedo is not divided by it
layout(scalar, binding = 3) writeonly buffer Radiance { vec4 radiance[]; };
layout(scalar, binding = 4) writeonly buffer Variance { vec3 variance[]; };
layout(scalar, binding = 5) writeonly buffer Factor { vec4 factor[]; };
layout(scalar, binding = 6) writeonly buffer Sharp { vec4 sharp[]; };
layout(binding = 7) uniform samplerBuffer blur; // of float, where the lens counts: how far it blurs what a pixel shows
layout(binding = 8) uniform samplerBuffer gloss; // of vec4, a cell: see gloss.comp
layout(scalar, push_constant) uniform Push { SizePush push; };

// A pixel with more than this many times its neighbours' median light may partly show something without albedo.
const float OUTLIER = 2.0;
const float MIRRORED = 0.6; // 6 of 9 pixels, which the rim of a mirror has around it

struct Parts {
    vec3 filtered;
    vec3 factor;
    vec3 sharp;
};

bool sampled(int i) { return count_at(i) > 0.0 && finite(colour_at(i)); }

const int AROUND = 2; // pixels; the weights have a standard deviation of one

// Whether pixel `q` tells how the key light shines on the surface that `i` shows.
bool tells_key_light(int q, int i) {
    return sampled(q) && !marked(q, ALL_PASSED_OVER | SOME_BARE) && reflects(albedo_at(q)) && one_surface(q, i);
}

// Direct light. Where all samples passed over the key light, the pixels around tell what it brings.
vec3 direct_at(int i) {
    vec3 own = PixelLight_direct(light, i);
    if (!passed_over(i)) return own;
    ivec2 size = ivec2(push.size), at = ivec2(i % size.x, i / size.x);
    const int side = 2 * AROUND + 1;
    vec4 sum = vec4(0.0);
    for (int k = 0; k < side * side; k++) {
        ivec2 off = ivec2(k % side, k / side) - AROUND, tap = at + off;
        if (any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, size))) continue;
        int q = tap.y * size.x + tap.x;
        if (!tells_key_light(q, i)) continue;
        float weight = exp(-0.5 * float(off.x * off.x + off.y * off.y));
        sum += weight * vec4(number(PixelLight_direct(light, q) / divisor(albedo_at(q))), 1.0);
    }
    return own + max(number(albedo_at(i)), vec3(0.0)) * sum.rgb / max(sum.w, 1e-20);
}

// The albedo that the light of a pixel follows: of the share that does not follow it, the mean around stands for it. Cells around tell both, those
// whose middle shows the same surface and material. What a channel does not reflect stays so.
vec3 followed_albedo(int i, vec3 albedo) {
    if (!GLOSS || !tells_albedo(i)) return albedo;
    vec2 between = vec2(i % int(push.size.x) - GLOSS_CELL / 2, i / int(push.size.x) - GLOSS_CELL / 2) / float(GLOSS_CELL);
    ivec2 first = ivec2(floor(between)), grid = gloss_cells_of(push.size);
    vec2 part = between - vec2(first);
    vec4 sum = vec4(0.0);
    float weights = 0.0;
    for (int k = 0; k < 4; k++) {
        ivec2 corner = ivec2(k & 1, k >> 1), cell = clamp(first + corner, ivec2(0), grid - 1);
        vec4 told = texelFetch(gloss, cell.y * grid.x + cell.x);
        if (!connected(middle_of(cell, push.size), i) || !one_material(told.rgb, albedo)) continue;
        vec2 near = mix(1.0 - part, part, vec2(corner));
        sum += near.x * near.y * vec4(told.w * told.rgb, told.w);
        weights += near.x * near.y;
    }
    sum /= max(weights, 1e-20);
    return mix(vec3(0.0), albedo * (1.0 - sum.w) + sum.rgb, greaterThan(albedo, vec3(0.0)));
}

// The albedo that light is divided by and multiplied with is that of the samples, so that edges and textures keep their
// antialiasing: a pixel that shows a surface in part has a part of its albedo.
Parts split_light(int i) {
    vec3 factor = followed_albedo(i, max(number(albedo_at(i)), vec3(0.0))), direct = direct_at(i);
    return Parts(number((colour_at(i) - direct) / factor), factor, number(direct));
}

// Whether the pixel lies at the rim of something brighter that reflects nothing and shows a part of it: it has less albedo than
// another neighbour or, where albedo is that of pixel centres, is far brighter than most neighbours.
bool is_rim(int i, vec3 colour, vec3 albedo) {
    ivec2 size = ivec2(push.size), at = ivec2(i % size.x, i / size.x);
    float bright = largest(colour), own = largest(albedo), others[8];
    int count = 0;
    bool outshone = false, partly = false;
    for (int k = 0; k < 9; k++) {
        ivec2 tap = at + ivec2(k % 3, k / 3) - 1;
        if (k == 4 || any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, size))) continue;
        int q = tap.y * size.x + tap.x;
        float their_albedo = largest(albedo_at(q)), their_light = largest(colour_at(q));
        partly = partly || own < WHOLE * their_albedo;
        if (their_albedo <= SMALLEST_ALBEDO) {
            outshone = outshone || their_light > bright;
            continue;
        }
        int place = count++; // insertion keeps them in order
        for (; place > 0 && others[place - 1] > their_light; place--) others[place] = others[place - 1];
        others[place] = their_light;
    }
    float median = count > 0 ? others[count / 2] : 0.0;
    return outshone && (bright > OUTLIER * median || partly);
}

// Of hits without albedo: x is 1 where the pixel is noisy, y where it is noisy or black. Few samples of glass may all be black.
ivec2 without_albedo(int i) {
    if (reflects(albedo_at(i)) || !(Guide_depth(guide, i) > 0.0)) return ivec2(0);
    bool noisy = largest(PixelStats_m2(stats, i)) > 0.0;
    return ivec2(noisy, noisy || largest(colour_at(i)) == 0.0);
}

// Whether a pixel shows a mirror or clear glass: it has no albedo and is noisy or black, and so are MIRRORED of the pixels around
// it that the image has, one of them noisy. Lamps have no noise but at their rims, which are thin.
bool is_mirror(int i) {
    if (without_albedo(i).y == 0) return false;
    ivec2 size = ivec2(push.size), at = ivec2(i % size.x, i / size.x), alike = ivec2(0);
    int count = 0;
    for (int k = 0; k < 9; k++) {
        ivec2 tap = at + ivec2(k % 3, k / 3) - 1;
        if (any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, size))) continue;
        alike += without_albedo(tap.y * size.x + tap.x);
        count++;
    }
    return alike.x > 0 && float(alike.y) > MIRRORED * float(count);
}

// For a pixel of lamps or sky without a sample: the mean of the pixels around that show some.
vec3 light_around(int i) {
    ivec2 size = ivec2(push.size), at = ivec2(i % size.x, i / size.x);
    vec3 sum = vec3(0.0);
    float count = 0.0;
    for (int k = 0; k < 49; k++) {
        ivec2 tap = at + ivec2(k % 7, k / 7) - 3;
        if (any(lessThan(tap, ivec2(0))) || any(greaterThanEqual(tap, size))) continue;
        int q = tap.y * size.x + tap.x;
        if (!sampled(q) || reflects(albedo_at(q))) continue;
        sum += colour_at(q);
        count += 1.0;
    }
    return number(sum / max(count, 1.0));
}

// Lamps, sky and the pixels at their rims are not filtered: a rim's light divided by its small albedo would be far brighter
// than its surroundings. What mirrors and clear glass show is filtered as it is.
Parts split_albedo(int i) {
    vec3 colour = colour_at(i), albedo = albedo_at(i);
    bool own = sampled(i);
    if (is_mirror(i)) return Parts(colour, vec3(1.0), vec3(0.0));
    if (!reflects(albedo)) return Parts(vec3(0.0), vec3(0.0), own ? colour : light_around(i));
    if (own && is_rim(i, colour, albedo)) return Parts(vec3(0.0), vec3(0.0), colour);
    vec3 factor = divisor(albedo);
    for (int c = 0; c < 3; c++) if (albedo[c] == 0.0 && colour[c] == 0.0) factor[c] = 0.0;
    return Parts(number(colour / factor), factor, vec3(0.0));
}

Parts demodulated(int i) {
    if (DEMODULATION == LIGHT) return split_light(i);
    if (DEMODULATION == ALBEDO) return split_albedo(i);
    return Parts(colour_at(i), vec3(1.0), vec3(0.0));
}

float blur_at(int i) { return LENS ? texelFetch(blur, i).r : 0.0; }

// Through a lens, textures and shadows that are out of focus are smooth, and their noise is that of the samples: the share that is blurred
// is filtered with all other light.
Parts blurred(Parts p, int i) {
    float share = blur_at(i);
    p.sharp *= 1.0 - share;
    p.factor = mix(p.factor, vec3(1.0), share);
    p.filtered = number((colour_at(i) - p.sharp) / p.factor);
    return p;
}

// Nothing is known of the light in a channel that a surface does not reflect: it is taken for the mean of the others. Were it 0, white
// beside pure red would become red in a filter.
vec3 with_unreflected(vec3 light, vec3 factor) {
    bvec3 reflected = greaterThan(factor, vec3(0.0));
    vec3 known = vec3(reflected), there = mix(vec3(0.0), light, reflected);
    float mean = (there.r + there.g + there.b) / max(known.r + known.g + known.b, 1.0);
    return mix(vec3(mean), light, reflected); // a choice, and exact
}

// Of the pixel's mean, per channel.
vec3 variance_of_colour(int i, float count) {
    float freedom = count > 1.0 ? count * (count - 1.0) : 0.0;
    vec3 m2 = PixelStats_m2(stats, i);
    return OF_FILE ? m2 : freedom > 0.0 ? m2 / freedom : vec3(0.0);
}

// Variance of the pixel's mean, per channel. That of indirect light is known for its luminance: samples of one pixel count as
// having one colour. In files that lack it, the variance of all light stands for it: without any, `auto` had 1.04 to 4.8 times
// the error.
vec3 variance_of_filtered(int i, Parts p, float count) {
    vec3 factor = p.factor;
    if (DEMODULATION == LIGHT && INDIRECT_VARIANCE) {
        float of_mean = count > 1.0 ? PixelLight_indirect_m2(light, i) / (count * (count - 1.0)) : 0.0;
        vec3 other = colour_at(i) - (LENS ? direct_at(i) : p.sharp);
        vec3 deviation = (LENS ? other : p.filtered) * number(sqrt(of_mean) / luminance(abs(other)));
        if (LENS) deviation = number(mix(deviation, sqrt(variance_of_colour(i, count)), blur_at(i)) / factor);
        return deviation * deviation;
    }
    return mix(vec3(0.0), variance_of_colour(i, count) / (factor * factor), greaterThan(factor, vec3(0.0)));
}

// What of the colour's variance is not that of what is filtered, mean over channels.
float variance_of_sharp(int i, vec3 filtered, float count) {
    vec3 rest = max(number(variance_of_colour(i, count) - filtered), vec3(0.0));
    return (rest.r + rest.g + rest.b) / 3.0;
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    float count = count_at(int(i));
    Parts p = demodulated(int(i));
    if (LENS) p = blurred(p, int(i));
    // Pixels whose filtered part is not used get count 0, so that they do not reach others.
    bool known = finite(colour_at(int(i))) && any(greaterThan(p.factor, vec3(0.0)));
    if (DEMODULATION == LIGHT) known = known && finite(PixelLight_direct(light, int(i)));
    p.filtered = with_unreflected(p.filtered, p.factor);
    radiance[i] = vec4(p.filtered, known ? count : 0.0);
    float rest = 0.0;
    if (MEASURED) {
        vec3 of_filtered = variance_of_filtered(int(i), p, count);
        variance[i] = with_unreflected(of_filtered, p.factor);
        rest = variance_of_sharp(int(i), p.factor * p.factor * of_filtered, count);
    }
    factor[i] = vec4(p.factor, rest);
    sharp[i] = vec4(p.sharp, 0.0);
}
