// Samples that a pixel may still get. Needs `stats` and `push`.
uint room_of(uint pixel) {
    uint room = NONE;
    // A loop of at most one turn in place of a branch, which compilers for CPUs would turn into a masked fetch. A GPU gains
    // nothing from it.
    for (uint k = push.limit == NONE ? 1u : 0u; k < 1u; k++) {
        uint have = PixelStats_count(stats, pixel);
        room = have < push.limit ? push.limit - have : 0u;
    }
    return room;
}
