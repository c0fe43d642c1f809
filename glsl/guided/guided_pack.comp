#include "shared/albedo.glsl"
#include "shared/luminance.glsl"
#include "shared/sampled_albedo.glsl"
#include "shared/sanitise.glsl"
#include "shared/store64.glsl"
#include "shared/tiled_index.glsl"

// Packs what the guided filter reads of one pixel per thread: radiance with its count, and the channels of its guide.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform samplerBuffer radiance; // of vec4
layout(binding = 1) uniform usamplerBuffer guide; // of Guide
layout(scalar, binding = 2) writeonly buffer Colours { u64vec2 colour[]; }; // of vec4
layout(scalar, binding = 3) writeonly buffer Channels { u64vec2 channels[]; }; // of vec4
layout(scalar, push_constant) uniform Push { GuidedPackPush push; };

layout(constant_id = 110) const uint CHANNELS = 4u; // 1: mean of the normal's components; 3: normal; 4: normal and depth
layout(constant_id = 111) const bool WITH_ALBEDO = false; // whether the normal is the longer, the darker the surface
// Luminance of albedo that counts as darkest; a normal is twice as long there. Longer ones hold less tightly to normals as well: with
// three times the length DamagedHelmet had .905 of relMSE in place of .929, but scenes/moving 1.08 in place of 1.02.
const float DARKEST = 0.16;

// Light is divided by the albedo A of base and gloss, but what a gloss shows does not follow the base's texture: with L_d on the base
// and L_s in a gloss of albedo s, it is L_d + s (L_s - L_d) / A. A guide that has 1 / A makes that linear. It needs no channel of its
// own: around a normal others lie across it, to first order, so that its length is free to tell of something else.
float length_of_normal(Guide hit, int i, float count) {
    // Pixels that a lens blurs have no material here, and show several surfaces.
    if (!WITH_ALBEDO || hit.material == NONE) return 1.0;
    vec3 albedo = sampled_albedo(i, count, hit.albedo);
    if (!reflects(albedo)) return 1.0; // its light was divided by no albedo
    float bright = luminance(vec3(known_channel(albedo.x), known_channel(albedo.y), known_channel(albedo.z)));
    return 1.0 + DARKEST / max(bright, DARKEST);
}

void main() {
    ivec2 size = ivec2(push.size), p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, size))) return;
    int at = tiled_index(p.x, p.y, size.y), pixel = p.y * size.x + p.x;
    vec4 c = texelFetch(radiance, pixel);
    colour[at] = pack64(known_radiance(c));
    Guide hit = Guide_load(guide, pixel);
    // Halved normals span an interval of length 1, as in images; a covariance does not depend on where it begins.
    vec3 normal = 0.5 * vec3(known_channel(hit.normal.x), known_channel(hit.normal.y), known_channel(hit.normal.z));
    normal *= length_of_normal(hit, pixel, c.w);
    float grey = (normal.x + normal.y + normal.z) / 3.0, depth = known_channel(hit.depth * push.depth_scale);
    channels[at] = pack64(CHANNELS == 1u ? vec4(grey, 0.0, 0.0, 0.0) : vec4(normal, CHANNELS == 4u ? depth : 0.0));
}
