#include "shared/block.glsl"

// Replaces the blocks' sums by their exclusive scan. One workgroup runs, each thread with consecutive blocks.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) buffer Blocks { uint64_t blocks[]; }; // of uvec2
layout(scalar, push_constant) uniform Push { ScanPush push; };

void main() {
    uint count = block_count(push.pixels), run = (count + BLOCK_THREADS - 1u) / BLOCK_THREADS;
    uint first = gl_LocalInvocationIndex * run, end = min(first + run, count);
    uint64_t mine = 0UL, total;
    for (uint b = first; b < end; b++) mine += blocks[b];
    uint64_t before = block_scan(mine, total);
    for (uint b = first; b < end; b++) {
        uint64_t here = blocks[b];
        blocks[b] = before;
        before += here;
    }
}
