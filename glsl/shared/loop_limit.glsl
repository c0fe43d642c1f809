// Mesa's llvmpipe ends all loops of a thread, silently, after 65,535 rounds together (LP_MAX_TGSI_LOOP_ITERATIONS). Loops over
// the samples of a pixel, of which a batch may hold 2^20 (paths_in_flight in src/render/renderer.rs), go on in strides of STRIDE behind
// their first rounds, PLAIN of each pixel of a thread: pixels * PLAIN + 2^20 / STRIDE must stay below 65,535.
const uint STRIDE = 17u; // a million samples in 61,681 rounds
