#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/thread.glsl"

// Noise that the samples show, estimated among the surroundings that look alike, less what a geometry-aware filter will
// remove of it. A filter that gathers a share W of its window divides the variance by about 1 + W (pixels - 1): the
// deviation that is left is what needs samples. Where nothing is known of the noise yet, geometry alone decides.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 1) uniform usamplerBuffer words; // of float
layout(scalar, binding = 2) writeonly buffer Priorities { float priority[]; };
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/kinship.glsl"
#include "shared/noise.glsl"

const float LEAST_LEFT = 0.01; // of two pixels at least .27

vec3 mean_of(uint pixel) {
    return uintBitsToFloat(texelFetch(stats, int(2u * pixel)).rgb);
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return; // safe: no barrier() follows
    ivec2 size = ivec2(push.size), at = ivec2(i % push.size.x, i / push.size.x);
    ivec2 first = max(at - 1, ivec2(0)), last = min(at + 1, size - 1);
    uint word = texelFetch(words, int(i)).x;
    vec3 own = mean_of(i);
    vec4 around = vec4(0.0), offsets = vec4(0.0);
    float squares = 0.0, weights = 0.0, freedom = 0.0;
    for (int y = first.y; y <= last.y; y++) {
        for (int x = first.x; x <= last.x; x++) {
            uint neighbour = uint(y * size.x + x);
            vec4 m = moments(neighbour);
            if (m.w == 0.0) continue;
            float kin = kinship_of(word, 3 * (y - at.y) + x - at.x + 4);
            vec3 offset = mean_of(neighbour) - own; // small numbers: their squares keep their digits
            around += kin * m;
            offsets += kin * vec4(offset, 1.0);
            squares += kin * dot(offset, offset);
            weights += kin * kin;
            freedom += kin / m.w;
        }
    }
    // Pixels that look alike should be equally bright: how far their means are apart is noise as well, and all that shows it
    // after one sample a pixel. Of n samples it counts 1/n, since the more there are, the more of it is no noise.
    // The share of it that is left when the mean is taken off: 0 of one pixel, but for what division rounds.
    float left = 1.0 - weights / (offsets.w * offsets.w);
    if (offsets.w > 0.0 && left > LEAST_LEFT) {
        around.x += max(squares - dot(offsets.rgb, offsets.rgb) / offsets.w, 0.0) / 3.0;
        around.y += freedom * left;
    }
    priority[i] = noise(moments(i), around) * sqrt(max(1.0 - push.filtered * gathered_of(word), 0.0));
}
