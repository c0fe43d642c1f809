//! The order of a render: which samples, when, and when to look where they count. It is plain arithmetic, known before the
//! render begins.
mod cut;
mod progress;
mod rounds;
mod step;

pub use cut::{Cut, uniform};
pub use progress::{Progress, pending, rest};
pub use rounds::{Begun, first_spp, frame, limit, steps, steps_of_pixel};
pub use step::{Batch, Choice, PathRange, Plan, Share, Step};

/// What the tests of the schedule share.
#[cfg(test)]
mod example {
    use super::*;
    use crate::render::settings::{Allocate, Settings};

    pub fn settings(policy: &str, spp: u32, min_spp: u32, max_spp: u32, rounds: u32) -> Settings {
        let allocate = Allocate {
            policy: crate::allocate::policy(policy).unwrap(),
            min_spp,
            max_spp,
            rounds,
            ..Allocate::default()
        };
        Settings { spp, allocate, ..Settings::default() }
    }

    pub const CUT: Cut = Cut { pixels: 65, tile: 100, paths: 17 };

    pub fn list(settings: &Settings, cut: &Cut) -> Vec<Step> {
        steps(settings, cut).collect()
    }

    pub fn sums(steps: &[Step]) -> (u64, u64) {
        let budget = |s: &Step| if let Step::Allocate(plan) = s { plan.budget } else { 0 };
        (steps.iter().map(Step::paths).sum(), steps.iter().map(budget).sum())
    }
}
