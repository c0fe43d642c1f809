//! The order of a render: which samples, when, and when to look where they count. Plain arithmetic, known beforehand.
use crate::render::settings::{Placing, Settings};
use std::iter::{once, successors};

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
    /// Of the film.
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
    /// Of the film.
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
            Self::Start | Self::Allocate(_) | Self::Choose(_) => 0,
            Self::Uniform(b) => u64::from(b.pixels) * u64::from(b.samples),
            Self::Listed(r) => u64::from(r.paths),
        }
    }
}

/// Samples of a pixel in a batch at most: a software device ends loops early (`glsl/shared/loop_limit.glsl`).
const SAMPLES_AT_ONCE: u32 = 1 << 15;

/// Times at most that the samples of full pixels are apportioned again.
const REFILLS: u32 = 16;

/// How the work may be cut. It changes no bit of the result.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    /// Of the film.
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
            Step::Start => true,
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

/// Where a render that stopped early goes on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    /// Allocations that were made.
    pub allocations: u32,
    /// Samples that all pixels together still lack of what they were to have by then.
    pub pending: u64,
}

/// The whole of a render: first `min_spp` samples for every pixel, in an order that refines the picture evenly, then
/// rounds that place the rest.
pub fn steps(settings: &Settings, cut: &Cut) -> impl Iterator<Item = Step> + use<> {
    let even = uniform(cut, settings.first_sample, first_spp(settings)).map(Step::Uniform);
    once(Step::Start).chain(even).chain(rounds(settings, cut, 0))
}

/// The rest of a render whose pixels, their statistics and what they lack were handed back.
pub fn rest(settings: &Settings, cut: &Cut, progress: Progress) -> impl Iterator<Item = Step> + use<> {
    deal(progress.pending, 1, cut.paths).chain(rounds(settings, cut, progress.allocations))
}

/// Samples that every pixel gets before any is placed.
pub fn first_spp(settings: &Settings) -> u32 {
    if settings.allocate.is_even() { settings.spp } else { settings.allocate.min_spp.min(settings.spp) }
}

/// Largest number of samples of a pixel; where samples are chosen, of those that a threshold decides.
pub fn limit(settings: &Settings) -> u32 {
    let chosen = settings.allocate.policy.placing == Placing::Chosen;
    match (settings.allocate.max_spp, settings.allocate.noise_threshold > 0.0 || chosen) {
        (0, true) => settings.spp,
        (0, false) => Settings::MAX_SPP,
        (max, _) => max,
    }
}

/// Whether only the device knows how many paths of a list there are to trace: where pixels are chosen, and where a noise
/// threshold may ask for less than its round has room for.
pub fn list_may_be_short(settings: &Settings) -> bool {
    let allocate = &settings.allocate;
    allocate.policy.placing == Placing::Chosen || allocate.noise_threshold > 0.0
}

fn rounds(settings: &Settings, cut: &Cut, done: u32) -> Box<dyn Iterator<Item = Step>> {
    match settings.allocate.policy.placing {
        Placing::Chosen => Box::new(choices(settings, cut, done)),
        Placing::Learning if settings.allocate.noise_threshold > 0.0 => Box::new(needed(settings, cut, done)),
        placing => Box::new(allocated(settings, placing == Placing::Learning, cut, done)),
    }
}

/// As the paper has it: the threshold is 1 after the least number of samples and falls to 0 at the largest.
fn choices(settings: &Settings, cut: &Cut, done: u32) -> impl Iterator<Item = Step> + use<> {
    let (least, most) = (first_spp(settings), limit(settings));
    let Cut { pixels, paths, .. } = *cut;
    (least + done..settings.spp).flat_map(move |round| {
        let falling = 1.0 - (round - least) as f32 / most.saturating_sub(least).max(1) as f32;
        let threshold = if round < most { falling } else { 0.0 };
        once(Step::Choose(Choice { pixels, round, threshold })).chain(deal(u64::from(pixels), 1, paths))
    })
}

/// Samples a pixel that a round is worth: deciding and adding up take as long as one to two samples of a simple scene.
const WORTH: u32 = 2;

/// Rounds for `rest` samples a pixel to place.
fn round_count(settings: &Settings, learns: bool, rest: u32) -> u32 {
    match settings.allocate.rounds {
        0 if learns => (rest / WORTH).clamp(1, 4),
        rounds => rounds.max(1),
    }
}

/// Samples a pixel, on average, between two looks at what a threshold still needs.
const LOOK: u32 = 4;

/// Rounds of at most [`LOOK`] samples a pixel, and as many more as a pixel that always gets its need can double its samples.
fn needed(settings: &Settings, cut: &Cut, done: u32) -> impl Iterator<Item = Step> + use<> {
    let limit = limit(settings);
    let rest = limit.saturating_sub(first_spp(settings));
    let look = rest.div_ceil(round_count(settings, true, rest)).min(LOOK);
    let rounds = if rest == 0 { 0 } else { rest.div_ceil(look) + u32::BITS };
    let Cut { pixels, paths, .. } = *cut;
    let budget = u64::from(look) * u64::from(pixels);
    let share = Share::Need { threshold: settings.allocate.noise_threshold, limit };
    let plan = Plan { pixels, budget, limit: None, share, rounds: 1 };
    (done..rounds).flat_map(move |_| once(Step::Allocate(plan)).chain(deal(budget, 1, paths)))
}

fn allocated(settings: &Settings, learns: bool, cut: &Cut, done: u32) -> impl Iterator<Item = Step> + use<> {
    let Cut { pixels, paths, .. } = *cut;
    let first = u64::from(first_spp(settings)) * u64::from(pixels);
    let rest = (u64::from(settings.spp) * u64::from(pixels)).saturating_sub(first);
    let rounds = round_count(settings, learns, settings.spp - first_spp(settings));
    let (all, dealt) = if learns { (rounds, 1) } else { (1, rounds) };
    let limit = limit(settings);
    let room = u64::from(limit) * u64::from(pixels);
    let upto = move |round: u32| ((rest as u128 * u128::from(round) / u128::from(all)) as u64 + first).min(room);
    let budgets = (done..all).map(move |round| (upto(round + 1) - upto(round), upto(round + 1)));
    budgets.filter(|&(budget, _)| budget > 0).flat_map(move |(budget, total)| {
        let fills = u64::from(limit) < total; // one pixel might take them all
        let plan = Plan {
            pixels,
            budget,
            limit: fills.then_some(limit),
            share: if learns { Share::All(total) } else { Share::Next },
            rounds: if fills { REFILLS } else { 1 },
        };
        once(Step::Allocate(plan)).chain(deal(budget, dealt, paths))
    })
}

/// What every pixel still lacks of its allocated `count` once all paths up to the end of `done` are traced.
pub fn pending(count: &[u32], done: &PathRange) -> Vec<u32> {
    let rounds = u64::from(done.rounds);
    // Of the first `paths` of the list, those that belong to a round.
    let in_round = |paths: u64, round: u32| (paths + rounds - 1 - u64::from(round)) / rounds;
    let end = done.first + u64::from(done.paths);
    let traced = |paths: u64| {
        let before: u64 = (0..done.round).map(|round| in_round(paths, round)).sum();
        before + in_round(paths, done.round).min(end)
    };
    let mut listed = 0;
    let lacks = |&n: &u32| {
        let before = traced(listed);
        listed += u64::from(n);
        n - (traced(listed) - before) as u32
    };
    count.iter().map(lacks).collect()
}

/// Deals `paths` listed paths to rounds, path j to round j mod `rounds`, and cuts each round into batches.
fn deal(paths: u64, rounds: u32, batch: u32) -> impl Iterator<Item = Step> + use<> {
    (0..rounds).flat_map(move |round| {
        let mine = (paths + u64::from(rounds - 1 - round)) / u64::from(rounds);
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
            first_sample: first + sample,
            samples: depth.min(samples - sample),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::settings::Allocate;

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

    fn settings(policy: &str, spp: u32, min_spp: u32, max_spp: u32, rounds: u32) -> Settings {
        let allocate = Allocate {
            policy: crate::allocate::policy(policy).unwrap(),
            min_spp,
            max_spp,
            rounds,
            ..Allocate::default()
        };
        Settings { spp, allocate, ..Settings::default() }
    }

    const CUT: Cut = Cut { pixels: 65, tile: 100, paths: 17 };

    fn list(settings: &Settings, cut: &Cut) -> Vec<Step> {
        steps(settings, cut).collect()
    }

    #[test]
    fn policies_that_learn_look_again_where_it_is_worth_it() {
        let looks = |policy: &str, spp: u32, rounds: u32| {
            list(&settings(policy, spp, 1, 0, rounds), &CUT).iter().filter(|s| matches!(s, Step::Allocate(_))).count()
        };
        assert_eq!([2, 6, 7, 8, 10, 13, 32].map(|spp| looks("both", spp, 0)), [1, 2, 3, 3, 4, 4, 4]);
        assert_eq!([looks("geometry", 32, 0), looks("both", 8, 5)], [1, 5]);
        let dealt = |rounds: u32| {
            let steps = list(&settings("geometry", 32, 1, 0, rounds), &CUT);
            steps.iter().any(|s| matches!(s, Step::Listed(range) if range.round > 0))
        };
        assert!(!dealt(0) && dealt(2), "what does not learn is dealt to rounds only when asked for");
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

    fn sums(steps: &[Step]) -> (u64, u64) {
        let budget = |s: &Step| if let Step::Allocate(plan) = s { plan.budget } else { 0 };
        (steps.iter().map(Step::paths).sum(), steps.iter().map(budget).sum())
    }

    #[test]
    fn all_of_the_budget_is_traced_and_no_more() {
        for policy in ["geometry", "variance"] {
            for (spp, min, rounds) in [(4, 1, 1), (4, 4, 3), (1, 2, 1), (7, 0, 5), (3, 1, 300)] {
                let all = list(&settings(policy, spp, min, 0, rounds), &CUT);
                let (traced, allocated) = sums(&all);
                assert_eq!(traced, 65 * u64::from(spp), "{policy} {spp} {min} {rounds}");
                assert_eq!(allocated, 65 * u64::from(spp - min.min(spp)));
            }
        }
        let capped = list(&settings("variance", 8, 2, 5, 4), &CUT);
        assert_eq!(sums(&capped), (65 * 5, 65 * 3), "no more than there is room");
        assert_eq!(sums(&list(&settings("uniform", 3, 2, 0, 4), &CUT)), (65 * 3, 0));
    }

    #[test]
    fn a_noise_threshold_looks_often_and_for_long_enough() {
        let of = |spp, min, rounds| {
            let mut s = settings("variance", spp, min, 0, rounds);
            s.allocate.noise_threshold = 0.1;
            s
        };
        let looks = |s: &Settings| {
            steps(s, &CUT).filter_map(|step| if let Step::Allocate(plan) = step { Some(plan) } else { None }).collect()
        };
        // 32 doublings fill any count; before, every round may be spent to the end.
        for (spp, min, rounds, look, count) in [(16, 4, 1, 4, 3), (16, 4, 6, 2, 6), (7, 4, 1, 3, 1), (15, 4, 1, 4, 3)] {
            let plans: Vec<Plan> = looks(&of(spp, min, rounds));
            assert_eq!(plans.len(), count + 32, "{spp} {min} {rounds}");
            let share = Share::Need { threshold: 0.1, limit: spp };
            let round = Plan { pixels: 65, budget: 65 * look, limit: None, share, rounds: 1 };
            assert!(plans.iter().all(|&p| p == round), "{plans:?}");
        }
        assert!(looks(&of(4, 4, 1)).is_empty());
        let s = of(16, 4, 1);
        assert!(rest(&s, &CUT, Progress { allocations: 34, pending: 0 }).eq(needed(&s, &CUT, 34)));
        assert_eq!(needed(&s, &CUT, 34).count(), 1 + 65 * 4 / 17 + 1);
    }

    #[test]
    fn what_is_left_is_the_rest() {
        let s = settings("variance", 8, 2, 0, 3);
        let first_round: Vec<_> = rounds(&s, &CUT, 0).collect();
        assert!(list(&s, &CUT).ends_with(&first_round));
        let rest: Vec<_> = rest(&s, &CUT, Progress { allocations: 1, pending: 40 }).collect();
        assert_eq!(rest.iter().take(3).map(Step::paths).collect::<Vec<_>>(), [17, 17, 6]);
        assert_eq!(rest[3..], rounds(&s, &CUT, 1).collect::<Vec<_>>());
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

    #[test]
    fn a_threshold_falls_from_one_and_is_followed_by_chance() {
        let all = list(&settings("threshold", 8, 2, 6, 4), &CUT);
        let chosen = |s: &Step| if let Step::Choose(c) = s { Some((c.round, c.threshold)) } else { None };
        let rounds: Vec<_> = all.iter().filter_map(chosen).collect();
        assert_eq!(rounds, [(2, 1.0), (3, 0.75), (4, 0.5), (5, 0.25), (6, 0.0), (7, 0.0)]);
        assert_eq!(sums(&all), (65 * 8, 0), "everyone may be chosen every time");
        let rest = rest(&settings("threshold", 8, 2, 6, 4), &CUT, Progress { allocations: 5, pending: 0 });
        assert_eq!(rest.filter_map(|step| chosen(&step)).collect::<Vec<_>>(), [(7, 0.0)]);
        let step = Step::Listed(PathRange { first: 17, paths: 17, round: 0, rounds: 1 });
        assert_eq!([0, 17, 18, 99].map(|n| step.within(n).map(|s| s.paths())), [None, None, Some(1), Some(17)]);
    }

    #[test]
    fn budgets_beyond_32_bits_are_kept() {
        let cut = Cut { pixels: 1 << 20, tile: 1 << 28, paths: 1 << 30 };
        let all = list(&settings("geometry", 1 << 16, 0, 0, 2), &cut);
        assert_eq!(sums(&all), (1 << 36, 1 << 36));
    }
}
