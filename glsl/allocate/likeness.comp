#include "shared/thread.glsl"

// What the geometry alone says of a pixel, in one word: what a filter will gather around it, and how much the noise of each
// of the eight neighbours says of its own. Where a filter will follow, the word comes in as the pixel's importance, a float.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer guides; // of Guide
layout(scalar, binding = 1) buffer Words { uint words[]; }; // of float
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/likeness_bits.glsl"
#include "shared/similarity.glsl"

const float ALBEDO_SCALE = 25.0; // 1 / 0.2^2

struct Place {
    vec3 normal, albedo;
    bool hit;
};

Place place_at(uint pixel) {
    Guide g = Guide_load(guides, pixel);
    return Place(g.normal, g.albedo, g.material != NONE);
}

// 0 to 1, in sevenths.
uint kinship(Place a, Place b) {
    if (a.hit != b.hit) return 0u;
    float normals = squared_distance(a.normal, b.normal), albedos = squared_distance(a.albedo, b.albedo);
    precise float x = normals * push.normal_scale + albedos * ALBEDO_SCALE;
    precise float rounded = exp_negative(x) * SEVENTHS + 0.5;
    return uint(rounded);
}

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    ivec2 size = ivec2(push.size), at = ivec2(i % push.size.x, i / push.size.x);
    float gathered = push.filtered > 0.0 ? 1.0 - uintBitsToFloat(words[i]) : 0.0;
    precise float rounded = gathered * GATHERED_UNIT + 0.5;
    uint word = uint(rounded);
    Place here = place_at(i);
    for (int n = 0; n < 9; n++) {
        ivec2 q = clamp(at + ivec2(n % 3, n / 3) - 1, ivec2(0), size - 1);
        word |= kinship(here, place_at(uint(q.y * size.x + q.x))) << kinship_bit(n);
    }
    words[i] = word;
}
