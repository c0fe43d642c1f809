// Whether a value is neither NaN nor infinite.
bool finite(float v) {
    return (floatBitsToUint(v) & 0x7f800000u) != 0x7f800000u; // by bits: isinf may be optimised away
}

bool finite(vec3 v) {
    return finite(v.x) && finite(v.y) && finite(v.z);
}
