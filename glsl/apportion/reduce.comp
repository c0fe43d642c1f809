#include "shared/uint64.glsl"
#include "shared/block.glsl"

// First pass of the scan of the sample counts: each workgroup sums the samples of one block, and the last one
// replaces the sums by those of the blocks before.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer counts; // of uint
layout(scalar, binding = 1) coherent buffer Blocks { uint64_t blocks[]; }; // of uvec2
layout(scalar, push_constant) uniform Push { ScanPush push; };

#include "shared/scan_blocks.glsl"

void main() {
    uint first = first_unordered(), items = unordered_count(first, push.pixels);
    uint64_t sum = 0UL;
    for (uint k = 0u; k < items; k++) sum += texelFetch(counts, int(first + k * UNORDERED_STEP)).x;
    sum = block_sum(sum);
    if (gl_LocalInvocationIndex == 0u) blocks[gl_WorkGroupID.x] = sum;
    scan_blocks();
}
