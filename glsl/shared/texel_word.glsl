// A word of the array behind `texels`, which holds textures, attributes of vertices and tables. Where the scene has more words than a
// view may have texels, the view shows them by four.

uint texel_word(uint at) {
    if (!FX_MANY_TEXELS) return texelFetch(texels, int(at)).x;
    uvec4 four = texelFetch(texels, int(at >> 2));
    uvec2 two = (at & 2u) != 0u ? four.zw : four.xy;
    return (at & 1u) != 0u ? two.y : two.x;
}
