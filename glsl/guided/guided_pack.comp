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

void main() {
    ivec2 size = ivec2(push.size), p = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(p, size))) return;
    int at = tiled_index(p.x, p.y, size.y), pixel = p.y * size.x + p.x;
    colour[at] = pack64(known_radiance(texelFetch(radiance, pixel)));
    Guide hit = Guide_load(guide, pixel);
    // Halved normals span an interval of length 1, as in images; a covariance does not depend on where it begins.
    vec3 normal = 0.5 * vec3(known_channel(hit.normal.x), known_channel(hit.normal.y), known_channel(hit.normal.z));
    float grey = (normal.x + normal.y + normal.z) / 3.0, depth = known_channel(hit.depth * push.depth_scale);
    channels[at] = pack64(CHANNELS == 1u ? vec4(grey, 0.0, 0.0, 0.0) : vec4(normal, CHANNELS == 4u ? depth : 0.0));
}
