#include "shared/thread.glsl"
#include "shared/albedo.glsl"

// Writes the sharp part of pixels whose direct light is unknown, one per thread: in-painted light times the centre's albedo.
// Twin: denoise::twin::Parts::remodulate_direct.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer guide; // of Guide
layout(binding = 1) uniform samplerBuffer direct; // of vec4
layout(binding = 2) uniform samplerBuffer filtered; // of vec4
layout(scalar, binding = 3) writeonly buffer Sharp { vec4 sharp[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count || texelFetch(direct, int(i)).w != 0.0) return;
    vec3 albedo = Guide_albedo(guide, int(i)), light = texelFetch(filtered, int(i)).rgb;
    sharp[i] = vec4(reflects(albedo) ? divisor(albedo) * light : light, 0.0);
}
