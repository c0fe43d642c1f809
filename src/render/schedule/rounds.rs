//! The rounds of a render: first the samples that every pixel gets, then those that a policy places.
use super::cut::{Cut, REFILLS, deal, uniform};
use super::{Batch, Choice, Plan, Share, Step};
use crate::render::settings::{Placing, Settings};
use std::iter::once;

/// The whole of a render: first `min_spp` samples for every pixel, in an order that refines the picture evenly, then
/// rounds that place the rest.
pub fn steps(settings: &Settings, cut: &Cut) -> impl Iterator<Item = Step> + use<> {
    let even = uniform(cut, settings.first_sample, first_spp(settings)).map(Step::Uniform);
    once(Step::Start).chain(even).chain(rounds(settings, cut, 0))
}

/// All samples for one pixel, and none for the others.
pub fn steps_of_pixel(settings: &Settings, cut: &Cut, pixel: u32) -> impl Iterator<Item = Step> + use<> {
    let alone = Cut { pixels: 1, tile: 1, ..*cut };
    let batches = uniform(&alone, settings.first_sample, settings.spp);
    once(Step::Start).chain(batches.map(move |batch| Step::Uniform(Batch { first_pixel: pixel, ..batch })))
}

/// Samples that every pixel gets before any is placed. With a noise threshold, `max_spp` limits them where it is given, not `spp`.
pub fn first_spp(settings: &Settings) -> u32 {
    let most = if settings.allocate.has_threshold() { limit(settings) } else { settings.spp };
    if settings.allocate.is_even() { settings.spp } else { settings.allocate.min_spp.min(most) }
}

/// Largest number of samples of a pixel; where samples are chosen, of those that a threshold decides.
pub fn limit(settings: &Settings) -> u32 {
    let chosen = settings.allocate.policy.placing == Placing::Chosen;
    match (settings.allocate.max_spp, settings.allocate.has_threshold() || chosen) {
        (0, true) => settings.spp,
        (0, false) => Settings::MAX_SPP,
        (max, _) => max,
    }
}

pub(super) fn rounds(settings: &Settings, cut: &Cut, done: u32) -> Box<dyn Iterator<Item = Step>> {
    match settings.allocate.policy.placing {
        Placing::Chosen => Box::new(choices(settings, cut, done)),
        Placing::Learning if settings.allocate.has_threshold() => Box::new(needed(settings, cut, done)),
        placing => {
            let placed = u64::from(first_spp(settings)) * u64::from(cut.pixels);
            Box::new(allocated(settings, placing == Placing::Learning, cut, done, Begun { placed, carried: 0 }))
        }
    }
}

/// What a frame begins with, before any of its rounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Begun {
    /// Samples of the frame that its pixels have got, or are about to get, for their least number.
    pub placed: u64,
    /// Samples of earlier frames.
    pub carried: u64,
}

/// The rest of a frame that begins with samples of earlier ones: what its pixels lack of their least number is listed, and then all
/// that is left of its budget is placed. Of policies that place a budget.
pub fn frame(settings: &Settings, cut: &Cut, begun: Begun) -> impl Iterator<Item = Step> + use<> {
    let learns = settings.allocate.policy.placing == Placing::Learning;
    deal(begun.placed, 1, cut).chain(allocated(settings, learns, cut, 0, begun))
}

/// As the paper has it: the threshold is 1 after the least number of samples and falls to 0 at the largest.
fn choices(settings: &Settings, cut: &Cut, done: u32) -> impl Iterator<Item = Step> + use<> {
    let (least, most) = (first_spp(settings), limit(settings));
    let cut = *cut;
    let pixels = cut.pixels;
    (least + done..settings.spp).flat_map(move |round| {
        let falling = 1.0 - (round - least) as f32 / most.saturating_sub(least).max(1) as f32;
        let threshold = if round < most { falling } else { 0.0 };
        once(Step::Choose(Choice { pixels, round, threshold })).chain(deal(u64::from(pixels), 1, &cut))
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
    let cut = *cut;
    let pixels = cut.pixels;
    let budget = u64::from(look) * u64::from(pixels);
    let share = Share::Need { threshold: settings.allocate.noise_threshold, limit };
    let plan = Plan { pixels, budget, limit: None, share, rounds: 1 };
    (done..rounds).flat_map(move |_| once(Step::Allocate(plan)).chain(deal(budget, 1, &cut)))
}

fn allocated(
    settings: &Settings,
    learns: bool,
    cut: &Cut,
    done: u32,
    Begun { placed: first, carried }: Begun,
) -> impl Iterator<Item = Step> + use<> {
    let cut = *cut;
    let pixels = cut.pixels;
    let rest = (u64::from(settings.spp) * u64::from(pixels)).saturating_sub(first);
    let rounds = round_count(settings, learns, (rest / u64::from(pixels.max(1))) as u32);
    let (all, dealt) = if learns { (rounds, 1) } else { (1, rounds) };
    let limit = limit(settings);
    let room = u64::from(limit) * u64::from(pixels);
    let upto = move |round: u32| ((rest as u128 * u128::from(round) / u128::from(all)) as u64 + first).min(room);
    let budgets = (0..all).map(move |round| (upto(round + 1) - upto(round), upto(round + 1)));
    // Rounds that place nothing are not made, nor counted among those that are done.
    budgets.filter(|&(budget, _)| budget > 0).skip(done as usize).flat_map(move |(budget, total)| {
        let fills = u64::from(limit) < total; // one pixel might take them all
        let plan = Plan {
            pixels,
            budget,
            limit: fills.then_some(limit),
            share: if learns { Share::All(total + carried) } else { Share::Next },
            rounds: if fills { REFILLS } else { 1 },
        };
        once(Step::Allocate(plan)).chain(deal(budget, dealt, &cut))
    })
}

#[cfg(test)]
mod tests {
    use super::super::PathRange;
    use super::super::example::{CUT, list, settings, sums};
    use super::super::{Progress, rest};
    use super::*;

    #[test]
    fn policies_that_learn_look_again_where_it_is_worth_it() {
        let looks = |policy: &str, spp: u32, rounds: u32| {
            list(&settings(policy, spp, 1, 0, rounds), &CUT).iter().filter(|s| matches!(s, Step::Allocate(_))).count()
        };
        assert_eq!([2, 6, 7, 8, 10, 13, 32].map(|spp| looks("both", spp, 0)), [1, 2, 3, 3, 4, 4, 4]);
        assert_eq!([looks("geometry", 32, 0), looks("both", 8, 5)], [1, 5]);
        let dealt = |rounds: u32| {
            let steps = list(&settings("geometry", 12, 1, 0, rounds), &CUT);
            steps.iter().any(|s| matches!(s, Step::Listed(range) if range.round > 0))
        };
        assert!(!dealt(0) && dealt(2), "few samples that do not learn are dealt to rounds only when asked for");
    }

    #[test]
    fn the_least_number_of_samples_is_a_part_of_the_budget_where_there_is_one() {
        let first = |threshold: f32| {
            let mut settings = settings("variance", 64, 128, 4096, 0);
            settings.allocate.noise_threshold = threshold;
            first_spp(&settings)
        };
        assert_eq!([first(0.0), first(0.1)], [64, 128]);
    }

    /// Whenever it stops, be it the first time or once it has gone on. A round of all samples would end at the last pixel.
    #[test]
    fn a_picture_is_refined_evenly() {
        const TOTAL: u32 = 1000;
        let even = |steps: Vec<Step>| {
            let (mut count, mut seen) = (0, 0);
            for step in &steps {
                match step {
                    Step::Allocate(plan) => count = (plan.budget / 65) as u32,
                    Step::Listed(range) => {
                        let lacks = super::super::pending(&[count; 65], range);
                        let [least, most] = [lacks.iter().min(), lacks.iter().max()].map(Option::unwrap);
                        assert!(most - least <= 16, "a round has 8, and 7 are left over: {least} to {most} of {count}");
                        seen = seen.max(count - most);
                    }
                    _ => count = TOTAL,
                }
            }
            assert!(seen > 100, "control: {seen}");
            let paths: u64 = steps.iter().map(Step::paths).sum();
            assert!(steps.len() as u64 <= paths.div_ceil(CUT.paths.into()) * 11 / 10, "{} steps", steps.len());
        };
        for policy in ["both", "geometry"] {
            even(list(&settings(policy, TOTAL, 1, 0, 0), &CUT));
        }
        let pending = u64::from(TOTAL) * 65;
        let resumed = rest(&settings("uniform", TOTAL, 1, 0, 0), &CUT, Progress { allocations: 0, pending });
        even(once(Step::Start).chain(resumed).collect());
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
