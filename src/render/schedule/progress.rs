//! Where a render that stopped early goes on.
use super::cut::{Cut, deal};
use super::rounds::rounds;
use super::step::of_round;
use super::{PathRange, Step};
use crate::render::settings::Settings;

/// Where a render that stopped early goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Allocations that were made.
    pub allocations: u32,
    /// Samples that all pixels together still lack of what they were to have by then.
    pub pending: u64,
}

/// The rest of a render whose pixels, their statistics and what they lack were handed back.
pub fn rest(settings: &Settings, cut: &Cut, progress: Progress) -> impl Iterator<Item = Step> + use<> {
    deal(progress.pending, 1, cut).chain(rounds(settings, cut, progress.allocations))
}

/// What every pixel still lacks of its allocated `count` once all paths up to the end of `done` are traced.
pub fn pending(count: &[u32], done: &PathRange) -> Vec<u32> {
    let (round, rounds) = (u64::from(done.round), u64::from(done.rounds));
    let end = done.first + u64::from(done.paths);
    // Of the first `paths` of the list: those of all earlier rounds, and those of this one.
    let traced = |paths: u64| {
        let before = paths / rounds * round + (paths % rounds).min(round);
        before + of_round(paths, done.round, done.rounds).min(end)
    };
    let mut listed = 0;
    let lacks = |&n: &u32| {
        let before = traced(listed);
        listed += u64::from(n);
        n - (traced(listed) - before) as u32
    };
    count.iter().map(lacks).collect()
}

#[cfg(test)]
mod tests {
    use super::super::example::{CUT, list, settings};
    use super::*;

    #[test]
    fn what_is_left_is_the_rest() {
        let s = settings("variance", 8, 2, 0, 3);
        let first_round: Vec<_> = rounds(&s, &CUT, 0).collect();
        assert!(list(&s, &CUT).ends_with(&first_round));
        let rest: Vec<_> = rest(&s, &CUT, Progress { allocations: 1, pending: 40 }).collect();
        assert_eq!(rest.iter().take(3).map(Step::paths).collect::<Vec<_>>(), [17, 17, 6]);
        assert_eq!(rest[3..], rounds(&s, &CUT, 1).collect::<Vec<_>>());
    }

    /// Also with more rounds than there are samples to place, most of which place none.
    #[test]
    fn a_render_that_goes_on_makes_the_allocations_that_are_left() {
        for count in [1, 4, 300] {
            let s = settings("variance", 2, 1, 0, count);
            let all: Vec<_> = rounds(&s, &CUT, 0).collect();
            let made: Vec<_> = (0..all.len()).filter(|&i| matches!(all[i], Step::Allocate(_))).collect();
            for (done, &first) in made.iter().enumerate() {
                let left: Vec<_> = rounds(&s, &CUT, done as u32).collect();
                assert_eq!(left, all[first..], "{done} of {count} rounds are done");
            }
        }
    }

    #[test]
    fn pending_is_what_was_not_dealt_yet() {
        // Paths 0 1 2 | 3 | 4 5 6 of pixels 0, 1, 2 and 3 (which has none), dealt to two rounds: 0 2 4 6, then 1 3 5.
        let count = [3, 1, 3, 0];
        let done = |first, paths, round| pending(&count, &PathRange { first, paths, round, rounds: 2 });
        assert_eq!(done(0, 0, 0), count);
        assert_eq!(done(1, 2, 0), [1, 1, 2, 0], "0, 2 and 4 are traced");
        assert_eq!(done(0, 1, 1), [0, 1, 1, 0]);
        assert_eq!(done(2, 1, 1), [0; 4]);
    }
}
