#include "shared/thread.glsl"

// Packs one word per pixel and thread out of the guides (likeness_bits.glsl): the share of its window that a filter will
// gather, and how alike each of the eight neighbours is, which are a stride apart. Where a filter will follow, geometry.comp has left
// the pixel's importance, a float, in the word.
layout(local_size_x_id = 100) in;
layout(binding = 0) uniform usamplerBuffer guides; // of Guide
layout(scalar, binding = 1) buffer Words { uint words[]; }; // of float
layout(scalar, push_constant) uniform Push { PriorityPush push; };

#include "shared/likeness_bits.glsl"
#include "shared/similarity.glsl"

const float ALBEDO_SCALE = 25.0; // 1 / 0.2^2

struct Appearance {
    vec3 normal, albedo;
    bool hit;
};

Appearance appearance_at(uint pixel) {
    Guide g = Guide_load(guides, pixel);
    return Appearance(g.normal, g.albedo, g.material != NONE);
}

// How alike two pixels look, 0 to 1 in sevenths.
uint kinship(Appearance a, Appearance b) {
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
    Appearance here = appearance_at(i);
    for (int n = 0; n < 9; n++) {
        ivec2 q = clamp(at + (ivec2(n % 3, n / 3) - 1) * int(push.stride), ivec2(0), size - 1);
        word |= kinship(here, appearance_at(uint(q.y * size.x + q.x))) << kinship_bit(n);
    }
    words[i] = word;
}
