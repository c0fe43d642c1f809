//! From raw runs to summaries: medians, means, intervals, and factors relative to uniform unfiltered rendering.
use super::changes;
use super::curve::{Curve, Reading};
use super::document::{Errors, Estimate, Factor, Pass, Point, Run, Summary};
use super::interval::{self, CONFIDENCE};
use std::collections::BTreeMap;

/// Curves of uniform unfiltered rendering by seed.
type Baseline = BTreeMap<u32, Curve>;

/// Fills in the summary of every point that has runs.
pub fn summarise(points: &mut [Point]) {
    let baseline = baseline(points);
    for point in points.iter_mut().filter(|point| !point.runs.is_empty()) {
        point.summary = Some(summary(point, &baseline));
    }
    changes::fill_in(points);
}

/// The Pareto front of the medians: indices of points that no other point beats in both time and relMSE, the fastest first. Of
/// points that are equal in both, the first stays.
pub fn front(points: &[Point]) -> Vec<usize> {
    let mut candidates: Vec<_> = (0..points.len()).filter_map(|i| Some((place(&points[i])?, i))).collect();
    candidates.sort_by(|((t, e), i), ((u, f), j)| t.total_cmp(u).then(e.total_cmp(f)).then(i.cmp(j)));
    let mut lowest = f64::INFINITY;
    let mut front = Vec::new();
    for ((_, error), index) in candidates {
        if error < lowest {
            lowest = error;
            front.push(index);
        }
    }
    front
}

/// Time and relMSE of a point that did not fail.
fn place(point: &Point) -> Option<(f64, f64)> {
    let summary = point.summary.as_ref().filter(|_| point.failed.is_none())?;
    Some((summary.gpu_ms.value, summary.errors.relmse?.value))
}

/// The curves that factors refer to. Seeds that not all of its points have run yet are left out, so that every seed has
/// the same points.
fn baseline(points: &[Point]) -> Baseline {
    let usable = |point: &&Point| point.method.is_baseline() && point.is_compared() && !point.ends_at_0();
    curves(&points.iter().filter(usable).collect::<Vec<_>>())
}

/// Whether errors of uniform unfiltered rendering tell a time: of several points they must fall.
fn tells_times(baseline: &Baseline) -> bool {
    let is_single = |curve: &Curve| curve.times()[0] == curve.times()[1];
    baseline.values().all(is_single) || baseline.values().map(Curve::fall).sum::<f64>() > 0.0
}

/// Curves through the runs of some points, by seed, where all points have run it and have an error above 0.
pub(super) fn curves(points: &[&Point]) -> Baseline {
    let mut places: BTreeMap<u32, Vec<(f64, f64)>> = BTreeMap::new();
    for run in points.iter().flat_map(|point| &point.runs) {
        places.entry(run.seed).or_default().extend(run.errors.relmse.map(|error| (run.gpu_ms, error)));
    }
    places.retain(|_, places| places.len() == points.len());
    places.into_iter().filter_map(|(seed, places)| Some((seed, Curve::new(&places)?))).collect()
}

fn summary(point: &Point, baseline: &Baseline) -> Summary {
    let runs = &point.runs[..];
    let median = |of: fn(&Run) -> f64| interval::median(&runs.iter().map(of).collect::<Vec<_>>(), CONFIDENCE);
    let inefficiency = |run: &Run| Some(run.errors.relmse? * run.gpu_ms * 1e-3);
    Summary {
        gpu_ms: median(|run| run.gpu_ms),
        wall_ms: median(|run| run.wall_ms),
        passes: passes(runs),
        errors: errors(runs),
        inefficiency: of_all(runs, inefficiency).map(|values| interval::mean_error(&values, CONFIDENCE)),
        speed_up: factor(point, baseline, |curve, run, error| {
            let Reading { value, extrapolated } = curve.time_of(error);
            Reading { value: value / run.gpu_ms, extrapolated }
        })
        .filter(|_| point.method.is_baseline() || tells_times(baseline)),
        error_gain: factor(point, baseline, |curve, run, error| {
            let Reading { value, extrapolated } = curve.error_at(run.gpu_ms);
            Reading { value: value / error, extrapolated }
        }),
        change: None,
    }
}

/// Median time of every pass, in the order of the first run.
fn passes(runs: &[Run]) -> Vec<Pass> {
    let of = |name: &str| -> Vec<f64> {
        let found = |run: &Run| run.passes.iter().find(|pass| pass.pass == name).map_or(0.0, |pass| pass.ms);
        runs.iter().map(found).collect()
    };
    let median = |pass: &Pass| Pass { ms: interval::median(&of(&pass.pass), 0.0).value, ..pass.clone() };
    runs[0].passes.iter().map(median).collect()
}

/// PSNR is a logarithm already, and SSIM is no error.
fn errors(runs: &[Run]) -> Errors<Estimate> {
    let metric = |i: usize| {
        let values = of_all(runs, |run| run.errors.values()[i])?;
        let mean =
            if matches!(Errors::<f64>::NAMES[i], "PSNR" | "SSIM") { interval::mean } else { interval::mean_error };
        Some(mean(&values, CONFIDENCE))
    };
    Errors::from_values(std::array::from_fn(metric))
}

/// The values of all runs; `None` if one of them has none.
fn of_all(runs: &[Run], of: impl Fn(&Run) -> Option<f64>) -> Option<Vec<f64>> {
    runs.iter().map(of).collect()
}

/// A factor of every run relative to the curve of its own seed, without rises, and the geometric mean of these factors. Runs of another
/// renderer, whose seeds may be others, stand beside the curves in their order (see [`super::candidate::Candidate::against`]). Uniform
/// unfiltered rendering is as good as itself. Runs without an error above the noise of the reference tell no factor, and the others
/// alone would be biased.
fn factor(point: &Point, baseline: &Baseline, of: impl Fn(&Curve, &Run, f64) -> Reading) -> Option<Factor> {
    if point.method.is_baseline() {
        return Some(Factor {
            estimate: Estimate { value: 1.0, low: Some(1.0), high: Some(1.0) },
            extrapolated: false,
        });
    }
    let of_seed = point.runs.iter().filter_map(|run| Some((run, baseline.get(&run.seed)?)));
    let mut pairs: Vec<(&Run, &Curve)> = of_seed.collect();
    if pairs.len() < 2 {
        pairs = point.runs.iter().zip(baseline.values()).collect();
    }
    let reading = |(run, curve): &(&Run, &Curve)| Some(of(&curve.falling(), run, run.errors.relmse?));
    let readings: Vec<Reading> = pairs.iter().filter_map(reading).collect();
    if readings.is_empty() || point.ends_at_0() {
        return None;
    }
    let values: Vec<f64> = readings.iter().map(|reading| reading.value).collect();
    Some(Factor {
        estimate: interval::geometric_mean(&values, CONFIDENCE),
        extrapolated: readings.iter().any(|reading| reading.extrapolated),
    })
}
