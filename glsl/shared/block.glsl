// A workgroup of 64 threads owns a block of items; each thread some that follow one another, so that scans need one step
// across threads. Larger groups pay more for barriers on lavapipe. See stage::PerBlock.
const uint BLOCK_THREADS = 64u;
layout(constant_id = 103) const uint THREAD_ITEMS = 64u;

shared uint64_t block_words[BLOCK_THREADS];

uint first_item() { return (gl_WorkGroupID.x * BLOCK_THREADS + gl_LocalInvocationIndex) * THREAD_ITEMS; }

uint block_count(uint all) { return (all + BLOCK_THREADS * THREAD_ITEMS - 1u) / (BLOCK_THREADS * THREAD_ITEMS); }

// Items that a thread has. A count that is not constant also keeps loops over them from being unrolled and run under a mask
// by compilers for CPUs.
uint item_count(uint first, uint all) { return first < all ? min(THREAD_ITEMS, all - first) : 0u; }

// Sum over the workgroup, in every thread. All threads must call it.
uint64_t block_sum(uint64_t value) {
    uint at = gl_LocalInvocationIndex;
    block_words[at] = value;
    barrier();
    for (uint half_width = BLOCK_THREADS / 2u; half_width > 0u; half_width /= 2u) {
        if (at < half_width) block_words[at] += block_words[at + half_width];
        barrier();
    }
    uint64_t sum = block_words[0];
    barrier();
    return sum;
}

// Sum over the threads before this one (Hillis and Steele 1986). All threads must call it; `total` is that of all.
uint64_t block_scan(uint64_t value, out uint64_t total) {
    uint at = gl_LocalInvocationIndex;
    block_words[at] = value;
    barrier();
    for (uint reach = 1u; reach < BLOCK_THREADS; reach *= 2u) {
        uint64_t before = at >= reach ? block_words[at - reach] : 0UL;
        barrier();
        block_words[at] += before;
        barrier();
    }
    uint64_t inclusive = block_words[at];
    total = block_words[BLOCK_THREADS - 1u];
    barrier();
    return inclusive - value;
}
