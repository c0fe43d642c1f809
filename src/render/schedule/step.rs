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
    /// `limit` in all, nor than double: what is known of the noise comes from the samples there are.
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

impl Step {
    /// What there is to do of it when the list has `listed` paths, which after [`Step::Choose`] and for
    /// [`Share::Need`] only the device knows.
    pub fn within(self, listed: u64) -> Option<Self> {
        let Self::Listed(range) = self else { return Some(self) };
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
}
