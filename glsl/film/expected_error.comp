#include "shared/finite.glsl"

// Adds up what relMSE an image is expected to have before and after a filter that estimates its own errors, and the pixels that
// have samples, one workgroup per PIXELS of them. The error behind the filter is estimated twice: by what the filter says of left-out
// pixels, and by Stein's unbiased estimate of risk (1981), whose excess over the first is the third sum. Twin: denoise::expected::reference.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer radiance; // of vec4
layout(binding = 1) uniform samplerBuffer filtered; // of vec4
layout(binding = 2) uniform samplerBuffer factor; // of vec4
layout(binding = 3) uniform samplerBuffer variance; // of vec3
layout(binding = 4) uniform samplerBuffer picture; // of vec4
layout(binding = 5) uniform samplerBuffer expected; // of vec3
layout(scalar, binding = 6) writeonly buffer Sums { vec4 sums[]; };
layout(scalar, push_constant) uniform Push { SizePush push; };

#include "shared/variance_at.glsl"

const uint THREADS = 64u, EACH = 64u;
const float EPSILON = 0.01; // of relMSE, image::metrics

shared vec4 shares[THREADS];

// What is not filtered, over the factor where there is any.
vec3 sharp_at(int i) {
    vec3 f = texelFetch(factor, i).rgb, sharp = texelFetch(picture, i).rgb - f * texelFetch(filtered, i).rgb;
    return mix(sharp, sharp / f, greaterThan(f, vec3(0.0)));
}

// Variance of what is not filtered, mean over channels: that of its samples, and at most that of 3x3 pixels. Samples that are
// stratified over lamps have far less noise than their variance tells.
float noise_of_sharp(ivec2 at, int i, float of_samples) {
    ivec2 size = ivec2(push.size);
    vec3 sum = vec3(0.0), squares = vec3(0.0), centre = sharp_at(i), f = texelFetch(factor, i).rgb;
    for (int k = 0; k < 9; k++) {
        ivec2 tap = clamp(at + ivec2(k % 3, k / 3) - 1, ivec2(0), size - 1);
        vec3 off = sharp_at(tap.y * size.x + tap.x) - centre;
        sum += off;
        squares += off * off;
    }
    vec3 around = (squares - sum * sum / 9.0) / 8.0 * mix(vec3(1.0), f * f, greaterThan(f, vec3(0.0)));
    return min(of_samples, max((around.r + around.g + around.b) / 3.0, 0.0));
}

vec4 share(uint i) {
    int at = int(i);
    vec4 f = texelFetch(factor, at);
    vec3 whole = texelFetch(picture, at).rgb, over = 1.0 / (whole * whole + EPSILON) / 3.0;
    vec3 v = variance_at(at);
    vec3 e = vec3(texelFetch(expected, 3 * at).x, texelFetch(expected, 3 * at + 1).x, texelFetch(expected, 3 * at + 2).x);
    bool known = texelFetch(radiance, at).w > 0.0;
    vec3 light = f.rgb * texelFetch(filtered, at).rgb, off = light - f.rgb * texelFetch(radiance, at).rgb;
    float sharp = noise_of_sharp(ivec2(i % push.size.x, i / push.size.x), at, (known ? e.y : 1.0) * f.w);
    vec3 before = known ? e.y * f.rgb * f.rgb * v : vec3(0.0), after = known ? e.x * light * light : vec3(0.0);
    vec3 unbiased = known ? off * off - (1.0 - 2.0 * e.z) * before : vec3(0.0);
    vec4 all = vec4(dot(before + sharp, over), dot(after + sharp, over), dot(unbiased - after, over), 1.0);
    return finite(all.xyz) ? all : vec4(0.0);
}

void main() {
    uint at = gl_LocalInvocationIndex, first = gl_WorkGroupID.x * THREADS * EACH + at, pixels = push.size.x * push.size.y;
    vec4 sum = vec4(0.0);
    for (uint i = first; i < min(first + THREADS * EACH, pixels); i += THREADS) sum += share(i);
    shares[at] = sum;
    barrier();
    for (uint half_width = THREADS / 2u; half_width > 0u; half_width /= 2u) {
        if (at < half_width) shares[at] += shares[at + half_width];
        barrier();
    }
    if (at == 0u) sums[gl_WorkGroupID.x] = shares[0];
}
