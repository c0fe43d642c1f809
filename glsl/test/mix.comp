#include "effects.glsl"
#include "shared/pcg.glsl"
#include "shared/pcg.glsl" // the build includes a file once

// Mixes what it reads through every kind of binding, in integers, so that the CPU twin is equal.
layout(local_size_x_id = 100) in;
layout(constant_id = 101) const uint ADDEND = 0;
layout(binding = 0) uniform usamplerBuffer wide; // of uvec4
layout(binding = 1) uniform usamplerBuffer narrow; // of uvec3
layout(binding = 2) uniform samplerBuffer floats; // of vec4
layout(binding = 3) uniform samplerBuffer scalars; // of float
layout(scalar, binding = 4) readonly buffer Words { uvec3 words[]; };
layout(scalar, binding = 5) buffer Sums { uint sums[]; };
layout(scalar, binding = 6) writeonly buffer Result { uvec2 result[]; };
layout(scalar, binding = 7) uniform Block { uvec2 block; };
layout(scalar, push_constant) uniform Push { uvec4 push; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.x) return;
    int at = int(i);
    uvec4 a = texelFetch(wide, at);
    uint b = texelFetch(narrow, 3 * at + 1).x;
    uint c = floatBitsToUint(texelFetch(floats, at).w);
    uint d = floatBitsToUint(texelFetch(scalars, at).x);
    uvec3 e = words[i];
    uint sum = sums[i] + (FX_TEXTURES ? a.w : 1u) + ADDEND;
    sums[i] = sum;
    result[i] = uvec2(pcg(a.x ^ b ^ c ^ d ^ e.z ^ block.y ^ push.y), sum);
}
