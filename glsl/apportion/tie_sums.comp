#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Sums, for each block, the samples that its pixels can take where the order of index decides (tie_break.glsl). A thread has
// THREAD_ITEMS pixels. The last workgroup replaces the sums by those of the blocks before.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer key; // of uvec2
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 2) uniform usamplerBuffer counts; // of uint
layout(binding = 3) uniform usamplerBuffer state; // of Apportionment
layout(scalar, binding = 4) coherent buffer Blocks { uint64_t blocks[]; }; // of uvec2
layout(scalar, push_constant) uniform Push { ApportionPush push; };

uint quota_of(uint pixel) { return texelFetch(counts, int(pixel)).x; }

#include "shared/tie_break.glsl"
#include "shared/scan_blocks.glsl"

void main() {
    uint first = first_item();
    uint64_t sum = block_sum(possible(Apportionment_load(state, 0u), first, item_count(first, push.pixels)));
    if (gl_LocalInvocationIndex == 0u) blocks[gl_WorkGroupID.x] = sum;
    scan_blocks();
}
