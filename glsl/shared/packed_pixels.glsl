// Reads a pixel that pack.comp wrote. Needs `colour` and `place`.
#include "shared/edge.glsl"

Pixel pixel_at(int at) {
    return unpack_pixel(texelFetch(colour, at), texelFetch(place, at));
}
