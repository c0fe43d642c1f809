#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_GOOGLE_include_directive : require
#include "layout.glsl"
#include "shared/wide.glsl"
#include "shared/block.glsl"

// The sample-to-pixel buffer of one batch: (pixel, index of the sample in the pixel's sequence), pixel by pixel.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer offset; // of uvec2
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 2) writeonly buffer Paths { uvec2 paths[]; };
layout(scalar, push_constant) uniform Push { BatchPush push; };

#include "shared/offset.glsl"
#include "shared/rounds.glsl"

const uint PLAIN = 32u; // of each of a thread's 64 pixels: see shared/rounds.glsl

void main() {
    uint first = first_item(), items = item_count(first, push.pixels);
    if (first >= push.pixels) return; // safe: no barrier() follows
    uint64_t begin = wide(push.first_path), end = begin + push.paths;
    uint64_t from = offset_of(first);
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels || from >= end) break;
        uint64_t to = offset_of(i + 1u);
        if (to > begin && to > from) {
            uint at = uint(max(from, begin) - begin), stop = uint(min(to, end) - begin);
            uint index = push.first_sample + texelFetch(stats, int(2u * i)).w; // earlier batches of this round are in it
            for (uint plain = min(stop, at + PLAIN); at < plain; at++) paths[at] = uvec2(i, index++);
            for (; at < stop; at += STRIDE, index += STRIDE) {
                [[unroll]] for (uint j = 0u; j < STRIDE; j++) {
                    if (at + j < stop) paths[at + j] = uvec2(i, index + j);
                }
            }
        }
        from = to;
    }
}
