// A word of `likeness.comp`: in the lowest 5 bits the share of its window that a filter gathers, then 3 bits of likeness for
// each pixel of the 3 x 3 around one, row by row.
const float GATHERED_UNIT = 31.0, SEVENTHS = 7.0;
// Unlike pixels still count a little: where all are unlike, as in grass, there is no better source.
const float MIN_KINSHIP = 0.2;

uint kinship_bit(int n) {
    return 5u + 3u * uint(n);
}

float kinship_of(uint word, int n) {
    return max(float((word >> kinship_bit(n)) & 7u) / SEVENTHS, MIN_KINSHIP);
}

float gathered_of(uint word) {
    return float(word & 31u) / GATHERED_UNIT;
}
