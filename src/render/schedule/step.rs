//! The pieces of a render.

/// A rectangle of work: some samples of a run of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Batch {
    /// Row-major index.
    pub first_pixel: u32,
    /// At least 1.
    pub pixels: u32,
    /// Index in each pixel's sequence.
    pub first_sample: u32,
    /// 1 to 32768.
    pub samples: u32,
}

/// Paths of a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathRange {
    /// Place of the first one in the round.
    pub first: u64,
    /// At least 1.
    pub paths: u32,
    /// Of the rounds that the list of paths is dealt to, this one, from 0.
    pub round: u32,
    /// Rounds that the list is dealt to, at least 1.
    pub rounds: u32,
}

/// What priorities ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Share {
    /// Shares of the samples to place.
    Next,
    /// Shares of all samples: those that pixels have and those to place, together so many.
    All(u64),
    /// As many samples n as bring priority / sqrt(n), the error of the mean, below the threshold, but no more than
    /// `limit` in all, nor than double, or 4: what is known of the noise comes from the samples there are.
    Need {
        /// Above 0.
        threshold: f32,
        /// Samples of a pixel.
        limit: u32,
    },
}

/// What is to be apportioned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plan {
    /// Number of pixels of the film.
    pub pixels: u32,
    /// Samples to place; of [`Share::Need`] at most.
    pub budget: u64,
    /// Largest number of samples of a pixel, those it has included; none when no pixel can be filled.
    pub limit: Option<u32>,
    /// What of.
    pub share: Share,
    /// Times at most that the samples of full pixels are apportioned again, up to 16; 1 when none can be full.
    pub rounds: u32,
}

/// Who gets one more sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Choice {
    /// Number of pixels of the film.
    pub pixels: u32,
    /// Samples that every pixel has had a chance of.
    pub round: u32,
    /// Least priority that gets one, above 0; 0: priorities are probabilities.
    pub threshold: f32,
}

/// A piece of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Step {
    /// Forgets all samples; finds the primary hits, if anybody reads them.
    Start,
    /// Starts the next frame with the samples of the last that still show the same: [`crate::render::Renderer::keep_history`].
    Reproject,
    /// The same number of samples for a run of pixels.
    Uniform(Batch),
    /// Decides how many samples each pixel gets next.
    Allocate(Plan),
    /// Decides who gets one.
    Choose(Choice),
    /// Traces some of what was allocated: after [`Step::Choose`] and for [`Share::Need`] at most so much.
    Listed(PathRange),
}

/// Samples of a pixel that are traced by neighbouring threads, where a step has as many: their rays go alike, and lavapipe takes a tenth
/// longer where they are fewer.
pub(super) const TOGETHER: u32 = 8;

/// Of the first `paths` of a list that is dealt to `rounds`, those of one round.
pub(super) fn of_round(paths: u64, round: u32, rounds: u32) -> u64 {
    paths.saturating_sub(round.into()).div_ceil(u64::from(rounds).max(1))
}

impl Step {
    /// What there is to do of it when the list has `listed` paths, which after [`Step::Choose`] and for
    /// [`Share::Need`] only the device knows.
    pub fn within(self, listed: u64) -> Option<Self> {
        let Self::Listed(range) = self else { return Some(self) };
        let listed = of_round(listed, range.round, range.rounds);
        let paths = listed.saturating_sub(range.first).min(u64::from(range.paths)) as u32;
        (paths > 0).then_some(Self::Listed(PathRange { paths, ..range }))
    }

    /// Paths that it traces, at most.
    pub fn paths(&self) -> u64 {
        match self {
            Self::Start | Self::Reproject | Self::Allocate(_) | Self::Choose(_) => 0,
            Self::Uniform(b) => u64::from(b.pixels) * u64::from(b.samples),
            Self::Listed(r) => u64::from(r.paths),
        }
    }

    /// Cuts one of more than `most` paths in two, the first of which may still be too large: first between the samples
    /// of all pixels, so that the picture is refined evenly, and those of one pixel last. Pieces of pieces are of about one size.
    pub(in crate::render) fn split(self, most: u64) -> Option<(Self, Self)> {
        if self.paths() <= most {
            return None;
        }
        // The first of the fewest pieces that are small enough.
        let first = |all: u32, most: u64| u64::from(all).div_ceil(u64::from(all).div_ceil(most)) as u32;
        Some(match self {
            Self::Uniform(b) if b.samples > TOGETHER || b.pixels == 1 => {
                let together = TOGETHER.min(b.samples - 1);
                let groups = (most / (u64::from(b.pixels) * u64::from(together))).max(1);
                let samples = first(b.samples.div_ceil(together), groups) * together;
                let rest =
                    Batch { first_sample: b.first_sample.wrapping_add(samples), samples: b.samples - samples, ..b };
                (Self::Uniform(Batch { samples, ..b }), Self::Uniform(rest))
            }
            Self::Uniform(b) => {
                let pixels = first(b.pixels, (most / u64::from(b.samples)).max(1));
                let rest = Batch { first_pixel: b.first_pixel + pixels, pixels: b.pixels - pixels, ..b };
                (Self::Uniform(Batch { pixels, ..b }), Self::Uniform(rest))
            }
            Self::Listed(r) => {
                let paths = first(r.paths, most);
                let rest = PathRange { first: r.first + u64::from(paths), paths: r.paths - paths, ..r };
                (Self::Listed(PathRange { paths, ..r }), Self::Listed(rest))
            }
            Self::Start | Self::Reproject | Self::Allocate(_) | Self::Choose(_) => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pieces of at most so many paths, in order.
    fn pieces(step: Step, most: u64) -> Vec<Step> {
        match step.split(most) {
            Some((head, rest)) => [pieces(head, most), pieces(rest, most)].concat(),
            None => vec![step],
        }
    }

    #[test]
    fn pieces_are_small_enough_and_together_the_whole_in_order() {
        let batch = Batch { first_pixel: 5, pixels: 30, first_sample: 2, samples: 21 };
        let list = PathRange { first: 1 << 33, paths: 210, round: 1, rounds: 3 };
        for most in [1, 7, 29, 30, 31, 61, 100, 209, 210, u64::MAX] {
            let (mut next, mut end) = ([2; 30], 1 << 33);
            for piece in pieces(Step::Uniform(batch), most) {
                let Step::Uniform(b) = piece else { panic!("{piece:?}") };
                assert!(piece.paths() <= most, "{most}: {piece:?}");
                for at in &mut next[b.first_pixel as usize - 5..][..b.pixels as usize] {
                    assert_eq!(*at, b.first_sample, "{most}: {piece:?}");
                    *at += b.samples;
                }
            }
            assert_eq!(next, [23; 30], "{most}");
            for piece in pieces(Step::Listed(list), most) {
                assert!(matches!(piece, Step::Listed(r) if r == PathRange { first: end, paths: r.paths, ..list }));
                assert!((1..=most).contains(&piece.paths()), "{most}: {piece:?}");
                end += piece.paths();
            }
            assert_eq!(end, (1 << 33) + 210);
        }
        let last = Batch { first_pixel: 0, pixels: 1, first_sample: u32::MAX - 3, samples: 64 };
        let firsts: Vec<u32> = pieces(Step::Uniform(last), 8)
            .into_iter()
            .map(|step| if let Step::Uniform(b) = step { b.first_sample } else { 0 })
            .collect();
        let expected: Vec<u32> = (0..8).map(|k| (u32::MAX - 3).wrapping_add(8 * k)).collect();
        assert_eq!(firsts, expected, "the sequence goes on from its start behind its end");
        let sizes = |most| pieces(Step::Listed(list), most).iter().map(Step::paths).collect::<Vec<_>>();
        assert_eq!([sizes(209), sizes(100)], [vec![105, 105], vec![70, 70, 70]]);
        let samples = |step| if let Step::Uniform(b) = step { b.samples } else { 0 };
        let together: Vec<_> = pieces(Step::Uniform(batch), 250).into_iter().map(samples).collect();
        assert_eq!(together, [8, 8, 5]);
        assert_eq!(Step::Start.split(1), None);
    }

    #[test]
    fn what_was_listed_bounds_a_step() {
        let step = |first, paths, rounds| Step::Listed(PathRange { first, paths, round: 0, rounds });
        assert_eq!(step(3, 9, 2).within(17), Some(step(3, 6, 2)), "9 of 17 are of the first of two rounds");
        assert_eq!(step(3, 9, 2).within(6), None);
        assert_eq!(step(0, 9, 0).within(5), Some(step(0, 5, 0)), "a step that no renderer makes, which none records");
    }
}
