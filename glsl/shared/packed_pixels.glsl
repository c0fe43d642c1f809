// Pixels as pack.comp writes them. Needs `colour`, `place` and edge.glsl.
Pixel pixel_at(int at) {
    return unpack_pixel(texelFetch(colour, at), texelFetch(place, at));
}
