#include "shared/thread.glsl"
#include "shared/sanitise.glsl"

// Packs what a filter's taps read of one pixel per thread into two texels instead of four: radiance with its count, and
// position with the normal.
layout(local_size_x = 64) in;
layout(binding = 0) uniform samplerBuffer radiance; // of vec4
layout(binding = 1) uniform usamplerBuffer guide; // of Guide
layout(scalar, binding = 2) writeonly buffer Colours { vec4 colour[]; };
layout(scalar, binding = 3) writeonly buffer Places { uvec4 place[]; };
layout(scalar, push_constant) uniform Push { PackPush push; };

void main() {
    uint i = thread_index();
    if (i >= push.count) return;
    colour[i] = known_radiance(texelFetch(radiance, int(i)));
    Guide hit = Guide_load(guide, i);
    vec3 position = hit.position;
    position = finite(position) ? clamp(position, -FARTHEST, FARTHEST) : vec3(0.0);
    uvec3 bits = floatBitsToUint(position);
    place[i] = uvec4(bits.x & ~1u, bits.yz, packed_normal(hit.normal)); // the lowest bit is for cells: shared/smoothing_cell.glsl
}
