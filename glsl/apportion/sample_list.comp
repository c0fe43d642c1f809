#include "shared/uint64.glsl"
#include "shared/block.glsl"

// The sample-to-pixel buffer of one batch: (pixel, index of the sample in the pixel's sequence), pixel by pixel.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer offset; // of uvec2
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(scalar, binding = 2) writeonly buffer Paths { uint64_t paths[]; }; // of uvec2
layout(scalar, push_constant) uniform Push { BatchPush push; };

#include "shared/first_path.glsl"
#include "shared/loop_limit.glsl"
#include "shared/next_sample.glsl"

const uint PLAIN = 32u; // of each of a thread's 64 pixels at most: see shared/loop_limit.glsl

// Places of a pixel's paths in the batch: from the first to before the last; two equal ones where there are none.
uvec2 places(uint64_t from, uint64_t to, uint64_t begin, uint64_t end) {
    from = clamp(from, begin, end);
    return uvec2(from - begin, clamp(to, from, end) - begin);
}

// Earlier batches of this round are in it.
uint first_index(uint pixel) { return push.first_sample + next_sample(PixelStats_count(stats, pixel)); }

void main() {
    uint first = first_item();
    if (first >= push.pixels) return;
    uint64_t begin = wide(push.first_path), end = begin + push.paths;
    uint64_t from = offset_of(first);
    uint many = THREAD_ITEMS; // the first pixel with more than PLAIN paths
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels || from >= end) break;
        uint64_t to = offset_of(i + 1u);
        uvec2 run = places(from, to, begin, end);
        if (run.y > run.x) {
            uint index = first_index(i), plain = min(run.y, run.x + PLAIN);
            for (uint at = run.x; at < plain; at++) paths[at] = packUint2x32(uvec2(i, index++));
            if (plain < run.y) many = min(many, k);
        }
        from = to;
    }
    // Apart, since a device that masks lanes executes a stride for every pixel that it looks at.
    for (uint k = many; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels) break;
        uvec2 run = places(offset_of(i), offset_of(i + 1u), begin, end);
        uint index = first_index(i) + PLAIN;
        for (uint at = run.x + PLAIN; at < run.y; at += STRIDE, index += STRIDE) {
            [[unroll]] for (uint j = 0u; j < STRIDE; j++) {
                if (at + j < run.y) paths[at + j] = packUint2x32(uvec2(i, index + j));
            }
        }
    }
}
