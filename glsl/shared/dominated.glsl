// Standard deviation of a pixel's mean over the mean: 1 where one sample has brought all light, 1 / sqrt(m) where m of many have.
// Above this, one sample counts as having brought it.
const float DOMINATED = 0.5;
