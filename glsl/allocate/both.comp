#include "shared/thread.glsl"

// Computes the priority of ROWS pixels of a column per thread, a stride apart (they share most of their neighbours, which are a
// stride apart too), from the pixel statistics and the words of likeness.comp. The priority is the noise of the samples, estimated
// over the neighbours that look alike, less what a geometry-aware filter will remove. A filter that gathers a share W of its
// window is taken to remove the share `filtered` * W of the variance of indirect light, which is all that it filters. The deviation
// that remains needs samples. While the noise is unknown, geometry alone decides.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform usamplerBuffer words; // of float
layout(scalar, binding = 2) writeonly buffer Priorities { float priority[]; };
layout(binding = 3) uniform usamplerBuffer light; // of PixelLight
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/likeness_bits.glsl"
#include "shared/pixel_noise.glsl"
const float MIN_LEFT = 0.01;      // two pixels leave at least 0.27, so that less is rounding
const float MAX_DEVIATION = 1e17; // differences of means are cut here, so that their squares are finite
const float MAX_TINT = 100.0;     // indirect light's colour over its luminance, per channel

const int ROWS = 4;

// Weighted sums over the pixels around one.
struct Surroundings {
    vec4 around;    // of `moments`
    vec4 offsets;   // of the means less the centre's mean; w: of the weights
    float squares;  // of the squared offsets
    float weights;  // of the squared weights
    float freedom;  // of weight / samples
    float indirect; // of the squared deviations of indirect light, as `around.x` holds those of all light
};

// Sum of squared deviations of indirect light (mean over channels), computed from those of its luminance. It assumes that every
// sample has the colour of the pixel's mean. The covariance of direct and indirect light counts as direct.
float indirect_squares(uint pixel, vec3 mean, float squares) {
    PixelLight l = PixelLight_load(light, pixel);
    vec3 indirect = abs(mean - l.direct); // a key light leaves negative light beside it
    float level = luminance(indirect);
    vec3 tint = level > 0.0 ? min(indirect / level, vec3(MAX_TINT)) : vec3(0.0);
    return min(l.indirect_m2 * dot(tint, tint) / 3.0, squares);
}

// Adds a pixel of weight `kin`. `mean` is its mean less that of the centre: squares of such small numbers keep their digits.
void merge(inout Surroundings s, float kin, vec4 m, float indirect, vec3 mean) {
    mean = clamp(mean, -MAX_DEVIATION, MAX_DEVIATION);
    s.around += kin * m;
    s.indirect += kin * indirect;
    s.offsets += kin * vec4(mean, 1.0);
    s.squares += kin * dot(mean, mean);
    s.weights += kin * kin;
    s.freedom += kin / max(m.w, 1.0);
}

// Adds the spread of the means. Pixels that look alike should be equally bright, so that the spread of their means is noise
// too; after one sample per pixel it is all that shows noise. It has weight 1 / n for n samples, because the part of the
// spread that is not noise grows with n.
vec4 with_means(Surroundings s) {
    // The share of the variance that remains once the mean is subtracted: 0 for one pixel, up to rounding.
    float count = s.offsets.w, left = 1.0 - s.weights / (count * count);
    float apart = max(s.squares - dot(s.offsets.rgb, s.offsets.rgb) / count, 0.0) / 3.0;
    return s.around + (count > 0.0 && left > MIN_LEFT ? vec4(apart, s.freedom * left, 0.0, 0.0) : vec4(0.0));
}

void main() {
    ivec2 size = ivec2(push.size);
    int stride = int(push.stride), thread = int(thread_index()), x = thread % size.x, run = thread / size.x;
    int first = run / stride * ROWS * stride + run % stride;
    if (first >= size.y) return;
    uint word[ROWS];
    vec4 own[ROWS];
    vec3 mean[ROWS];
    Surroundings s[ROWS];
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        int i = min(first + k * stride, size.y - 1) * size.x + x;
        word[k] = texelFetch(words, i).x;
        own[k] = moments(uint(i), mean[k]);
        s[k] = Surroundings(vec4(0.0), vec4(0.0), 0.0, 0.0, 0.0, 0.0);
    }
    [[unroll]] for (int row = -1; row <= ROWS; row++) {
        for (int column = -1; column <= 1; column++) {
            ivec2 at = ivec2(x, first) + ivec2(column, row) * stride, q = clamp(at, ivec2(0), size - 1);
            vec3 their_mean;
            uint pixel = uint(q.y * size.x + q.x);
            vec4 m = moments(pixel, their_mean);
            float indirect = indirect_squares(pixel, their_mean, m.x);
            float known = at == q && m.w > 0.0 ? 1.0 : 0.0;
            [[unroll]] for (int k = 0; k < ROWS; k++) { // constant bounds, or it would not be unrolled
                if (abs(row - k) <= 1) {
                    float kin = known * kinship_of(word[k], 3 * (row - k) + column + 4);
                    merge(s[k], kin, m, indirect, their_mean - mean[k]);
                }
            }
        }
    }
    [[unroll]] for (int k = 0; k < ROWS; k++) {
        // All noise counts as indirect while it is unknown.
        float indirect = s[k].around.x > 0.0 ? s[k].indirect / s[k].around.x : 1.0;
        float left = sqrt(max(1.0 - push.filtered * gathered_of(word[k]) * indirect, 0.0));
        int y = first + k * stride;
        if (y < size.y) priority[y * size.x + x] = noise(own[k], with_means(s[k])) * left;
    }
}
