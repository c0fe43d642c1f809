// Samples that a pixel may still get. Needs `stats` and `push`.
uint room_of(uint pixel) {
    uint room = NONE;
    // A loop of one or none: compilers for CPUs run both sides of a branch under masks, the fetch included.
    for (uint k = push.limit == NONE ? 1u : 0u; k < 1u; k++) {
        uint have = PixelStats_count(stats, pixel);
        room = have < push.limit ? push.limit - have : 0u;
    }
    return room;
}
