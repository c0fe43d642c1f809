// Floats as words of 64 bits. lavapipe stores lane by lane and member by member: two members cost half of four, and one
// store of four is fewer instructions than two of two.

u64vec2 paired(uvec4 v) {
    return u64vec2(packUint2x32(v.xy), packUint2x32(v.zw));
}

u64vec2 paired(vec4 v) {
    return paired(floatBitsToUint(v));
}

u64vec4 paired(vec4 v, vec4 w) {
    return u64vec4(paired(v), paired(w));
}
