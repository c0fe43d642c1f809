#include "shared/thread.glsl"

// Puts one pixel per thread together again: picture = sharp + factor * filtered. `picture` holds the sharp part before.
// Twin: denoise::twin::Parts::remodulate.
layout(local_size_x = 64) in;
layout(constant_id = 110) const bool LIGHT = false; // `sharp` is direct light, and the whole is not negative
layout(binding = 0) uniform samplerBuffer filtered; // of vec4
layout(binding = 1) uniform samplerBuffer factor; // of vec4
layout(scalar, binding = 2) buffer Picture { vec4 picture[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    precise vec3 light = texelFetch(factor, int(i)).rgb * texelFetch(filtered, int(i)).rgb;
    precise vec3 whole = picture[i].rgb + light;
    if (LIGHT) whole = max(whole, min(picture[i].rgb, vec3(0.0)));
    picture[i] = vec4(whole, 1.0);
}
