#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Last pass of the scan of the sample counts: writes the index of every pixel's first path; element `pixels` is the number
// of all paths. A thread has THREAD_ITEMS pixels. `blocks` holds the sums of reduce.comp, scanned.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer counts; // of uint
layout(scalar, binding = 1) readonly buffer Blocks { uint64_t blocks[]; }; // of uvec2
layout(scalar, binding = 2) writeonly buffer Offsets { uint64_t offset[]; }; // of uvec2
layout(scalar, push_constant) uniform Push { ScanPush push; };

void main() {
    uint first = first_item(), items = item_count(first, push.pixels);
    uint64_t mine = 0UL, total;
    for (uint k = 0u; k < items; k++) mine += texelFetch(counts, int(first + k)).x;
    uint64_t at = block_scan(mine, total) + blocks[gl_WorkGroupID.x];
    for (uint k = 0u; k < items; k++) {
        uint i = first + k;
        offset[i] = at;
        at += texelFetch(counts, int(i)).x;
        if (i + 1u == push.pixels) offset[i + 1u] = at;
    }
}
