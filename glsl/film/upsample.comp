#include "shared/thread.glsl"
#include "shared/finite.glsl"

// Fills a sparse image in from its traced pixels once they are filtered, one pixel per thread: the mean of the four around, by
// bilinear weights times how alike the surfaces are (joint bilateral upsampling: Kopf et al. 2007). Surfaces are alike that face
// the same way and lie in one plane, which needs no unit of length. Twin: denoise::sparse::upsampled.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer traced; // of vec4
layout(binding = 1) uniform usamplerBuffer guide; // of Guide
layout(scalar, binding = 2) writeonly buffer Filtered { vec4 filtered[]; };
layout(scalar, push_constant) uniform Push { SparsePush push; };

// Exponents in base 2, per squared difference of unit normals, and per squared sine of the angle to the plane: a difference of 0.3
// counts 1 / e, as in the filters.
const float RATE = 16.0;
const float FARTHEST_APART = 64.0; // exponents are cut here, so that no difference makes infinities

float apart(Guide a, Guide b) {
    vec3 normals = a.normal - b.normal, way = b.position - a.position;
    float distance = dot(way, way), off = dot(way, a.normal);
    float sine = distance > 0.0 ? off * off / distance : 0.0, exponent = RATE * (dot(normals, normals) + sine);
    bool one_is_hit = (a.object == NONE) != (b.object == NONE);
    return finite(exponent) && !one_is_hit ? min(exponent, FARTHEST_APART) : FARTHEST_APART;
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    uvec2 size = (push.size + push.stride - 1u) / push.stride, at = uvec2(i % push.size.x, i / push.size.x);
    uvec2 cell = at / push.stride, rest = at - cell * push.stride;
    vec2 share = vec2(rest) / float(push.stride);
    Guide here = Guide_load(guide, i);
    vec4 taps[4];
    float weight[4], exponent[4], nearest = FARTHEST_APART;
    [[unroll]] for (uint k = 0u; k < 4u; k++) {
        uvec2 by_one = uvec2(k & 1u, k >> 1), tap = min(cell + by_one, size - 1u);
        taps[k] = texelFetch(traced, int(tap.y * size.x + tap.x));
        vec2 by = mix(1.0 - share, share, equal(by_one, uvec2(1u)));
        weight[k] = taps[k].w > 0.0 ? by.x * by.y : 0.0;
        exponent[k] = apart(here, Guide_load(guide, tap.y * push.stride * push.size.x + tap.x * push.stride));
        nearest = weight[k] > 0.0 ? min(nearest, exponent[k]) : nearest;
    }
    // Relative to the one most alike, so that some pixel always counts.
    vec3 sum = vec3(0.0), base = taps[0].rgb;
    float total = 0.0;
    [[unroll]] for (uint k = 0u; k < 4u; k++) {
        float w = weight[k] > 0.0 ? weight[k] * exp2(nearest - exponent[k]) : 0.0;
        sum += weight[k] > 0.0 ? w * (taps[k].rgb - base) : vec3(0.0); // so that a constant image stays exact
        total += w;
    }
    filtered[i] = total > 0.0 ? vec4(base + sum / total, 1.0) : vec4(0.0);
}
