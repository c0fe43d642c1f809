#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// Exclusive scan of the blocks' sums, in place. One workgroup.
layout(local_size_x = 64) in;
layout(scalar, binding = 0) buffer Blocks { uvec2 blocks[]; };
layout(scalar, push_constant) uniform Push { ScanPush push; };

void main() {
    uint count = (push.pixels + BLOCK_THREADS * THREAD_ITEMS - 1u) / (BLOCK_THREADS * THREAD_ITEMS);
    uint64_t before = 0UL;
    for (uint start = 0u; start < count; start += BLOCK_THREADS) {
        uint b = start + gl_LocalInvocationIndex;
        uint64_t total, here = b < count ? wide(blocks[b]) : 0UL;
        uint64_t scanned = block_scan(here, total);
        if (b < count) blocks[b] = unpackUint2x32(before + scanned);
        before += total;
    }
}
