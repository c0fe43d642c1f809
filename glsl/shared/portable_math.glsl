// Arithmetic that has the same result on every device: additions and products, which Vulkan rounds correctly, in a fixed order
// that the compiler must not contract to fused operations.

// e^-x for x >= 0, within 3e-7; 0 for x beyond 41 and for NaN. Twin: src/math/portable.rs.
float exp_negative(float x) {
    precise float y = x * -1.44269504;
    if (!(y > -60.0)) return 0.0;
    float whole = floor(y);
    precise float f = y - whole;
    precise float p = 0.0018762329; // minimises the squared relative error over Chebyshev nodes
    p = p * f + 0.008992584;
    p = p * f + 0.055823606;
    p = p * f + 0.24015453;
    p = p * f + 0.69315296;
    p = p * f + 0.99999994;
    return p * uintBitsToFloat(uint(int(whole) + 127) << 23);
}

float squared_distance(vec3 a, vec3 b) {
    precise vec3 d = a - b;
    precise float s = d.x * d.x + d.y * d.y + d.z * d.z;
    return s;
}
