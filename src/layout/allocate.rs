//! Structs of the kernels that decide where samples go (`glsl/allocate`, `glsl/apportion`).
use super::{Field, Struct, float, uint, uvec2};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// Push constants of the kernels that compute a pixel's priority (`glsl/allocate`).
    struct PriorityPush {
        /// Film in pixels.
        size: uvec2,
        /// Edge of the square of pixels that geometry compares, 2 to 10.
        window: uint,
        /// 1 / sigma^2 of the difference of unit normals.
        normal_scale: float,
        /// 1 / sigma^2 of the distance of positions, world units^-2.
        position_scale: float,
        /// Added to the luminance that noise is compared with, W/(m^2 sr); negative: noise counts by itself.
        luminance_floor: float,
        /// Samples at which a pixel has enough whatever its noise.
        limit: uint,
        /// Relative error of the mean below which a pixel needs no samples; 0 is off.
        threshold: float,
        /// Share of the variance that a filter takes away where all neighbours are alike, 0 to 1.
        filtered: float,
        /// Rounds before this one, each of which gives a pixel one sample or none; `threshold.comp` alone reads it.
        round: uint,
        /// Distance in pixels, along both axes, of the pixels whose samples tell of one's noise: `indirect_stride`, at least 1.
        stride: uint,
    }

    /// Push constants of `choose.comp`, which gives pixels one sample or none.
    struct ChoosePush {
        /// Pixels of the film.
        pixels: uint,
        /// Rounds before this one, as in [`PriorityPush`].
        round: uint,
        /// Chooses the random sequence.
        seed: uint,
        /// Lowest priority that gets a sample, above 0; with 0, priorities are probabilities.
        threshold: float,
    }

    /// Push constants of the passes of an apportionment, whose order `quantise_priority.comp` lists.
    struct ApportionPush {
        /// Pixels of the film.
        pixels: uint,
        /// Largest number of samples of a pixel, those it has included; NONE when the budget can fill none.
        limit: uint,
        /// How often the same kernel ran before in this apportionment. In `quota` it is the repetition, in `radix_select` the
        /// digit, 0 the highest.
        step: uint,
        /// Largest number of repetitions of `quota`, at least 1.
        repetitions: uint,
        /// Samples to place, 64 bits.
        budget: uvec2,
        /// Samples that all pixels have once these are placed, 64 bits.
        total: uvec2,
        /// Sufficient error, 12.20 fixed point as weights are; the budget is then an upper bound. With 0 all of it is spent.
        threshold: uint,
        /// Samples at which a pixel has enough whatever its error.
        enough: uint,
    }

    /// Sums over a block of pixels.
    struct BlockSums {
        /// Sum of the weights of open pixels, 64 bits.
        weights: uvec2,
        /// Samples given to pixels that became full, 64 bits.
        filled: uvec2,
        /// Sum of the quotas of open pixels, 64 bits.
        floors: uvec2,
        /// Pixels that became full; from `quantise_priority`: priorities that were not finite.
        settled: uint,
        /// Pixels still open; from `quantise_priority`: pixels of positive weight.
        open: uint,
    }

    /// State of an apportionment, from pass to pass.
    struct Apportionment {
        /// Samples for the open pixels, 64 bits.
        budget: uvec2,
        /// Sum of the open pixels' weights, at least 1, 64 bits.
        weights: uvec2,
        /// floor(budget * 2^32 / weights) for budgets of 32 bits, 64 bits.
        ratio: uvec2,
        /// budget / weights for larger ones, 64 bits.
        whole: uvec2,
        /// budget mod weights for larger ones, 64 bits.
        part: uvec2,
        /// Bits that remainders are shifted left by, so that the highest bit of `weights` becomes bit 62 for any sum.
        up: uint,
        /// Samples that go to the largest remainders; during the search, those that go to keys with `prefix`. 64 bits.
        needed: uvec2,
        /// Leading digits of the smallest remainder that still gets a sample, 64 bits.
        prefix: uvec2,
        /// Bits of the remainders that `prefix` decides, 64 bits.
        mask: uvec2,
        /// 1 when all pixels weigh the same, since no open one has a weight.
        equal: uint,
        /// 1 when the quotas are final.
        settled: uint,
        /// 1 when pixels still became full in the last repetition: room decides in place of remainders.
        forced: uint,
        /// 1 when `prefix` and `needed` decide every pixel.
        selected: uint,
        /// 1 when all keys with `prefix` get a sample.
        whole_edge: uint,
        /// Number of priorities that were not finite.
        non_finite: uint,
        /// Number of pixels of positive weight.
        wanting: uint,
    }

    /// Push constants of the kernels that scan the sample counts.
    struct ScanPush {
        /// Pixels of the film.
        pixels: uint,
    }

    /// Push constants of `sample_list.comp`.
    struct BatchPush {
        /// Pixels of the film.
        pixels: uint,
        /// Paths in the batch.
        paths: uint,
        /// Index of the batch's first path in the round, 64 bits.
        first_path: uvec2,
        /// Index of this one of the `rounds`, from 0.
        round: uint,
        /// Rounds that the list of paths is dealt to, at least 1.
        rounds: uint,
        /// Index of every pixel's first sample of this render in its sequence.
        first_sample: uint,
        /// 1 where pixels may have samples of earlier frames.
        carries: uint,
    }
}
