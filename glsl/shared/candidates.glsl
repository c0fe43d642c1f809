// Of auto's candidates.
const float WORST = 1e24; // stands for an error that no candidate may be chosen with
