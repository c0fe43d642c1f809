// For passes whose last workgroup goes on alone, with what all of them have left: a dispatch of its own would wait for the device to
// run empty, and then for that one group.
#include "shared/block.glsl"
layout(scalar, binding = 20) buffer Ended { uint ended[]; }; // workgroups that have got this far, 0 between dispatches

shared bool is_last;

// Whether this is the last workgroup to get here, the same for all of its threads. It sees all that the others have written to
// coherent buffers. All threads must call it.
bool is_last_block() {
    memoryBarrierBuffer();
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        is_last = atomicAdd(ended[0], 1u) + 1u == gl_NumWorkGroups.x;
        if (is_last) ended[0] = 0u;
    }
    barrier();
    memoryBarrierBuffer();
    return is_last;
}
