// What a pixel gets beyond its quota once the remainders are selected. Needs `state`, `stats` and `push`.
// Returns (added for certain, at most this more in order of index).
uvec2 beyond_quota(Apportionment s, uint pixel, uint quota, uvec2 key) {
    if (key == uvec2(NONE)) return uvec2(0u);
    if (s.forced != 0u) { // rounds ran out: fill what room there is
        uint have = texelFetch(stats, int(7u * pixel + 3u)).x;
        return uvec2(0u, push.limit - have - quota);
    }
    uint64_t digits = wide(key) >> s.shift, prefix = wide(s.prefix);
    return uvec2(digits > prefix ? 1u : 0u, digits == prefix ? 1u : 0u);
}
