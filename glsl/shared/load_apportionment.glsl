// Reads the state as six texels, where a storage buffer costs a CPU a loop over lanes for each of its 24 words.
Apportionment load_state() {
    uvec4 a = texelFetch(state, 0), b = texelFetch(state, 1), c = texelFetch(state, 2);
    uvec4 d = texelFetch(state, 3), e = texelFetch(state, 4), f = texelFetch(state, 5);
    return Apportionment(a.xy, a.zw, b.xy, b.zw, c.xy, c.z, uvec2(c.w, d.x), d.yz, uvec2(d.w, e.x), e.y, e.z, e.w, f.x,
                         f.y, f.z, f.w);
}
