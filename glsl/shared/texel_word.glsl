// A word of the array behind `texels`, which holds textures, attributes of vertices and tables. Where the scene has more words than a
// view may have texels, the view shows them by four.

uint texel_word(uint at) {
    if (!FX_MANY_TEXELS) return texelFetch(texels, int(at)).x;
    return texelFetch(texels, int(at >> 2))[at & 3u];
}
