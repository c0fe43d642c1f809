// Unit vectors as points of the square [-1, 1]^2, an unfolded octahedron (Meyer et al. 2010); encoded as two 16-bit snorms.

// The unit vector of a point of the square [-h, h]^2. Not by normalize(), for which some drivers divide three times more, in case
// that squares of components overflow.
vec3 octahedral_vector(vec2 e, float h) {
    vec3 n = vec3(e, h - abs(e.x) - abs(e.y));
    float t = max(-n.z, 0.0);
    n.xy += mix(vec2(t), vec2(-t), greaterThanEqual(n.xy, vec2(0.0)));
    return n * inversesqrt(dot(n, n));
}

vec3 octahedral_vector(vec2 e) { return octahedral_vector(e, 1.0); }

vec2 octahedral_point(vec3 n) {
    vec2 e = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    vec2 folded = (1.0 - abs(e.yx)) * mix(vec2(-1.0), vec2(1.0), greaterThanEqual(e, vec2(0.0)));
    return n.z < 0.0 ? folded : e;
}

// Keeps the snorms as integers, since the length of the vector does not matter.
vec3 octahedral_decode(uint bits) {
    return octahedral_vector(vec2(ivec2(int(bits << 16), int(bits)) >> 16), 32767.0);
}

uint octahedral_encode(vec3 n) { return packSnorm2x16(octahedral_point(n)); }
