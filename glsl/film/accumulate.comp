#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/uint64.glsl"
#include "shared/largest_channel.glsl"
#include "shared/luminance.glsl"
#include "shared/pcg.glsl"

// Adds a batch of samples to the statistics of their pixels: running means and sums of squared deviations (Welford 1962).
// One thread adds the samples of one pixel in order of their index, so that the result does not depend on the batches.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform samplerBuffer samples; // of vec4
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 2) uniform usamplerBuffer light; // of PixelLight
layout(binding = 3) uniform usamplerBuffer offset; // of uvec2
layout(scalar, binding = 4) writeonly buffer Stats { PixelStatsWords folded_stats[]; }; // of PixelStats
layout(scalar, binding = 5) writeonly buffer Lights { PixelLightWords folded_light[]; }; // of PixelLight
layout(scalar, binding = 6) buffer Broken { BrokenTally broken[]; };
layout(scalar, push_constant) uniform Push { FoldPush push; };

#include "shared/first_path.glsl"
#include "shared/loop_limit.glsl"
#include "shared/next_sample.glsl"
#include "shared/sample_marks.glsl"
const uint PLAIN = 2048u; // loop turns before strides: see shared/loop_limit.glsl

// Indirect light of a channel whose albedo is not above this stays with the direct light.
const float MIN_ALBEDO = 1e-6;
// Deviations and sums of their squares are cut here, so that sums over pixels stay finite.
const float MAX_DEVIATION = 1e17, MAX_M2 = 1e35;
// Samples up to which means are rounded to single precision. Later ones move a mean by about its last place or less: what
// rounding takes off is kept (Kahan 1965), or the mean of 2^22 samples would be off by 1e-5 and more. That code takes long to
// compile, and exists only in renders of so many samples (FX_MANY_SAMPLES).
const uint MAX_ROUNDED_SAMPLES = 4096u;
const int BITS = 10, DIRECT_BITS = 5, ALBEDO_BITS = 4; // bits of a mean's remainder per channel

// Returns where a pixel's samples lie in the batch: (first, step, number).
uvec3 samples_of(uint i, uint pixel) {
    if (!FX_ADAPTIVE || push.samples > 0u) return uvec3(i, push.pixels, push.samples);
    uint64_t begin = join64(push.first_path), end = begin + push.paths;
    uint64_t from = max(offset_of(pixel), begin), to = min(offset_of(pixel + 1u), end);
    return uvec3(uint(from - begin), 1u, to > from ? uint(to - from) : 0u);
}

// 2^-bits of the last place of `mean`.
vec3 unit(vec3 mean, int bits) {
    return max(uintBitsToFloat(floatBitsToUint(mean) & 0x7f800000u) * 1.1920928955078125e-7 / float(1 << bits), 1e-37);
}

// Moves a mean by the step `by`. `remainder` holds what rounding has taken off, `bits` for each channel from bit `at` on. It is
// rounded up or down at random, since samples that repeat a value would otherwise all be rounded the same way.
void move_mean(inout vec3 mean, vec3 by, inout uint remainder, int at, int bits, uint count) {
    ivec3 kept;
    [[unroll]] for (int c = 0; c < 3; c++) kept[c] = bitfieldExtract(int(remainder), at + c * bits, bits);
    precise vec3 added = vec3(kept) * unit(mean, bits) + by;
    precise vec3 moved = mean + added;
    precise vec3 lost = added - (moved - mean);
    int end = 1 << (bits - 1);
    precise vec3 rounded = floor(lost / unit(moved, bits) + unit_interval(pcg(count)));
    // A remainder of half the last place or more moves the mean to the next number: cutting it off would bias the mean.
    precise vec3 next = moved + unit(moved, bits) * float(2 * end);
    bvec3 carries = greaterThanEqual(rounded, vec3(end));
    moved = mix(moved, next, carries);
    rounded = mix(rounded, vec3(-end), carries);
    kept = ivec3(clamp(rounded, vec3(-end), vec3(end - 1)));
    [[unroll]] for (int c = 0; c < 3; c++) remainder = bitfieldInsert(remainder, uint(kept[c]), at + c * bits, bits);
    mean = moved;
}

float cut_product(float a, float b) {
    return clamp(a, -MAX_DEVIATION, MAX_DEVIATION) * clamp(b, -MAX_DEVIATION, MAX_DEVIATION);
}

void fold_light(inout PixelLight l, vec3 kept, vec3 albedo, float share, uint count) {
    if (!FX_MANY_SAMPLES || count <= MAX_ROUNDED_SAMPLES) {
        l.direct += (kept - l.direct) * share;
        l.albedo += (albedo - l.albedo) * share;
    } else {
        move_mean(l.direct, (kept - l.direct) * share, l.remainder, 0, DIRECT_BITS, count);
        move_mean(l.albedo, (albedo - l.albedo) * share, l.remainder, 3 * DIRECT_BITS, ALBEDO_BITS, count);
    }
}

// The albedo of sample number `count`. That of one on a way that few take is not noted: the choice of ways would be seen as noise of
// the albedo, which no filter takes. It counts as white, until a sample on another way comes.
vec3 albedo_along(inout PixelLight l, vec3 noted, uint marks, uint count) {
    if (!FX_SMOOTH) return noted;
    bool astray = (marks & ASTRAY) != 0u, others = count > 1u;
    if (others && (astray || (l.remainder & ALL_ASTRAY) != 0u)) {
        if (astray) return l.albedo;
        // What a channel has got already is not to be divided by nothing.
        l.albedo = mix(noted, l.albedo, lessThanEqual(noted, vec3(MIN_ALBEDO)));
    }
    l.remainder = (l.remainder & ~ALL_ASTRAY) | (astray ? ALL_ASTRAY : 0u);
    return noted;
}

// Samples of a pixel show one surface where their albedo is at most so much larger than the mean of those before, and none of them showed
// the sky or a lamp: a mean with their light says nothing of a surface.
const float ONE_SURFACE = 0.75;

// The direct light of sample number `count`. One that passed over the key light counts as the mean of those before it, so that the mean has
// no noise of that choice; or, if all before it did, as the first that does not. `unreflected` are channels that keep all of their light.
vec3 direct_along(inout PixelLight l, vec3 direct, vec3 albedo, bvec3 unreflected, uint marks, uint count) {
    bool may_have_key = FX_POINT || FX_SPOT || FX_DIRECTIONAL; // only lights without extent are such
    if (!FX_SOFT || !may_have_key) return direct;
    bool passed_over = (marks & PASSED_OVER) != 0u, all_before = count == 1u || (l.remainder & ALL_PASSED_OVER) != 0u;
    if (all(unreflected)) l.remainder |= SOME_BARE;
    bool whole = count > 1u && (l.remainder & SOME_BARE) == 0u;
    bool one_surface = whole && largest_channel(l.albedo) > ONE_SURFACE * largest_channel(albedo);
    l.remainder = (l.remainder & ~ALL_PASSED_OVER) | (passed_over && all_before ? ALL_PASSED_OVER : 0u);
    if (!one_surface || passed_over == all_before) return direct;
    if (passed_over) return mix(l.direct, direct, unreflected);
    l.direct = mix(direct, l.direct, unreflected);
    return direct;
}

// Adds the sample at `at`. A negative number of rays marks one that is wrong; `first_broken` is the first one's index.
void fold(inout PixelStats s, inout PixelLight l, inout uint broken_count, inout uint first_broken, int at) {
    vec4 first = texelFetch(samples, FX_SPLIT ? 3 * at : at);
    vec3 radiance = first.rgb;
    if (first.w < 0.0 && broken_count++ == 0u) first_broken = next_sample(s.count, 0u); // the host knows what is carried
    s.count++;
    float share = 1.0 / float(s.count), other = 0.0, off_other = 0.0;
    if (FX_SPLIT) {
        vec3 direct = first.rgb, indirect = texelFetch(samples, 3 * at + 1).rgb;
        vec4 noted = texelFetch(samples, 3 * at + 2);
        uint marks = uint(noted.w);
        vec3 albedo = albedo_along(l, noted.rgb, marks, s.count);
        bvec3 unreflected = lessThanEqual(albedo, vec3(MIN_ALBEDO));
        radiance = direct + indirect;
        direct = direct_along(l, mix(direct, radiance, unreflected), albedo, unreflected, marks, s.count);
        other = luminance(radiance - direct);
        off_other = other - luminance(s.mean - l.direct);
        fold_light(l, direct, albedo, share, s.count);
    }
    vec3 off = radiance - s.mean;
    if (!FX_MANY_SAMPLES || s.count <= MAX_ROUNDED_SAMPLES) s.mean += off * share;
    else move_mean(s.mean, off * share, s.remainder, 0, BITS, s.count);
    vec3 off_moved = radiance - s.mean;
    [[unroll]] for (int c = 0; c < 3; c++) s.m2[c] = min(s.m2[c] + cut_product(off[c], off_moved[c]), MAX_M2);
    if (FX_SPLIT) l.indirect_m2 = clamp(l.indirect_m2 + cut_product(off_other, other - luminance(s.mean - l.direct)), 0.0, MAX_M2);
}

// store_sample has found the lowest pixel with a broken sample; that pixel's thread alone writes which sample it was.
void report(uint pixel, uint broken_count, uint first_broken) {
    if (broken[0].count < 0x80000000u) atomicAdd(broken[0].count, broken_count);
    if (broken[0].lowest != ~pixel || broken[0].pixel == ~pixel) return;
    broken[0].pixel = ~pixel;
    broken[0].index = first_broken;
}

void main() {
    uint i = thread_index();
    if (i >= push.pixels) return;
    uvec3 at_step_count = samples_of(i, push.first_pixel + i);
    uint at = at_step_count.x, step = at_step_count.y, count = at_step_count.z;
    if (count == 0u) return;
    uint pixel = push.first_pixel + i;
    PixelStats s = PixelStats_load(stats, pixel);
    PixelLight l = PixelLight_zero();
    uint broken_count = 0u, first_broken = 0u;
    if (FX_SPLIT) l = PixelLight_load(light, pixel);
    uint plain = FX_ADAPTIVE ? min(count, PLAIN) : count; // else at most SAMPLES_AT_ONCE (src/render/schedule/cut.rs)
    for (uint k = 0u; k < plain; k++) fold(s, l, broken_count, first_broken, int(at + k * step));
    for (uint k = plain; FX_ADAPTIVE && k < count; k += SAMPLES_A_TURN) {
        [[unroll]] for (uint j = 0u; j < SAMPLES_A_TURN; j++) {
            if (k + j < count) fold(s, l, broken_count, first_broken, int(at + (k + j) * step));
        }
    }
    uint place = pixel - push.window;
    folded_stats[place] = PixelStats_words(s);
    if (FX_SPLIT) folded_light[place] = PixelLight_words(l);
    if (broken_count > 0u) report(push.tile + pixel, broken_count, first_broken);
}
