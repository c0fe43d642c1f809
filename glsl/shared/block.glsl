// Sums and scans over a block of items per workgroup of 64 threads. Each thread owns THREAD_ITEMS consecutive items, so that a
// scan crosses threads once. That layout is for lavapipe, where barriers are slow; on a GPU it costs coalesced access. Twin of
// the numbers: src/gpu/blocks.rs.
const uint BLOCK_THREADS = 64u;
layout(constant_id = 103) const uint THREAD_ITEMS = 64u;

shared uint64_t block_words[BLOCK_THREADS];

// Whether neighbouring threads take neighbouring items, so that a GPU reads them together, where their order does not matter.
layout(constant_id = 108) const bool INTERLEAVED = false;
const uint UNORDERED_STEP = INTERLEAVED ? BLOCK_THREADS : 1u; // from one of a thread's items to its next

uint first_item() { return (gl_WorkGroupID.x * BLOCK_THREADS + gl_LocalInvocationIndex) * THREAD_ITEMS; }

uint block_count(uint all) { return (all + BLOCK_THREADS * THREAD_ITEMS - 1u) / (BLOCK_THREADS * THREAD_ITEMS); }

// Number of items of a thread. Since it is not a constant, compilers for CPUs do not unroll loops over the items under masks.
uint item_count(uint first, uint all) { return first < all ? min(THREAD_ITEMS, all - first) : 0u; }

// The same where the order of a block's items does not matter.
uint first_unordered() {
    if (!INTERLEAVED) return first_item();
    return gl_WorkGroupID.x * BLOCK_THREADS * THREAD_ITEMS + gl_LocalInvocationIndex;
}

uint unordered_count(uint first, uint all) {
    if (!INTERLEAVED) return item_count(first, all);
    return first < all ? min(THREAD_ITEMS, (all - first + BLOCK_THREADS - 1u) / BLOCK_THREADS) : 0u;
}

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

// Sum over the threads before this one (Hillis and Steele 1986). All threads must call it; `total` is the sum over all.
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
