// Mesa's llvmpipe ends all loops of a thread, silently, after 65,535 rounds together (LP_MAX_TGSI_LOOP_ITERATIONS). Loops over
// the samples of a pixel, of which a batch may hold a million, go on in strides of STRIDE behind their first rounds.
const uint STRIDE = 17u; // a million samples in 61,681 rounds
