#include "shared/thread.glsl"
#include "shared/luminance.glsl"
#include "shared/sanitise.glsl"
#include "shared/candidates.glsl"

// The blend of the image and the candidates whose mean square of what it misses a left-out pixel by is least, with weights
// of at least 0. From the best one on, pairs trade weight until nothing is gained.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer squares; // of vec4
layout(binding = 1) uniform samplerBuffer products; // of vec4
layout(binding = 2) uniform samplerBuffer others; // of vec4
layout(binding = 3) uniform samplerBuffer square_sum; // of vec4, of all pixels
layout(binding = 4) uniform samplerBuffer product_sum; // of vec4, of all pixels
layout(binding = 5) uniform samplerBuffer other_sum; // of vec4, of all pixels
layout(binding = 6) uniform samplerBuffer colour; // of vec4
layout(binding = 7) uniform usamplerBuffer place; // of uvec4
layout(binding = 8) uniform samplerBuffer wide; // of vec4
layout(binding = 9) uniform samplerBuffer mid; // of vec4
layout(binding = 10) uniform samplerBuffer narrow; // of vec4, of what it gets
layout(binding = 11) uniform samplerBuffer wide_dim; // of vec4, of the same
layout(binding = 12) uniform samplerBuffer svgf; // of vec4
layout(scalar, binding = 13) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

const uint ROUNDS = 4u;     // of trades
const float RIDGE = 0.01;   // of every square, added: weights that the estimates cannot tell apart become alike
const float MAX_ERROR = 1e24;   // above every error
// Of the whole image's errors in those of a pixel, at most. What its surroundings tell is uncertain where few pixels have
// seen light, and what is good elsewhere is rarely bad here.
const float OVERALL = 0.6;

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    int at = int(i);
    vec4 c = texelFetch(colour, at);
    vec4 a = texelFetch(wide, at), b = texelFetch(mid, at), n = texelFetch(narrow, at), d = texelFetch(svgf, at);
    // Errors relative to the light, around the pixel and in the whole image, which count the more the noisier the pixels are.
    // Where anything is known, light is at least 1.
    vec4 here = texelFetch(others, at), all = texelFetch(other_sum, 0);
    float light = max(here.w, 1.0), lights = max(all.w, 1.0), noisy = 0.5 * here.z / light;
    float share = OVERALL * noisy / (1.0 + noisy);
    vec4 square = mix(texelFetch(squares, at) / light, texelFetch(square_sum, 0) / lights, share);
    vec4 product = mix(texelFetch(products, at) / light, texelFetch(product_sum, 0) / lights, share);
    vec4 other = mix(here / light, all / lights, share);
    // What few samples tell of their own variance follows their values: whoever relies on it seems better than it is. Nor is
    // a filter of use that could not in-paint the pixel.
    bool enough = c.w >= ENOUGH;
    bool usable[5] = bool[](enough, a.w > 0.0, b.w > 0.0, n.w > 0.0, enough && d.w > 0.0);
    // An independent copy of the pixel misses it by both copies' noise, and has the pixel's in common with what a filter misses.
    float noise = 0.5 * other.z;
    float missed[5][5] = float[][](
        float[](other.z, noise, noise, noise, noise),
        float[](noise, square.x, product.x, product.y, product.z),
        float[](noise, product.x, square.y, product.w, other.x),
        float[](noise, product.y, product.w, square.z, other.y),
        float[](noise, product.z, other.x, other.y, square.w));
    float w[5] = float[](0.0, 0.0, 0.0, 0.0, 0.0), least = MAX_ERROR;
    int best = 1;
    [[unroll]] for (int k = 0; k < 5; k++) {
        if (usable[k] && missed[k][k] < least) {
            least = missed[k][k];
            best = k;
        }
        missed[k][k] *= 1.0 + RIDGE;
    }
    // Half of what the blend's mean square grows by with each weight.
    float growth[5];
    [[unroll]] for (int k = 0; k < 5; k++) {
        w[k] = k == best ? 1.0 : 0.0;
        [[unroll]] for (int m = 0; m < 5; m++) if (k == best) growth[m] = missed[m][k];
    }
    for (uint round = 0u; round < ROUNDS; round++) {
        // Bounds that do not depend on each other: only loops of those are unrolled, and arrays kept in registers.
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
    // An unknown pixel whose centre meets nothing has no guide to be fitted by.
    bool adrift = usable[1] && c.w == 0.0 && unpacked_normal(texelFetch(place, at).w) == vec3(0.0);
    if (adrift) w = float[](0.0, 1.0, 0.0, 0.0, 0.0);
    vec3 base = c.w > 0.0 ? c.rgb : a.rgb; // differences from it: a constant comes back exactly
    vec3 off = w[1] * (a.rgb - base) + w[2] * (as_light(b.rgb, a.rgb) - base);
    off += w[3] * (whole(n.rgb, a.rgb, texelFetch(wide_dim, at).rgb) - base) + w[4] * (d.rgb - base);
    bool any_usable = usable[0] || usable[1] || usable[2] || usable[3] || usable[4];
    filtered[i] = any_usable ? vec4(base + off, c.w > 0.0 ? c.w : 1.0) : vec4(0.0);
}
