// llvmpipe of Mesa 22.3 silently ends all loops of a thread after 65,535 turns in total (LP_MAX_TGSI_LOOP_ITERATIONS). A batch may
// hold 2^20 samples of one pixel (paths_in_flight in src/gpu/tuning.rs), so that loops over a pixel's samples take PLAIN
// turns of one sample and then turns of SAMPLES_A_TURN: pixels of a thread * PLAIN + 2^20 / SAMPLES_A_TURN must stay below 65,535.
const uint SAMPLES_A_TURN = 17u; // 2^20 samples take 61,681 turns
