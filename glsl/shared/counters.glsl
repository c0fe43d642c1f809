// Counters of a frame: closest-hit rays, any-hit rays and nodes, of two words each.
layout(scalar, binding = 12) buffer Counters { uint counters[]; };

// Adds to a 64-bit counter made of two words, since 64-bit atomics are not a required feature.
void count_up(uint slot, uint n) {
    uint before = atomicAdd(counters[2u * slot], n);
    if (before + n < before) atomicAdd(counters[2u * slot + 1u], 1u);
}
