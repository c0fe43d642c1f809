// Four floats as two words of 64 bits. lavapipe stores lane by lane and member by member: two members cost half of four.
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

u64vec2 paired(vec4 v) {
    uvec4 bits = floatBitsToUint(v);
    return u64vec2(packUint2x32(bits.xy), packUint2x32(bits.zw));
}
