// Index of the next sample of a pixel with `count` samples behind its mean; 0 is the render's first.
//
// It is the count while all of these samples are of this render. Samples that were carried over from an earlier frame are
// behind the mean as well, but are none of this render's sequence: who carries some keeps their number, a word per pixel, and
// subtracts it here and in the twin (`statistics::next_sample`). No other kernel takes a count for an index.
uint next_sample(uint count) { return count; }
