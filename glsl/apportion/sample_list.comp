#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Writes the list of one batch's paths, pixel by pixel: (pixel, index of the sample in the pixel's sequence). A thread has
// THREAD_ITEMS pixels.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer offset; // of uvec2
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 3) uniform usamplerBuffer carried; // of uint
layout(scalar, binding = 2) writeonly buffer Paths { uint64_t paths[]; }; // of uvec2
layout(scalar, push_constant) uniform Push { BatchPush push; };

#include "shared/first_path.glsl"
#include "shared/loop_limit.glsl"
#include "shared/next_sample.glsl"
#include "shared/history.glsl"

const uint PLAIN = 32u; // loop turns for each of a thread's 64 pixels at most: see shared/loop_limit.glsl

// (first, end) of a pixel's paths within the batch; both are equal where it has none.
uvec2 paths_in_batch(uint64_t from, uint64_t to, uint64_t begin, uint64_t end) {
    from = clamp(from, begin, end);
    return uvec2(from - begin, clamp(to, from, end) - begin);
}

// Index of the pixel's first sample in this batch: the statistics already hold those of the round's earlier batches.
uint first_index(uint pixel) {
    uint of_earlier_frames = push.carries == 0u ? 0u : carried_of(texelFetch(carried, int(pixel)).x).count;
    return push.first_sample + next_sample(PixelStats_count(stats, pixel), of_earlier_frames);
}

void main() {
    uint first = first_item();
    if (first >= push.pixels) return;
    uint64_t begin = join64(push.first_path), end = begin + push.paths;
    uint64_t from = offset_of(first);
    uint many = THREAD_ITEMS; // the first pixel with more than PLAIN paths
    for (uint k = 0u; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels || from >= end) break;
        uint64_t to = offset_of(i + 1u);
        uvec2 run = paths_in_batch(from, to, begin, end);
        if (run.y > run.x) {
            uint index = first_index(i), plain = min(run.y, run.x + PLAIN);
            for (uint at = run.x; at < plain; at++) paths[at] = packUint2x32(uvec2(i, index++));
            if (plain < run.y) many = min(many, k);
        }
        from = to;
    }
    // Pixels of many paths have a loop of their own: a CPU that masks lanes runs all SAMPLES_A_TURN stores for every pixel in it.
    for (uint k = many; k < THREAD_ITEMS; k++) {
        uint i = first + k;
        if (i >= push.pixels) break;
        uvec2 run = paths_in_batch(offset_of(i), offset_of(i + 1u), begin, end);
        uint index = first_index(i) + PLAIN;
        for (uint at = run.x + PLAIN; at < run.y; at += SAMPLES_A_TURN, index += SAMPLES_A_TURN) {
            [[unroll]] for (uint j = 0u; j < SAMPLES_A_TURN; j++) {
                if (at + j < run.y) paths[at + j] = packUint2x32(uvec2(i, index + j));
            }
        }
    }
}
