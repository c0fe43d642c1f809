//! What the kernels share that decide where samples go.
use super::{Field, Struct, float, uint, uvec2};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// Push constants of the kernels under `src/allocate`: what makes a pixel worth samples.
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
        /// Samples that a pixel has had a chance of.
        round: uint,
    }

    /// Push constants of the kernel that gives pixels one sample or none.
    struct ChoosePush {
        /// Pixels of the film.
        pixels: uint,
        /// Samples that a pixel has had a chance of.
        round: uint,
        /// Chooses the random sequence.
        seed: uint,
        /// Least priority that gets a sample, above 0; 0: priorities are probabilities.
        threshold: float,
    }

    /// Push constants of the kernels that apportion.
    struct ApportionPush {
        /// Pixels of the film.
        pixels: uint,
        /// Largest number of samples of a pixel, those it has included; NONE when the budget can fill none.
        limit: uint,
        /// Counts the repetitions for what full pixels leave, and the digits of remainders from the highest; in `total` 0
        /// after `weigh`, 1 after `deficit` or `need`.
        round: uint,
        /// Repetitions at most.
        rounds: uint,
        /// Samples to place, 64 bits.
        budget: uvec2,
        /// Samples that all pixels have once these are placed, 64 bits.
        total: uvec2,
        /// Error that is good enough, 12.20 fixed point as weights: the budget is an upper bound; 0: it is spent.
        threshold: uint,
        /// Samples at which a pixel has enough whatever its error.
        enough: uint,
    }

    /// Sums over a block of pixels.
    struct BlockSums {
        /// Of the weights of open pixels, 64 bits.
        weights: uvec2,
        /// Samples given to pixels that became full, 64 bits.
        filled: uvec2,
        /// Of the quotas of open pixels, 64 bits.
        floors: uvec2,
        /// Pixels that became full; of `weigh`: priorities that were not finite.
        settled: uint,
        /// Pixels still open; of `weigh`: pixels of positive weight.
        open: uint,
    }

    /// How far an apportionment is.
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
        /// Bits that remainders are moved up by, to the highest but one, so that all sums of weights have the same digits.
        up: uint,
        /// Samples that go to the largest remainders, then those among the ones with `prefix`, 64 bits.
        needed: uvec2,
        /// Leading digits of the smallest remainder that still gets a sample, 64 bits.
        prefix: uvec2,
        /// Bits of the remainders that `prefix` decides, 64 bits.
        mask: uvec2,
        /// 1 when all weigh the same, since no open pixel has a weight.
        equal: uint,
        /// 1 when the quotas are final.
        settled: uint,
        /// 1 when pixels were still filling up in the last repetition.
        forced: uint,
        /// 1 when `prefix` and `needed` decide every pixel.
        selected: uint,
        /// 1 when all remainders with `prefix` get a sample.
        whole_edge: uint,
        /// Priorities that were not finite.
        non_finite: uint,
        /// Pixels of positive weight.
        wanting: uint,
    }

    /// Push constants of the kernels that scan.
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
        /// Of the rounds that the list of paths is dealt to, this one, from 0.
        round: uint,
        /// Rounds that the list is dealt to, at least 1.
        rounds: uint,
        /// Index of every pixel's first sample in its sequence.
        first_sample: uint,
    }
}
