// Index of the next sample of a pixel with `count` samples behind its mean; 0 is the render's first.
//
// It equals the count while all samples are of this render. Samples carried over from an earlier frame would count for the mean,
// but not in this render's sequence: their number would have to be subtracted here and in the twin (`statistics::next_sample`).
// No other kernel uses a count as an index.
uint next_sample(uint count) { return count; }
