//! What the page of a cost measurement says of runs that scatter: slow runs, fireflies, and seeds that miss a goal.
use crate::cost;
use tallow::cost::document::{Finding, Point, Verdict};
use tallow::cost::findings::findings;
use tallow::cost::summary::summarise;

/// A point of the method with a run for each time and relMSE.
fn point(allocate: &str, spp: u32, runs: &[(f64, f64)]) -> Point {
    let run = |(seed, &(gpu_ms, relmse))| cost::run(seed, gpu_ms, relmse);
    cost::point(allocate, spp, (0..).zip(runs).map(run).collect())
}

/// Points of 1, 4, 16 ... samples per pixel that take 10 ms each, of a method whose relMSE is this times 1, 1/4, 1/16 ... in five runs that
/// differ by a percent.
fn method(allocate: &str, error: f64, points: u32) -> Vec<Point> {
    let one = |i: u32| {
        let n = f64::from(4_u32.pow(i));
        let runs: Vec<_> =
            (0..5).map(|seed| (10.0 * n, error / n * (1.0 + 0.01 * f64::from((seed * 7 + i) % 5)))).collect();
        point(allocate, 4_u32.pow(i), &runs)
    };
    (0..points).map(one).collect()
}

fn found(mut points: Vec<Point>) -> (Vec<Point>, Vec<Finding>) {
    summarise(&mut points);
    let found = findings(&points);
    (points, found)
}

fn with<'a>(found: &'a [Finding], words: &str) -> Vec<&'a Finding> {
    found.iter().filter(|finding| finding.text.contains(words)).collect()
}

#[test]
fn a_slow_run_leaves_its_method_among_the_best() {
    let mut points = [method("uniform", 1.0, 3), method("worse", 2.0, 3), method("better", 0.1, 3)].concat();
    points[6..].iter_mut().for_each(|point| point.runs[3].gpu_ms *= 20.0);
    let (_, found) = found(points);
    let lowest = with(&found, "the lowest relMSE");
    assert!(!lowest.is_empty() && lowest.iter().all(|f| f.text.contains("better")), "{found:#?}");
}

#[test]
fn a_method_that_ends_keeps_its_last_image() {
    let short = |error| [method("uniform", 1.0, 4), method("worse", 2.0, 4), method("short", error, 2)].concat();
    // 0.01 / 4 from 40 ms on, where the others end at 1 / 64.
    let (_, of_better) = found(short(0.01));
    let lowest = with(&of_better, "the lowest relMSE");
    assert!(!lowest.is_empty() && lowest.iter().all(|f| f.text.contains("short has")), "{of_better:#?}");
    // As good as the best while it lasts, it might have gone on like them: where they are told and where they are tied.
    let mut points = short(1.0);
    for last in [points.clone(), {
        points.extend(method("twin", 1.0, 4));
        points
    }] {
        let (_, found) = found(last);
        let lowest = with(&found, "the lowest relMSE");
        assert!(lowest.len() > 1 && lowest.iter().all(|f| f.text.contains("short")), "{found:#?}");
    }
}

#[test]
fn a_goal_that_a_seed_misses_is_reached_by_the_others() {
    let runs = |ms: f64, errors: &[f64]| errors.iter().map(|&error| (ms, error)).collect::<Vec<_>>();
    let points = vec![
        point("ours", 4, &runs(26.0, &[0.0324, 0.0284, 0.0392, 0.0297, 0.0352])),
        point("ours", 16, &runs(68.0, &[0.0037, 0.0069, 0.0108, 0.0031, 0.0039])),
        point("rival", 4, &runs(70.0, &[0.0135, 0.0133, 0.0156])),
        point("rival", 16, &runs(165.0, &[0.0058, 0.0058, 0.0085])),
    ];
    let (_, found) = found(points);
    let goal = with(&found, "relMSE 0.010 takes")[0];
    assert!(goal.text.contains("ours, the fastest") || goal.text.contains("between ours"), "{found:#?}");
    assert!(goal.text.contains("4 of its 5 seeds"), "{}", goal.text);
}

#[test]
fn uniform_rendering_is_as_fast_as_itself_and_fireflies_do_not_turn_its_curve() {
    // A firefly at 4 samples per pixel in the seeds 1 and 2.
    let uniform = |firefly: f64| {
        let middle = [(40.0, 0.25), (40.0, firefly), (40.0, firefly)];
        vec![
            point("uniform", 1, &[(10.0, 1.0); 3]),
            point("uniform", 4, &middle),
            point("uniform", 16, &[(160.0, 0.06); 3]),
        ]
    };
    let points = [uniform(2.0), vec![point("other", 4, &[(20.0, 0.9), (20.0, 1.2), (20.0, 1.2)])]].concat();
    let (points, _) = found(points);
    let speed_up = |point: &Point| point.summary.as_ref().unwrap().speed_up;
    for point in &points[..3] {
        let factor = speed_up(point).unwrap();
        assert_eq!((factor.estimate.value, factor.extrapolated), (1.0, false), "{factor:?}");
    }
    let other = speed_up(&points[3]).unwrap();
    assert!(
        !other.extrapolated && other.estimate.value > 1.0,
        "1.2 is below the 1.4 that 1 and 2 level out at: {other:?}"
    );
    // What does not fall tells no time.
    let flat = [&uniform(3.0)[..2], &points[3..]].concat();
    assert_eq!(speed_up(&found(flat).0[2]), None);
}

#[test]
fn intervals_of_errors_cover_what_scatters_by_a_logarithm() {
    const TRIALS: usize = 400;
    let mut random = fastrand::Rng::with_seed(4);
    // Of deviation 1.5.
    let mut normal = || 1.5 * ((0..12).map(|_| random.f64()).sum::<f64>() - 6.0);
    let covers = |_: &usize| {
        let runs: Vec<_> = (0..5).map(|_| (10.0, normal().exp())).collect();
        let (points, _) = found(vec![point("uniform", 1, &runs)]);
        let summary = points[0].summary.as_ref().unwrap();
        let [relmse, inefficiency] = [summary.errors.relmse, summary.inefficiency].map(Option::unwrap);
        assert!(relmse.low.unwrap() > 0.0 && inefficiency.low.unwrap() > 0.0, "{relmse:?}");
        relmse.low.unwrap() < 1.0 && 1.0 < relmse.high.unwrap()
    };
    let covered = (0..TRIALS).filter(covers).count();
    // 95 %, and 1 % of that is the deviation of such a count.
    assert!((368..=392).contains(&covered), "{covered} of {TRIALS}");
}

#[test]
fn runs_that_carry_the_mean_are_named() {
    let calm = found(method("uniform", 1.0, 2)).1;
    assert!(with(&calm, "fireflies").is_empty(), "{calm:#?}");
    let runs = [0.02, 0.021, 0.019, 0.02, 1.16].map(|error| (10.0, error));
    let (_, found) = found(vec![point("uniform", 1, &[(5.0, 0.1); 5]), point("uniform", 4, &runs)]);
    let named = with(&found, "fireflies");
    assert!(named.len() == 1 && named[0].verdict == Verdict::TooNoisy, "{found:#?}");
    assert!(named[0].text.contains("uniform, 4 spp") && !named[0].text.contains("1 spp"), "{}", named[0].text);
}

#[test]
fn a_factor_of_unknown_magnitude_is_not_printed() {
    let errors = [[0.5, 0.13], [0.1, 0.05]];
    let uniform =
        |i: usize| point("uniform", 4_u32.pow(i as u32), &errors.map(|of| (10.0 * (1 + 3 * i) as f64, of[i])));
    let other =
        |i: usize| point("other", 4_u32.pow(i as u32), &errors.map(|of| (10.0 * (1 + 3 * i) as f64, 0.01 / of[i])));
    let (_, found) = found(vec![uniform(0), uniform(1), other(0), other(1)]);
    let gain = with(&found, "times the relMSE of the best other method")[0];
    assert!(gain.text.contains("cannot be told from 2 runs") && gain.text.contains("are needed"), "{}", gain.text);
}

#[test]
fn a_run_without_error_leaves_its_point_out_and_is_named() {
    let mut points = [method("uniform", 1.0, 3), method("better", 0.1, 3)].concat();
    points[5].runs[2].errors.relmse = Some(0.0);
    let (points, found) = found(points);
    let summary = points[5].summary.as_ref().unwrap();
    assert_eq!((summary.speed_up, summary.error_gain), (None, None), "of four runs of five");
    assert!(summary.errors.relmse.is_some_and(|e| e.value > 0.0 && e.low >= Some(0.0)), "{:?}", summary.errors.relmse);
    let named = with(&found, "no relMSE above the noise of the reference");
    assert!(named.len() == 1 && named[0].text.contains("better, 16 spp"), "{found:#?}");
    assert!(with(&found, "lowest relMSE").iter().all(|f| f.text.contains("better")), "{found:#?}");
}
