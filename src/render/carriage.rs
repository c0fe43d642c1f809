//! What became of pixels at the start of a frame, by the words of `glsl/shared/history.glsl`.
use crate::shaders::shared::history::*;
use serde::Serialize;

/// The samples that a pixel has from earlier frames, as one word holds them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Carried {
    /// Their number.
    pub count: u32,
    /// How many times they have moved, on average.
    pub age: u32,
    /// Whether they are of an edge: of several surfaces.
    pub edge: bool,
    /// Whether they show the side of the surface that its triangle's normal points away from.
    pub back: bool,
}

impl Carried {
    /// Out of a word.
    pub fn of(word: u32) -> Self {
        Self { count: word & 0xffff, age: (word >> 16) & 0xff, edge: word >> 24 & 1 != 0, back: word >> 25 & 1 != 0 }
    }

    /// Of a pixel of [`History::carried`](super::History::carried), where a word without samples may say why.
    pub(super) fn of_pixel(word: u32) -> Self {
        let all = Self::of(word);
        if all.count > 0 { all } else { Self::default() }
    }

    /// As a word.
    pub fn word(self) -> u32 {
        self.count | self.age << 16 | u32::from(self.edge) << 24 | u32::from(self.back) << 25
    }
}

/// How many samples of a pixel are carried, by its word in [`History::carried`](super::History::carried).
pub fn carried_samples(word: u32) -> u32 {
    word & MOST_CARRIED
}

/// What became of the pixels at the start of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Carriage {
    /// Pixels of the new frame that begin with samples of the last.
    pub carried: u64,
    /// Pixels of the new frame that nobody offered any.
    pub new: u64,
    /// Pixels of the new frame at edges, which took none.
    pub new_edges: u64,
    /// Samples that the new frame begins with.
    pub samples: u64,
    /// Pixels of the last frame that have offered theirs to pixels of the new one, not all of which took them.
    pub offered: u64,
    /// Pixels of the last frame that show no surface.
    pub sky: u64,
    /// Those with a smooth or refractive surface.
    pub specular: u64,
    /// Those at an edge.
    pub edge: u64,
    /// Those whose samples have moved too many times for any to count.
    pub old: u64,
    /// Those whose point is outside the new film. This and what follows is of pixels of the new frame where samples come backward.
    pub outside: u64,
    /// Those whose point is hidden in the new frame.
    pub hidden: u64,
    /// Those that look so different from the new view that no sample is worth handing on.
    pub view: u64,
    /// Those whose light has changed.
    pub light: u64,
}

impl Carriage {
    /// Counts the words of both frames.
    pub fn of(offered: &[u32], carried: &[u32]) -> Self {
        let mut sum = Self::default();
        let reasons_of_new = |word: &&u32| carried_samples(**word) == 0 && **word >> 16 != DROPPED_EDGE;
        for &word in carried {
            match (carried_samples(word), word >> 16) {
                (0, DROPPED_EDGE) => sum.new_edges += 1,
                (0, _) => sum.new += 1,
                (n, _) => (sum.carried, sum.samples) = (sum.carried + 1, sum.samples + u64::from(n)),
            }
        }
        sum.offered = offered.iter().filter(|&&word| carried_samples(word) > 0).count() as u64;
        let dropped = offered.iter().filter(|&&word| carried_samples(word) == 0);
        for &word in dropped.chain(carried.iter().filter(reasons_of_new)) {
            let reason = match word >> 16 {
                DROPPED_SKY => &mut sum.sky,
                DROPPED_SPECULAR => &mut sum.specular,
                DROPPED_EDGE => &mut sum.edge,
                DROPPED_OLD => &mut sum.old,
                DROPPED_OUTSIDE => &mut sum.outside,
                DROPPED_HIDDEN => &mut sum.hidden,
                DROPPED_VIEW => &mut sum.view,
                DROPPED_LIGHT => &mut sum.light,
                _ => continue,
            };
            *reason += 1;
        }
        sum
    }
}
