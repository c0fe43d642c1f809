// Index of the next sample of a pixel with `count` samples behind its mean, of which `carried` are of earlier frames; 0 is the
// frame's first. Carried samples count for the mean, but not in this frame's sequence. No other kernel uses a count as an index.
uint next_sample(uint count, uint carried) { return count - min(carried, count); }
