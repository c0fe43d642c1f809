// Packs floats to 64-bit words for stores. lavapipe stores lane by lane and member by member: two members cost half of four,
// and one store of four takes fewer instructions than two of two. A GPU gains nothing from it.

u64vec2 pack64(uvec4 v) {
    return u64vec2(packUint2x32(v.xy), packUint2x32(v.zw));
}

u64vec2 pack64(vec4 v) {
    return pack64(floatBitsToUint(v));
}

u64vec4 pack64(vec4 v, vec4 w) {
    return u64vec4(pack64(v), pack64(w));
}
