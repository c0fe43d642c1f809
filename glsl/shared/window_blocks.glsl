// Windows of the guided filter consist of whole blocks of STEP x STEP pixels, and one is centred in every block: with wide windows,
// neighbouring ones hardly differ. Departure from the paper, as in the fast guided filter (He and Sun 2015), which samples one pixel
// of each block; here all count. Host: denoise::filter::guided::step.
layout(constant_id = 113) const int STEP = 1;

// Blocks across and down an image; those at the right and the lower border may lack pixels.
ivec2 blocks_of(uvec2 size) {
    return (ivec2(size) + STEP - 1) / STEP;
}
