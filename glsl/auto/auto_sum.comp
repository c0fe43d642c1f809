// Adds up three planes, 4096 elements per workgroup. It runs again over its own sums until one is left.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer squares; // of vec4
layout(binding = 1) uniform samplerBuffer products; // of vec4
layout(binding = 2) uniform samplerBuffer others; // of vec4
layout(scalar, binding = 3) writeonly buffer SquareSums { vec4 square_sums[]; };
layout(scalar, binding = 4) writeonly buffer ProductSums { vec4 product_sums[]; };
layout(scalar, binding = 5) writeonly buffer OtherSums { vec4 other_sums[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

const uint THREADS = 64u, EACH = 64u;

shared vec4 sums[3][THREADS];

void main() {
    uint at = gl_LocalInvocationIndex, first = gl_WorkGroupID.x * THREADS * EACH + at;
    vec4 square = vec4(0.0), product = vec4(0.0), other = vec4(0.0);
    for (uint i = first; i < min(first + THREADS * EACH, push.count); i += THREADS) {
        square += texelFetch(squares, int(i));
        product += texelFetch(products, int(i));
        other += texelFetch(others, int(i));
    }
    sums[0][at] = square;
    sums[1][at] = product;
    sums[2][at] = other;
    barrier();
    for (uint half_width = THREADS / 2u; half_width > 0u; half_width /= 2u) {
        if (at < half_width) {
            for (int k = 0; k < 3; k++) sums[k][at] += sums[k][at + half_width];
        }
        barrier();
    }
    if (at != 0u) return;
    square_sums[gl_WorkGroupID.x] = sums[0][0];
    product_sums[gl_WorkGroupID.x] = sums[1][0];
    other_sums[gl_WorkGroupID.x] = sums[2][0];
}
