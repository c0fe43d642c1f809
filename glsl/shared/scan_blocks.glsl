// Replaces the sums of blocks in `blocks` by the sums before them. Needs `blocks` and `push`.
#include "shared/last_block.glsl"

// To be called by all threads once their block's sum is written; the last workgroup does it, each thread with consecutive blocks.
void scan_blocks() {
    if (!is_last_block()) return; // safe: the same for all threads
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
