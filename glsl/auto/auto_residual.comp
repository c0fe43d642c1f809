#include "shared/edge.glsl"
#include "shared/atrous_taps.glsl"
#include "shared/luminance.glsl"
#include "shared/candidates.glsl"

// Gives back what the blend has lost: where its mean difference from the noisy pixels around is more than their noise explains, the
// rest of the difference is added (twicing: Tukey 1977; soft threshold: Donoho 1995). Windows of like pixels, of 7x7, 3x3 and one
// pixel, follow each other. A blend that fits the pixels stays as it is. Pixels at edges may show several surfaces, and get light
// between those. A thread takes ROWS pixels of a column.
layout(local_size_x_id = 100) in;
#include "shared/packed_pixels.glsl"
layout(binding = 2) uniform samplerBuffer estimate; // of vec4
layout(binding = 3) uniform samplerBuffer others; // of vec4
layout(binding = 4) uniform samplerBuffer blend; // of vec4, of auto.comp
layout(binding = 5) uniform usamplerBuffer guide; // of Guide
layout(scalar, binding = 6) writeonly buffer Output { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { AutoPush push; };

#include "shared/blurred.glsl"

const int REACH = 3; // pixels from the centre to the border of the largest window
const float SIGNIFICANT = 3.0; // standard deviations that noise explains
// The relative variance of the surroundings counts as that of this many samples. Where all samples are dark, their own variance
// says nothing of the bright ones that may have been missed by chance.
const float PRIOR_SAMPLES = 4.0;
// With fewer known pixels in the largest window all may be bright by chance: light is then kept from being negative alone.
const int ENOUGH_PIXELS = 16;
const float ENOUGH_SAMPLES = 16.0; // of a window: fewer may all be dark by chance
// Where neighbours of a pixel differ by a light D, the variance of what it shows of them is of the order of D^2 / NARROW.
const float NARROW = 4.0;

// Sums over the like pixels of a window.
struct Window {
    vec3 residual;
    float total;   // weights
    float squares; // their squares
    float count;   // samples
    float variance; // of a pixel
};

const Window NO_WINDOW = Window(vec3(0.0), 0.0, 0.0, 0.0, 0.0);

// A pixel of windows, and what the blend has lost of it.
struct Tap {
    Pixel pixel;
    vec3 blended;
    vec3 residual;
    float variance;
    bool counts;
    bool known;
};

Tap tap_at(ivec2 at) {
    ivec2 size = ivec2(push.size), inside = clamp(at, ivec2(0), size - 1);
    int i = inside.y * size.x + inside.x;
    vec4 blended = texelFetch(blend, i);
    float variance = blended.w >= 0.0 ? blended.w : max(texelFetch(estimate, i).w, 0.0);
    Pixel q = pixel_at(i);
    bool exists = at == inside;
    return Tap(q, blended.rgb, q.colour.rgb - blended.rgb, variance, exists && blended.w != UNFILTERED, exists && q.colour.w > 0.0);
}

void add(inout Window sum, Tap tap, float w) {
    float count = tap.pixel.colour.w;
    sum.residual += w * tap.residual;
    sum.total += w;
    sum.squares += w * w;
    sum.count += w * count;
    sum.variance += w * count * tap.variance;
}

// What of a window's mean residual, `given` of which is given back already, is more than noise. `prior` is the variance of one
// sample by the surroundings.
vec3 significant(Window sum, vec3 given, float prior) {
    if (sum.count < ENOUGH_SAMPLES) return vec3(0.0);
    vec3 residual = sum.residual / sum.total - given;
    // Variance of a pixel of mean count.
    float variance = (sum.variance + PRIOR_SAMPLES * prior * sum.total / sum.count) / (sum.count + PRIOR_SAMPLES);
    float noise = SIGNIFICANT * sqrt(variance * sum.squares) / sum.total, off = abs(contrast(residual, vec3(0.0)));
    return off > noise ? residual * (1.0 - noise / off) : vec3(0.0);
}

// A pixel that is darker than its blend may have missed light by chance, of which its own variance tells nothing: it counts as no less noisy
// than like pixels around are on average.
Window doubted(Window own, vec3 given, Window wide) {
    bool darker = contrast(own.residual / max(own.total, 1e-20), given) < 0.0;
    if (darker) own.variance = max(own.variance, own.count * wide.variance / max(wide.count, 1e-20));
    return own;
}

// The range of light that a pixel's blend and those of the other surfaces beside it have.
struct Edge {
    vec3 own;
    vec3 low;
    vec3 high;
};

// A neighbour counts as much as it is another surface.
void add(inout Edge edge, vec3 blended, float alike) {
    vec3 other = mix(blended, edge.own, alike);
    edge.low = min(edge.low, other);
    edge.high = max(edge.high, other);
}

// A pixel that shows several surfaces has their lights by what it shows of each, times their albedos: something between them, which
// no filter of one surface finds. The pixel itself tells it the better, the less its `noise` is beside the range (Wiener 1949).
vec3 at_edge(vec3 light, vec3 pixel, Edge edge, float noise) {
    float apart = contrast(edge.high, edge.low), varies = apart * apart;
    vec3 between = clamp(pixel, min(edge.low, light), max(edge.high, light));
    return varies > 0.0 ? light + varies / (varies + NARROW * noise) * (between - light) : light;
}

// The pixel's light with what its windows, from the widest on, give back.
vec4 with_residual(int i, Pixel p, vec4 blended, Window windows[3], vec3 least, Edge edge) {
    float count = p.colour.w;
    vec3 light = max(blended.rgb, least);
    if (count == 0.0 || blended.w == UNFILTERED) return vec4(light, blended.w == UNFILTERED ? 0.0 : 1.0);
    vec4 other = texelFetch(others, i);
    float level = max(abs(contrast(blended.rgb, vec3(0.0))), push.floor);
    float prior = 0.5 * other.z / max(other.w, 1e-20) * level * level * count;
    vec3 given = significant(windows[0], vec3(0.0), prior);
    // An estimate over 7x7 pixels tells nothing of smaller windows.
    if (blended.w >= 0.0) {
        given += significant(windows[1], given, prior);
        given += significant(doubted(windows[2], given, windows[0]), given, prior);
    }
    light = max(blended.rgb + given, least);
    if (blurred(i)) return vec4(light, count); // has no edges
    return vec4(at_edge(light, p.colour.rgb, edge, max(max(texelFetch(estimate, i).w, blended.w), 0.0)), count);
}

void main() {
    ivec2 size = ivec2(push.size);
    int x = int(gl_GlobalInvocationID.x), first = first_row(int(gl_GlobalInvocationID.y), 1);
    if (x >= size.x || first >= size.y) return;
    Pixel p[ROWS];
    Window wide[ROWS], near[ROWS];
    // No light becomes less than the least of the noisy pixels around: linear fits overshoot into the dark beside bright edges.
    vec3 least[ROWS];
    int known[ROWS];
    Edge edge[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        int at = min(first + k, size.y - 1) * size.x + x;
        p[k] = pixel_at(at);
        vec3 blended = texelFetch(blend, at).rgb;
        edge[k] = Edge(blended, blended, blended);
        wide[k] = near[k] = NO_WINDOW;
        least[k] = vec3(LARGEST);
        known[k] = 0;
    }
    // Tested at its end: see shared/traverse.glsl.
    int i = -REACH;
    do {
        [[unroll]] for (int j = -REACH; j < ROWS + REACH; j++) {
            Tap tap = tap_at(ivec2(x + i, first + j));
            [[unroll]] for (int k = 0; k < ROWS; k++) { // constant bounds, or it would not be unrolled
                if (abs(j - k) <= REACH) {
                    float w = tap.counts ? edge_weight(tap.pixel, edge_exponent(p[k], tap.pixel, push.rates)) : 0.0;
                    add(wide[k], tap, w);
                    if (tap.known) least[k] = min(least[k], tap.pixel.colour.rgb);
                    known[k] += int(tap.known);
                    if (abs(j - k) <= 1) {
                        add(near[k], tap, abs(i) <= 1 ? w : 0.0);
                        if (abs(i) <= 1 && tap.counts && tap.known) add(edge[k], tap.blended, w);
                    }
                }
            }
        }
    } while (++i <= REACH);
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        int row = min(first + k, size.y - 1), at = row * size.x + x;
        if (known[k] < ENOUGH_PIXELS) least[k] = min(least[k], vec3(0.0));
        Window own = NO_WINDOW;
        add(own, tap_at(ivec2(x, row)), 1.0);
        vec4 result = with_residual(at, p[k], texelFetch(blend, at), Window[](wide[k], near[k], own), least[k], edge[k]);
        if (first + k < size.y) filtered[at] = result;
    }
}
