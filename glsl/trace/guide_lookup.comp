#include "effects.glsl"
#include "shared/thread.glsl"
#include "shared/scene.glsl"
#include "shared/frame.glsl"
#include "shared/sanitise.glsl"

// Adds filtered indirect light times albedo over the eye rays of one pixel per thread (supersampling of Bauszat, Eisemann and
// Magnor 2011, EGSR, section 3.2). Guide rays through pixel centres carry filtered light; every eye ray takes that of the
// guide ray, of the four nearest, whose surface is most like its own.
layout(local_size_x_id = 100) in;
layout(binding = 11) uniform usamplerBuffer guides; // of Guide
layout(binding = 12) uniform samplerBuffer filtered; // of vec4
layout(scalar, binding = 13) buffer Indirect { vec3 indirect[]; };
layout(scalar, push_constant) uniform Push { PathPush push; };

#include "shared/first_hit.glsl"

// Departure from the paper, whose quotients are 0 / 0 on one plane: the largest difference counts as at least this, so that
// rounding decides nothing. The first is between unit normals, the second relative to the depth.
const float MIN_NORMAL_DIFFERENCE = 1e-3, MIN_DEPTH_DIFFERENCE = 1e-4;

// Normal and depth of the guide ray through a pixel; the depth is 0 where the ray carries no light.
vec4 guide_ray(ivec2 at) {
    if (any(greaterThanEqual(at, ivec2(push.constants.size)))) return vec4(0.0);
    int q = at.y * int(push.constants.size.x) + at.x;
    Guide guide = Guide_load(guides, q);
    bool known = known_radiance(texelFetch(filtered, q)).w > 0.0 && finite(guide.normal) && finite(guide.depth);
    return known ? vec4(guide.normal, guide.depth) : vec4(0.0);
}

// Pixel of the guide ray with the largest S = S_n * S_d (equations 3 to 5) among the four nearest to `film`; the nearest wins a
// tie. NONE where none of them carries light.
uint most_similar(Guide eye, vec2 film) {
    ivec2 size = ivec2(push.constants.size);
    ivec2 first = clamp(ivec2(floor(film - 0.5)), ivec2(0), max(size - 2, 0));
    ivec2 near = clamp(ivec2(floor(film)), ivec2(0), size - 1), far = 2 * first + 1 - near;
    ivec2 at[4] = ivec2[](near, ivec2(far.x, near.y), ivec2(near.x, far.y), far);
    vec2 differences[4], largest = vec2(MIN_NORMAL_DIFFERENCE, MIN_DEPTH_DIFFERENCE * eye.depth);
    for (int k = 0; k < 4; k++) {
        vec4 guide = guide_ray(at[k]);
        bool carries = guide.w > 0.0;
        differences[k] = carries ? vec2(distance(eye.normal, guide.xyz), abs(eye.depth - guide.w)) : vec2(-1.0);
        largest = max(largest, differences[k]);
    }
    uint chosen = NONE;
    float best = -1.0;
    for (int k = 0; k < 4; k++) {
        vec2 similarity = 1.0 - differences[k] / largest;
        float s = similarity.x * similarity.y;
        if (differences[k].x < 0.0 || !(s > best)) continue;
        best = s;
        chosen = uint(at[k].y * size.x + at[k].x);
    }
    return chosen;
}

void main() {
    uint pixel = thread_index();
    if (pixel >= push.pixels) return;
    vec3 sum = vec3(0.0);
    // Tested at its end: see shared/traverse.glsl.
    uint k = 0u;
    do {
        uint index = push.first_sample + k;
        Sampler random = sampler_start(pixel, index, push.constants.seed);
        vec2 film = film_sample(pixel, random);
        Ray ray = eye_ray(film, random);
        Guide first;
        Hit hit;
        vec3 albedo;
        Guide eye = seen_hit(ray, path_seed(pixel, index), first, hit, albedo);
        if (albedo == vec3(0.0)) continue;
        uint chosen = most_similar(eye, film);
        if (chosen != NONE) sum += albedo * known_radiance(texelFetch(filtered, int(chosen))).rgb;
    } while (++k < push.samples);
    indirect[pixel] += sum;
}
