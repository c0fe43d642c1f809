#include "shared/thread.glsl"
#include "shared/albedo.glsl"
#include "shared/luminance.glsl"
#include "shared/sampled_albedo.glsl"
#include "shared/sanitise.glsl"
#include "shared/candidates.glsl"
#include "shared/dominated.glsl"

// Blends five images per pixel and thread: the noisy one and the results of four filters (candidates). The weights are not
// negative, sum to 1, and minimise the mean squared error at left-out pixels that auto_error.comp estimates. Starting from
// the best candidate alone, pairs of candidates exchange weight for ROUNDS rounds (coordinate descent). The blend comes with the
// variance of the pixel's luminance: UNMEASURED where its samples tell none, and UNFILTERED where there is no blend. `expected`
// is its mean squared error over its squared luminance, the share of the variance of samples that is noise, and its own leverage.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer squares; // of vec4
layout(binding = 1) uniform samplerBuffer products; // of vec4
layout(binding = 2) uniform samplerBuffer others; // of vec4
layout(binding = 3) uniform samplerBuffer colour; // of vec4
layout(binding = 4) uniform usamplerBuffer place; // of uvec4
layout(binding = 5) uniform samplerBuffer wide; // of vec4
layout(binding = 7) uniform samplerBuffer narrow; // of vec4, of what it gets
layout(binding = 8) uniform samplerBuffer wide_dim; // of vec4, of the same
layout(binding = 9) uniform samplerBuffer svgf; // of vec4
layout(binding = 10) uniform samplerBuffer variance; // of vec3
layout(binding = 11) uniform samplerBuffer surroundings; // of vec4, of auto_leverage.comp
layout(binding = 12) uniform samplerBuffer leverages; // of vec4, the same, not smoothed
layout(scalar, binding = 13) writeonly buffer Blend { vec4 blend[]; };
layout(scalar, binding = 14) writeonly buffer Expected { vec3 expected[]; };
layout(binding = 15) uniform samplerBuffer estimate; // of vec4
layout(binding = 16) uniform usamplerBuffer guide; // of Guide
layout(binding = 17) uniform samplerBuffer mid; // of vec4
layout(scalar, push_constant) uniform Push { AutoPush push; };

#include "shared/own_variance.glsl"
#include "shared/blurred.glsl"

const uint ROUNDS = 4u;       // of exchanges between all pairs
const float RIDGE = 0.01;     // share added to every squared error: candidates that hardly differ get like weights
// A left-out pixel is missed by its noise at least, so that the best candidate bounds it from above, but for chance: no noise is less
// than this share of what is told.
const float LEAST_NOISE = 0.05;
// From this number of samples on svgf takes part. With it, two samples left Crytek Sponza dark and grained: FLIP .203 in place of .163.
const float ENOUGH_FOR_SVGF = 4.0;
// What one sample has brought is cut to so many times what svgf finds. Such pixels are few among those whose noise their neighbours
// tell to be small, so that the image itself seems best for them: two of them were nine tenths of relMSE on Veach's plates. A pixel that
// is darker than the blend has brought it no light, however much of its own is of one sample: cut as well, such pixels were black specks.
const float OF_ONE_SAMPLE = 3.0;
// From this number of samples on: of fewer, one often brings most.
const float ENOUGH_TO_TELL_ONE = 8.0;
// From this number of samples on, what like pixels tell of a pixel's noise counts beside its own samples: where those are all dark by
// chance, what a right blend gives it would be taken away again, and rooms lit through a gap had black holes. With fewer samples too little
// is left that is certain (Veach's plates at 2: relMSE .046 in place of .035), and lamps out of focus are dark beside for sure (.27 in
// place of .21 at 4).
const float ENOUGH_TO_DOUBT = 4.0;
const int NEAR = 1; // pixels from one that a lens blurs within which no lamp or sky may be, for like pixels to count there
const float MAX_ERROR = 1e24; // is above every error

// Mean products of what left-out pixels are missed by. An independent copy of the pixel misses it by the noise of both, and shares the
// pixel's own noise with every filter's error.
float[5][5] mean_products(vec4 square, vec4 product, vec4 other, float noise) {
    float unseen = optimism_of(noise);
    product.z += unseen;
    other.xy += unseen;
    square.w += 2.0 * unseen;
    return float[][](
        float[](2.0 * noise, noise, noise, noise, noise + unseen),
        float[](noise, square.x, product.x, product.y, product.z),
        float[](noise, product.x, square.y, product.w, other.x),
        float[](noise, product.y, product.w, square.z, other.y),
        float[](noise + unseen, product.z, other.x, other.y, square.w));
}

// Moves weight between pairs where that lessens the error. `growth` is half the derivative of the blend's mean squared error by each
// weight.
void exchange(inout float w[5], inout float growth[5], float missed[5][5], bool usable[5]) {
    for (uint round = 0u; round < ROUNDS; round++) {
        // The loops' bounds do not depend on each other: only then are they unrolled, and the arrays stay in registers.
        [[unroll]] for (int j = 0; j < 5; j++) {
            [[unroll]] for (int k = 0; k < 5; k++) {
                if (j >= k) continue;
                float bend = missed[j][j] + missed[k][k] - 2.0 * missed[j][k], gain = growth[k] - growth[j];
                float moved = bend > 0.0 && usable[j] && usable[k] ? clamp(gain / bend, -w[j], w[k]) : 0.0;
                w[j] += moved;
                w[k] -= moved;
                [[unroll]] for (int m = 0; m < 5; m++) growth[m] += moved * (missed[m][j] - missed[m][k]);
            }
        }
    }
}

// Whether a pixel shows a surface that reflects light.
bool shaded(int i) {
    return Guide_object(guide, i) != NONE && reflects(sampled_albedo(i, texelFetch(colour, i).w, Guide_albedo(guide, i)));
}

// Whether what like pixels tell of noise counts. Where a lens blurs lamps or shows an empty sky it does not: pixels beside those are dark
// for sure though a few samples of like ones are bright. What it blurs of shaded surfaces is dark by chance, and had black specks without.
bool tell_like_pixels(int at) {
    if (!blurred(at)) return true;
    ivec2 size = ivec2(push.size), p = ivec2(at % size.x, at / size.x);
    ivec2 first = max(p - NEAR, ivec2(0)), last = min(p + NEAR, size - 1);
    bool all_shaded = true;
    for (int y = first.y; y <= last.y; y++) {
        for (int x = first.x; x <= last.x; x++) all_shaded = all_shaded && shaded(y * size.x + x);
    }
    return all_shaded;
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    int at = int(i);
    vec4 c = texelFetch(colour, at);
    vec4 a = texelFetch(wide, at), b = texelFetch(mid, at), n = texelFetch(narrow, at), d = texelFetch(svgf, at);
    // Errors were divided by light and noise in auto_error.comp. Over light alone the errors that `auto` expects would be up to 15 % larger
    // in six scenes, and they are up to four times too large already.
    vec4 square = texelFetch(squares, at), product = texelFetch(products, at), other = texelFetch(others, at);
    vec4 found = texelFetch(surroundings, at);
    // The variance of few samples depends on their values, so that candidates which use it (the image and svgf) would seem
    // better than they are. A filter that could not in-paint the pixel is of no use either.
    bool enough = c.w >= ENOUGH;
    bool usable[5] = bool[](enough, a.w > 0.0, b.w > 0.0, n.w > 0.0, c.w >= ENOUGH_FOR_SVGF && d.w > 0.0);
    float told = 0.5 * other.z, noise = max(min(told, min(min(square.x, square.y), min(square.z, square.w))), LEAST_NOISE * told);
    float missed[5][5] = mean_products(square, product, other, noise);
    float w[5] = float[](0.0, 0.0, 0.0, 0.0, 0.0), least = MAX_ERROR;
    int best = 1;
    [[unroll]] for (int k = 0; k < 5; k++) {
        if (usable[k] && missed[k][k] < least) {
            least = missed[k][k];
            best = k;
        }
        missed[k][k] *= 1.0 + RIDGE;
    }
    float growth[5];
    [[unroll]] for (int k = 0; k < 5; k++) {
        w[k] = k == best ? 1.0 : 0.0;
        [[unroll]] for (int m = 0; m < 5; m++) if (k == best) growth[m] = missed[m][k];
    }
    exchange(w, growth, missed, usable);
    // What left-out pixels tell, without their noise and the ridge; at least the noise that a filter of such leverages keeps.
    float square_of_blend = 0.0;
    [[unroll]] for (int k = 0; k < 5; k++) square_of_blend += w[k] * (growth[k] - w[k] * missed[k][k] * RIDGE / (1.0 + RIDGE));
    vec4 around = leverages_of(found, push.shares), own = leverages_of(texelFetch(leverages, at), push.shares);
    vec4 of_filters = vec4(w[1], w[2], w[3], w[4]);
    float error = max(square_of_blend - noise, clamp(w[0] + dot(of_filters, around), 0.0, 1.0) * noise);
    float kept = clamp(w[0] + dot(of_filters, clamp(max(own, around), 0.0, 1.0)), 0.0, 1.0);
    expected[i] = vec3(error, told > 0.0 ? noise / told * share_of_noise(found) : 1.0, kept);
    // An unknown pixel whose centre ray meets nothing has no guide for the fits: the widest window fills it.
    bool adrift = usable[1] && c.w == 0.0 && unpacked_normal(texelFetch(place, at).w) == vec3(0.0);
    if (adrift) w = float[](0.0, 1.0, 0.0, 0.0, 0.0);
    vec3 base = c.w > 0.0 ? c.rgb : a.rgb; // differences from it are blended, so that a constant image stays exact
    vec3 off = w[1] * (a.rgb - base) + w[2] * (as_light(b.rgb, a.rgb) - base);
    off += w[3] * (whole_light(n.rgb, a.rgb, texelFetch(wide_dim, at).rgb) - base) + w[4] * (d.rgb - base);
    bool any_usable = usable[0] || usable[1] || usable[2] || usable[3] || usable[4];
    vec3 all = base + off;
    float of_mean = own_variance(at, c.w), bright = luminance(all), most = OF_ONE_SAMPLE * max(luminance(d.rgb), 0.0);
    bool dominated = usable[4] && c.w >= ENOUGH_TO_TELL_ONE && of_mean >= 0.0 && sqrt(of_mean) > DOMINATED * abs(luminance(c.rgb));
    if (dominated && bright > most && luminance(c.rgb) >= bright) all *= most / bright;
    bool doubted = of_mean >= 0.0 && c.w >= ENOUGH_TO_DOUBT && tell_like_pixels(at);
    blend[i] = any_usable ? vec4(all, doubted ? max(of_mean, texelFetch(estimate, at).w) : of_mean) : vec4(vec3(0.0), UNFILTERED);
}
