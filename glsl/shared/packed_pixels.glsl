// Reads the pixels that pack.comp wrote.
#include "shared/edge.glsl"
layout(binding = 0) uniform samplerBuffer colour; // of vec4
layout(binding = 1) uniform usamplerBuffer place; // of uvec4

Pixel pixel_at(int at) {
    return unpack_pixel(texelFetch(colour, at), texelFetch(place, at));
}
