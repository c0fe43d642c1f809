#include "shared/uint64.glsl"
#include "shared/block.glsl"

// Hamilton's second step: gives the pixels of the largest remainders one sample beyond their quota, and ties to the lower
// pixel index. A thread has THREAD_ITEMS pixels. `blocks` holds the scanned sums of tie_sums.comp.
layout(local_size_x = 64) in;
layout(binding = 0) uniform usamplerBuffer key; // of uvec2
layout(binding = 1) uniform usamplerBuffer stats; // of PixelStats
layout(binding = 2) uniform usamplerBuffer state; // of Apportionment
layout(scalar, binding = 3) readonly buffer Blocks { uint64_t blocks[]; }; // of uvec2
layout(scalar, binding = 4) buffer Counts { uint count[]; };
layout(scalar, push_constant) uniform Push { ApportionPush push; };

uint quota_of(uint pixel) { return count[pixel]; }

#include "shared/tie_break.glsl"

void main() {
    Apportionment s = Apportionment_load(state, 0u);
    uint first = first_item(), items = item_count(first, push.pixels);
    uint64_t total, before = block_scan(possible(s, first, items), total);
    before += blocks[gl_WorkGroupID.x];
    uint64_t needed = join64(s.needed), left = needed - min(needed, before);
    uint ties = uint(min(left, uint64_t(items))); // samples for tied pixels, at most one for each
    uint forced = s.forced != 0u ? items : 0u, free = items - forced;
    for (uint k = 0u; k < forced; k++) {
        uint gets = uint(min(left, uint64_t(room_of(first + k) - count[first + k])));
        count[first + k] += gets;
        left -= gets;
    }
    for (uint k = 0u; k < free; k++) {
        uvec2 more = selected_tied(s, key_of(first + k));
        uint tied = min(ties, more.y);
        if (more.x + tied > 0u) count[first + k] += more.x + tied;
        ties -= tied;
    }
}
