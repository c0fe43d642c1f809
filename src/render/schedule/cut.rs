//! How work is cut into batches that fit the buffers.
use super::step::{TOGETHER, of_round};
use super::{Batch, PathRange, Step};
use std::iter::successors;

/// Samples of a pixel in a batch at most: a software device ends loops early (`glsl/shared/loop_limit.glsl`).
const SAMPLES_AT_ONCE: u32 = 1 << 15;

/// Times at most that the samples of full pixels are apportioned again.
pub(super) const REFILLS: u32 = 16;

/// How the work may be cut. It changes no bit of the result.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    /// Number of pixels of the film.
    pub pixels: u32,
    /// Pixels of one tile; batches never cross its multiples.
    pub tile: u32,
    /// Paths of one batch at most.
    pub paths: u32,
}

impl Cut {
    /// Whether a renderer that cuts its work so has the buffers for a step.
    pub fn has_room_for(&self, step: &Step) -> bool {
        match *step {
            Step::Start | Step::Reproject => true,
            Step::Uniform(b) => {
                let end = u64::from(b.first_pixel) + u64::from(b.pixels);
                let within = b.pixels > 0 && end <= u64::from(self.pixels);
                within
                    && (1..=u64::from(self.paths)).contains(&step.paths())
                    && b.samples <= SAMPLES_AT_ONCE
                    && u64::from(b.first_pixel / self.tile) == (end - 1) / u64::from(self.tile)
            }
            Step::Allocate(plan) => plan.pixels == self.pixels && (1..=REFILLS).contains(&plan.rounds),
            Step::Choose(choice) => choice.pixels == self.pixels,
            Step::Listed(range) => (1..=self.paths).contains(&range.paths) && range.round < range.rounds,
        }
    }
}

/// Deals `paths` listed paths to rounds, path j to round j mod their number, and cuts each round into batches. So that a picture is
/// refined evenly, there are as many rounds as can have a full batch and [`TOGETHER`] samples a pixel each, and at least `rounds`.
pub(super) fn deal(paths: u64, rounds: u32, cut: &Cut) -> impl Iterator<Item = Step> + use<> {
    let batch = cut.paths;
    let full = u64::from(batch).max(u64::from(cut.pixels) * u64::from(TOGETHER));
    let rounds = rounds.max((paths / full).min(u64::from(u32::MAX)) as u32);
    (0..rounds).flat_map(move |round| {
        let mine = of_round(paths, round, rounds);
        (0..mine).step_by(batch as usize).map(move |first| {
            let paths = u64::from(batch).min(mine - first) as u32;
            Step::Listed(PathRange { first, paths, round, rounds })
        })
    })
}

/// Cuts samples `first .. first + samples` of every pixel into batches.
pub fn uniform(cut: &Cut, first: u32, samples: u32) -> impl Iterator<Item = Batch> + use<> {
    let Cut { pixels, tile, paths } = *cut;
    let run = pixels.min(paths).min(tile);
    let depth = (paths / run).clamp(1, SAMPLES_AT_ONCE);
    let runs = move |first: &u32| Some(first + run.min(tile - first % tile)).filter(|&next| next < pixels);
    (0..samples).step_by(depth as usize).flat_map(move |sample| {
        successors(Some(0), runs).map(move |first_pixel| Batch {
            first_pixel,
            pixels: run.min(tile - first_pixel % tile).min(pixels - first_pixel),
            first_sample: first.wrapping_add(sample),
            samples: depth.min(samples - sample),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::super::example::{CUT, list, settings};
    use super::super::{Plan, Share, steps};
    use super::*;

    /// Every sample of every pixel appears exactly once, and in order within its pixel.
    fn covers(cut: &Cut, samples: u32) -> bool {
        let mut next = vec![0; cut.pixels as usize];
        for b in uniform(cut, 0, samples) {
            let crosses = b.first_pixel / cut.tile != (b.first_pixel + b.pixels - 1) / cut.tile;
            if crosses || b.pixels * b.samples > cut.paths.max(1) {
                return false;
            }
            for p in b.first_pixel..b.first_pixel + b.pixels {
                if next[p as usize] != b.first_sample {
                    return false;
                }
                next[p as usize] += b.samples;
            }
        }
        next.iter().all(|&n| n == samples)
    }

    #[test]
    fn batches_cover_all_work_once() {
        for pixels in [1, 31, 64, 65] {
            for samples in [1, 2, 7] {
                for paths in [1, 3, 64, 100, 1000] {
                    for tile in [1, 30, 64, 1000] {
                        let cut = Cut { pixels, tile, paths };
                        assert!(covers(&cut, samples), "{cut:?} {samples}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_renderer_has_room_for_its_own_steps_alone() {
        let cut = Cut { tile: 30, ..CUT };
        for policy in ["uniform", "geometry", "variance", "threshold"] {
            assert!(steps(&settings(policy, 8, 2, 6, 4), &cut).all(|step| cut.has_room_for(&step)), "{policy}");
        }
        let batch =
            |first_pixel, pixels, samples| Step::Uniform(Batch { first_pixel, pixels, first_sample: 0, samples });
        let of = |steps: &[Step], kind: fn(&Step) -> bool| *steps.iter().find(|s| kind(s)).unwrap();
        let (plan, wide) = (Cut { pixels: 64, ..cut }, Cut { paths: 18, ..cut });
        let others = [
            batch(0, 18, 1), // more paths than are in flight
            batch(0, u32::MAX, u32::MAX),
            batch(0, 1, SAMPLES_AT_ONCE + 1),
            batch(0, 0, 1),
            batch(0, 1, 0),
            batch(60, 6, 1), // beyond the film
            batch(u32::MAX, 2, 1),
            batch(20, 11, 1), // two tiles
            of(&list(&settings("geometry", 4, 1, 0, 1), &plan), |s| matches!(s, Step::Allocate(_))),
            of(&list(&settings("threshold", 4, 1, 0, 1), &plan), |s| matches!(s, Step::Choose(_))),
            Step::Allocate(Plan { pixels: 65, budget: 1, limit: None, share: Share::Next, rounds: u32::MAX }),
            of(&list(&settings("geometry", 4, 1, 0, 1), &wide), |s| matches!(s, Step::Listed(_))),
        ];
        others.iter().for_each(|step| assert!(!cut.has_room_for(step), "{step:?}"));
    }
}
