//! The judgement of cost measurements, on made-up runs whose truth is known.
use tallow::cost::document::{Errors, Estimate, Finding, Method, Point, Run, Verdict};
use tallow::cost::findings::findings;
use tallow::cost::judge::{Noise, judge};
use tallow::cost::reference::noise_of;
use tallow::cost::summary::{front, summarise};
use tallow::image::Picture;
use tallow::image::metrics::{hdr_flip, relmse};

const SPP: [u32; 4] = [1, 4, 16, 64];

/// How a made-up method behaves: 10 ms and an error of 1 for one sample per pixel, times these factors.
#[derive(Clone, Copy)]
struct Truth {
    allocate: &'static str,
    time: f64,
    error: f64,
}

const UNIFORM: Truth = Truth { allocate: "uniform", time: 1.0, error: 1.0 };

/// Relative noise of the times and of the errors between runs.
#[derive(Clone, Copy)]
struct Spread {
    time: f64,
    error: f64,
}

struct Normal(fastrand::Rng);

impl Normal {
    /// Exponential of a normal number of this standard deviation.
    fn factor(&mut self, deviation: f64) -> f64 {
        let (u, v) = (self.0.f64().max(1e-12), self.0.f64());
        (deviation * (-2.0 * u.ln()).sqrt() * (2.0 * std::f64::consts::PI * v).cos()).exp()
    }
}

pub fn run(seed: u32, gpu_ms: f64, relmse: f64) -> Run {
    let errors = Errors { relmse: Some(relmse), ..Errors::default() };
    Run { seed, gpu_ms, wall_ms: gpu_ms, samples: 1, errors, ..Run::default() }
}

pub fn point(allocate: &str, spp: u32, runs: Vec<Run>) -> Point {
    let method = Method { allocate: allocate.into(), filter: "none".into(), spp, ..Method::default() };
    Point { runs, ..Point::unmeasured(method, String::new()) }
}

/// Points of several methods. `same_images`: all methods have the errors of the first, run by run.
fn points(truths: &[Truth], spread: Spread, same_images: bool, seed: u64) -> Vec<Point> {
    let mut all: Vec<Point> = Vec::new();
    for (index, &truth) in truths.iter().enumerate() {
        let mut times = Normal(fastrand::Rng::with_seed(seed + 1000 * index as u64));
        let error_seed = if same_images { seed } else { seed + 77 + index as u64 };
        let mut errors = Normal(fastrand::Rng::with_seed(error_seed));
        for spp in SPP {
            let n = f64::from(spp);
            let one = |seed| {
                let ms = 10.0 * n * truth.time * times.factor(spread.time);
                run(seed, ms, truth.error / n * errors.factor(spread.error))
            };
            let runs = (0..5).map(one).collect();
            all.push(point(truth.allocate, spp, runs));
        }
    }
    summarise(&mut all);
    all
}

fn winners(findings: &[Finding]) -> Vec<&str> {
    let names =
        |f: &&Finding| f.verdict == Verdict::Clear && (f.text.contains("lowest") || f.text.contains("the fastest"));
    findings.iter().filter(names).map(|f| f.text.as_str()).collect()
}

#[test]
fn the_same_images_under_two_names_have_no_winner() {
    let twin = Truth { allocate: "twin", ..UNIFORM };
    let spread = Spread { time: 0.03, error: 0.1 };
    let named = |same_images| {
        let is_named = |seed: &u64| {
            let points = points(&[UNIFORM, twin], spread, same_images, 31 * seed);
            !winners(&findings(&points)).is_empty()
        };
        (0..200_u64).filter(is_named).count()
    };
    // Times and goals are one family of comparisons each, of at most 5 %.
    let (same, other) = (named(true), named(false));
    assert!(same <= 20 && other <= 20, "of 200: {same} with the same images, {other} with images of the same noise");
    // Control: 20 % less error is found.
    let better = Truth { error: 0.8, ..twin };
    let points = points(&[UNIFORM, better], Spread { time: 0.01, error: 0.02 }, false, 5);
    let found = findings(&points);
    assert!(winners(&found).iter().all(|text| text.contains("twin")) && !winners(&found).is_empty(), "{found:#?}");
}

/// Times that may be a thousand times as long or as short are no finding.
#[test]
fn times_of_no_magnitude_are_told_as_such() {
    let of = |error: f64| findings(&points(&[UNIFORM], Spread { time: 0.01, error }, false, 3));
    let times = |f: &&Finding| f.text.starts_with("relMSE ") && f.text.contains(" takes ");
    let (vague, sharp) = (of(6.0), of(0.1));
    assert!(sharp.iter().filter(times).count() > 0, "control: {sharp:#?}");
    assert!(sharp.iter().filter(times).all(|f| f.verdict == Verdict::Clear && f.text.contains(" to ")), "{sharp:#?}");
    let vague: Vec<_> = vague.iter().filter(times).filter(|f| f.text.contains("too few runs to tell")).collect();
    assert!(!vague.is_empty() && vague.iter().all(|f| f.verdict == Verdict::TooNoisy), "{vague:#?}");
}

#[test]
fn ties_are_said_to_be_ties() {
    let twin = Truth { allocate: "twin", ..UNIFORM };
    let points = points(&[UNIFORM, twin], Spread { time: 0.0, error: 0.0 }, true, 1);
    let found = findings(&points);
    assert!(winners(&found).is_empty(), "{found:#?}");
    let tie = |f: &Finding| f.verdict == Verdict::TooNoisy && f.text.contains("cannot tell between uniform and twin");
    assert!(found.iter().any(tie), "{found:#?}");
}

#[test]
fn a_method_slowed_by_a_known_factor_gives_that_factor() {
    let slow = Truth { allocate: "slow", time: 1.3, error: 1.0 };
    let mut covered = 0;
    for seed in 0..50 {
        let points = points(&[UNIFORM, slow], Spread { time: 0.02, error: 0.05 }, true, 9000 + seed);
        for point in &points[4..] {
            let summary = point.summary.as_ref().unwrap();
            let Estimate { value, low, high } = summary.speed_up.unwrap().estimate;
            assert!((value * 1.3 - 1.0).abs() < 0.05, "{value}");
            covered += usize::from(low.unwrap() < 1.0 / 1.3 && high.unwrap() > 1.0 / 1.3);
            let gain = summary.error_gain.unwrap().estimate.value;
            assert!((gain * 1.3 - 1.0).abs() < 0.05, "{gain}");
        }
    }
    // The intervals are of 95 %.
    assert!((180..=199).contains(&covered), "{covered} of 200 intervals hold the factor");
    let points = points(&[UNIFORM, slow], Spread { time: 0.02, error: 0.05 }, true, 9);
    let own = points[2].summary.as_ref().unwrap().speed_up.unwrap();
    assert!((own.estimate.value - 1.0).abs() < 1e-9 && !own.extrapolated);
    assert_eq!(front(&points), [0, 1, 2, 3], "the slow one is nowhere on the front");
}

fn gain(findings: &[Finding]) -> &Finding {
    findings.iter().find(|f| f.text.contains("times the relMSE of the best other method")).unwrap()
}

/// Lower end of the interval of what is gained at least; 0 if that cannot be told.
fn least_gain(finding: &Finding) -> f64 {
    if finding.text.contains("cannot be told") {
        return 0.0;
    }
    let (_, behind) = finding.text.split_once("at least ").unwrap();
    let (_, interval) = behind.split_once('(').unwrap();
    interval.split(' ').next().unwrap().parse().unwrap()
}

#[test]
fn the_best_of_many_copies_is_rarely_said_to_gain() {
    const TRIALS: u64 = 400;
    let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j"];
    let copies = names.map(|allocate| Truth { allocate, ..UNIFORM });
    let truths = [&[UNIFORM], &copies[..]].concat();
    let exact = points(&truths, Spread { time: 0.0, error: 0.0 }, true, 0);
    let gains = |seed: &u64| {
        let mut noise = Normal(fastrand::Rng::with_seed(*seed));
        let mut points = exact.clone();
        // A seed is as lucky at any number of samples, so that no time makes up for another.
        for method in points.chunks_mut(SPP.len()) {
            let factors: [f64; 5] = std::array::from_fn(|_| noise.factor(0.1));
            let runs = method.iter_mut().flat_map(|point| point.runs.iter_mut().zip(factors));
            runs.for_each(|(run, factor)| run.errors.relmse = run.errors.relmse.map(|relmse| relmse * factor));
        }
        least_gain(gain(&findings(&points))) > 1.0
    };
    // The truth is 1. Its interval may begin above that in 2.5 % of the trials, give or take 0.8 %; by each method's own interval it is
    // 8 %.
    let wrong = (0..TRIALS).filter(gains).count();
    assert!(wrong <= 20, "{wrong} of {TRIALS}");
}

#[test]
fn a_gain_is_told_only_where_its_interval_says_something() {
    let better = Truth { allocate: "better", time: 1.0, error: 0.5 };
    let mut points = points(&[UNIFORM, better], Spread { time: 0.0, error: 0.01 }, false, 6);
    assert_eq!(gain(&findings(&points)).verdict, Verdict::Clear, "twice the error with 1 % of noise");
    for point in &mut points {
        point.runs.truncate(2);
        let scale = if point.method.is_baseline() { 10.0 } else { 1.0 };
        point.runs[1].errors.relmse = point.runs[0].errors.relmse.map(|relmse| relmse * scale);
    }
    let found = findings(&points);
    assert_eq!(gain(&found).verdict, Verdict::TooNoisy, "factors 2 and 20: {}", gain(&found).text);
}

#[test]
fn methods_that_share_no_seed_are_compared_all_the_same() {
    let worse = Truth { allocate: "other", time: 1.0, error: 10.0 };
    let mut points = points(&[UNIFORM, worse], Spread { time: 0.01, error: 0.05 }, false, 8);
    points[4..].iter_mut().flat_map(|point| &mut point.runs).for_each(|run| run.seed += 100);
    let found = findings(&points);
    let named = winners(&found);
    assert!(!named.is_empty() && named.iter().all(|text| text.contains("uniform")), "{found:#?}");
    assert!(found.iter().all(|f| !f.text.contains("cannot tell between")), "{found:#?}");
    // Its factors are of all its runs, too, whether no seed is shared or one.
    for seeds in [[100, 101, 102, 103, 104], [0, 101, 102, 103, 104]] {
        for point in &mut points[4..] {
            point.runs.iter_mut().zip(seeds).for_each(|(run, seed)| run.seed = seed);
        }
        summarise(&mut points);
        let gain = points[5].summary.as_ref().unwrap().error_gain.unwrap().estimate;
        assert!((0.08..0.12).contains(&gain.value) && gain.low < gain.high && gain.low.is_some(), "{gain:?}");
    }
}

#[test]
fn an_option_of_a_point_without_error_is_left_open() {
    for without_error in [0, 1] {
        let mut points = with_options(&[("depth 4", 0.7, 1.1)], Spread { time: 0.01, error: 0.01 }, 12);
        points[without_error].runs[0].errors.relmse = Some(0.0);
        summarise(&mut points);
        let found = findings(&points);
        let is_open = |f: &Finding| f.verdict == Verdict::TooNoisy && f.text.contains("gains by depth 4 the data");
        assert!(found.iter().any(is_open), "{found:#?}");
        let change = points[1].summary.as_ref().unwrap().change.unwrap();
        assert!(change.time.is_some() && change.relmse.is_none() && change.product.is_none(), "{change:?}");
    }
}

#[test]
fn methods_of_known_added_error_are_ranked_so() {
    let added = |allocate, error| Truth { allocate, time: 1.0, error };
    let truths = [added("second", 1.5), UNIFORM, added("third", 2.25)];
    let points = points(&truths, Spread { time: 0.01, error: 0.05 }, false, 4);
    let found = findings(&points);
    let named = winners(&found);
    assert!(named.len() > 2 && named.iter().all(|text| text.contains("uniform")), "{found:#?}");
    // One sample takes all methods equally long, so chance decides which of them is the fastest.
    let front: Vec<usize> = front(&points).into_iter().filter(|i| i % SPP.len() > 0).collect();
    assert_eq!(front, [5, 6, 7]);
    for (first, expected) in [(0, 1.0 / 1.5), (8, 1.0 / 2.25)] {
        let gain = points[first + 2].summary.as_ref().unwrap().error_gain.unwrap().estimate;
        assert!((gain.value / expected - 1.0).abs() < 0.1, "{gain:?} is not {expected}");
    }
    // At the first time nothing else has begun for sure; everywhere the best of the others has 1.5 times the error.
    let gain = gain(&found);
    let words: Vec<f64> = gain.text.split(' ').filter_map(|word| word.parse().ok()).collect();
    assert!(
        gain.text.contains("(second at") && words.iter().filter(|w| (0.6..0.75).contains(*w)).count() == 2,
        "{}",
        gain.text
    );
    // The law of Monte Carlo: half the error for twice the time.
    let halving = found.iter().find(|f| f.text.contains("halve") && f.text.contains("with uniform")).unwrap();
    let factor: f64 = halving.text.split_whitespace().nth(4).unwrap().parse().unwrap();
    assert!((factor - 2.0).abs() < 0.1, "{}", halving.text);
}

/// The points of uniform rendering at 4 samples per pixel, and the same with options that change time and error by known factors.
fn with_options(options: &[(&str, f64, f64)], spread: Spread, seed: u64) -> Vec<Point> {
    let mut all = vec![points(&[UNIFORM], Spread { time: 0.02, error: 0.3 }, false, seed).remove(1)];
    let mut noise = Normal(fastrand::Rng::with_seed(seed));
    for (option, time, error) in options {
        let mut point = all[0].clone();
        point.method.options = vec![format!("--{option}")];
        for run in &mut point.runs {
            run.gpu_ms *= time * noise.factor(spread.time);
            run.errors.relmse = run.errors.relmse.map(|relmse| relmse * error * noise.factor(spread.error));
        }
        all.push(point);
    }
    summarise(&mut all);
    all
}

#[test]
fn what_options_change_is_told_run_by_run() {
    // Errors vary by 30 % from seed to seed, but the options act on each seed alike.
    let options = [("depth 4", 0.7, 1.1), ("same", 1.0, 1.0), ("worse", 0.9, 1.5)];
    let points = with_options(&options, Spread { time: 0.01, error: 0.01 }, 12);
    for (point, (_, time, error)) in points[1..].iter().zip(options) {
        let change = point.summary.as_ref().unwrap().change.unwrap();
        for (found, truth) in [(change.time, time), (change.relmse, error), (change.product, time * error)] {
            let Estimate { value, low, high } = found.unwrap();
            assert!((value / truth - 1.0).abs() < 0.03 && high.unwrap() / low.unwrap() < 1.1, "{value} is not {truth}");
        }
    }
    let found = findings(&points);
    let texts: Vec<_> = found.iter().map(|finding| finding.text.as_str()).collect();
    assert!(texts[0].starts_with("With depth 4, uniform, 4 spp takes 0.70 ("), "{texts:?}");
    assert!(found[1].verdict == Verdict::TooNoisy && texts[1].contains("gains by same the data"), "{texts:?}");
    assert_eq!(texts.len(), 2, "what is worse is no gain, and a single point has no curve: {texts:?}");
}

#[test]
fn options_that_change_nothing_are_rarely_named() {
    let options: Vec<_> = (0..20).map(|_| ("same", 1.0, 1.0)).collect();
    let named = |seed: &u64| {
        let points = with_options(&options, Spread { time: 0.03, error: 0.1 }, *seed);
        findings(&points).iter().any(|finding| finding.text.starts_with("With "))
    };
    let wrong = (0..200).filter(named).count();
    assert!(wrong <= 18, "{wrong} of 200, of which 5 % are allowed");
}

#[test]
fn points_that_failed_are_in_no_comparison() {
    let better = Truth { allocate: "broken", time: 0.1, error: 0.1 };
    let mut points = points(&[UNIFORM, better], Spread { time: 0.01, error: 0.01 }, false, 2);
    points[4..].iter_mut().for_each(|point| point.failed = Some("out of memory".into()));
    assert!(front(&points).iter().all(|&i| i < 4));
    assert!(findings(&points).iter().all(|f| !f.text.contains("broken")));
}

#[test]
fn methods_of_an_interrupted_measurement_are_compared_by_the_points_that_were_run() {
    let better = Truth { allocate: "better", time: 1.0, error: 0.1 };
    let mut points = points(&[UNIFORM, better], Spread { time: 0.01, error: 0.01 }, false, 3);
    (points[4].runs, points[4].summary) = (Vec::new(), None);
    let found = findings(&points);
    assert!(winners(&found).iter().all(|text| text.contains("better")) && !winners(&found).is_empty(), "{found:#?}");
    let alone = findings(&points[..4]);
    assert!(winners(&alone).is_empty(), "a method alone is not the fastest: {alone:#?}");
    points.iter_mut().for_each(|point| point.runs.truncate(1));
    let found = findings(&points);
    assert!(found.iter().all(|finding| finding.verdict == Verdict::TooNoisy), "one seed tells nothing: {found:#?}");
}

fn picture(values: impl Iterator<Item = f32>) -> Picture {
    let pixels: Vec<[f32; 3]> = values.map(|v| [v; 3]).collect();
    Picture { width: 64, height: pixels.len() as u32 / 64, pixels }
}

#[test]
fn the_noise_of_a_reference_is_taken_off() {
    const PIXELS: usize = 64 * 64;
    let mut random = fastrand::Rng::with_seed(3);
    // Of variance 1.
    let mut noise = move || (0..12).map(|_| random.f32()).sum::<f32>() - 6.0;
    let truth = |i: usize| 1.0 + i as f32 / PIXELS as f32;
    let image = picture((0..PIXELS).map(|i| truth(i) + 0.1 * noise()));
    let reference = picture((0..PIXELS).map(|i| truth(i) + 0.05 * noise()));
    let known = noise_of(&reference, &vec![[0.05 * 0.05; 3]; PIXELS]);
    let exact = picture((0..PIXELS).map(truth));
    let corrected = judge(&image, &reference, known);
    let against_truth = judge(&image, &exact, Noise::default());
    let near = |a: Option<f64>, b: Option<f64>| (a.unwrap() / b.unwrap() - 1.0).abs() < 0.03;
    assert!(near(corrected.mse, against_truth.mse), "{corrected:?} {against_truth:?}");
    assert!(near(corrected.relmse, against_truth.relmse), "{corrected:?} {against_truth:?}");
    // Control: as it is, a quarter of the noise comes from the reference.
    assert!(relmse(&image, &reference) / against_truth.relmse.unwrap() > 1.2);
    // An image that is the reference has no negative error.
    assert_eq!(judge(&reference, &reference, known).relmse, Some(0.0));
}

#[test]
fn outliers_are_counted_and_trimmed() {
    let reference = picture((0..64 * 64).map(|_| 1.0));
    let with_fireflies = picture((0..64 * 64).map(|i| if i % 1024 == 5 { 101.0 } else { 1.1 }));
    let errors = judge(&with_fireflies, &reference, Noise::default());
    // 4 of 4096 pixels, which is the largest 0.1 %, rounded down: 4.096.
    assert_eq!(errors.outliers, Some(4.0 / 4096.0));
    assert!((errors.relmse_trimmed.unwrap() - 0.01 / 1.01).abs() < 1e-4, "{errors:?}");
    assert!(errors.relmse.unwrap() > 9.0);
}

#[test]
fn hdr_flip_is_that_of_the_reference_implementation() {
    let pattern = |disturbed: bool, scale: f32| {
        let at = |x: u32, y: u32| {
            let base = ((x * 7 + y * 13) % 31) as f32 / 31.0;
            let pixel = [base, base * base, 1.0 - base];
            let off = 0.05 * (((x * 5 + y * 3) % 7) as f32 / 7.0);
            pixel.map(|v| scale * if disturbed { v * 0.9 + off } else { v })
        };
        Picture { width: 32, height: 24, pixels: (0..24).flat_map(|y| (0..32).map(move |x| at(x, y))).collect() }
    };
    // flip-evaluator 1.7, HDR, automatic exposures. They follow the brightness of the reference.
    for scale in [1.0, 8.0] {
        let flip = hdr_flip(&pattern(true, scale), &pattern(false, scale)).unwrap();
        assert!((flip - 0.148_911).abs() < 1e-5, "{flip}");
    }
    assert_eq!(hdr_flip(&pattern(false, 1.0), &pattern(false, 1.0)), Some(0.0));
    assert_eq!(hdr_flip(&pattern(true, 0.0), &pattern(false, 0.0)), None, "no exposure suits black");
}
