// Fetches texel `push`, so that a test can read the largest texel buffer to its end.
layout(local_size_x = 1) in;
layout(binding = 0) uniform usamplerBuffer texels; // of uvec4
layout(scalar, binding = 1) writeonly buffer Found { uvec4 found[]; };
layout(scalar, push_constant) uniform Push { uint push; };

void main() {
    found[0] = texelFetch(texels, int(push));
}
