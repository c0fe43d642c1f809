#include "shared/thread.glsl"

// Puts a frame together from its filtered light. Twin: composition::Parts::join.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer filtered; // of vec4
layout(binding = 1) uniform samplerBuffer factor; // of vec4
layout(binding = 2) uniform samplerBuffer sharp; // of vec4
layout(scalar, binding = 3) writeonly buffer Picture { vec4 picture[]; };
layout(scalar, push_constant) uniform Push { SplitPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.size.x * push.size.y) return;
    int at = int(i);
    vec3 light = texelFetch(factor, at).rgb * texelFetch(filtered, at).rgb;
    picture[i] = vec4(texelFetch(sharp, at).rgb + light, 1.0);
}
