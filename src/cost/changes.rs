//! What options change: points that have some beside the same point without them, run by run.
use super::document::{Change, Estimate, Finding, Method, Point, Verdict};
use super::interval::{self, CONFIDENCE};
use super::words::{factor, list};

/// Largest number of options that are named as worth their while, for each point without options.
const NAMED: usize = 3;

/// Factors of the runs of a point relative to those of the same seed without its options, as logarithms.
struct Factors {
    time: Vec<f64>,
    /// Empty where one is unknown: the others alone would be biased.
    error: Vec<f64>,
}

/// Fills in the change of every point that has options, where the same point without them was measured.
pub fn fill_in(points: &mut [Point]) {
    let changes: Vec<Option<Change>> =
        points.iter().map(|point| Some(change(&factors(point, plain(points, point)?)?))).collect();
    for (point, found) in points.iter_mut().zip(changes) {
        point.summary.iter_mut().for_each(|summary| summary.change = found);
    }
}

/// The same point without options; `None` for a point that has none itself.
pub fn plain<'a>(points: &'a [Point], point: &Point) -> Option<&'a Point> {
    let method = Method { options: Vec::new(), ..point.method.clone() };
    points.iter().find(|other| other.method == method).filter(|_| !point.method.options.is_empty())
}

fn factors(point: &Point, plain: &Point) -> Option<Factors> {
    let mut all = Factors { time: Vec::new(), error: Vec::new() };
    for run in &point.runs {
        let Some(before) = plain.runs.iter().find(|before| before.seed == run.seed) else { continue };
        all.time.push((run.gpu_ms / before.gpu_ms).ln());
        let error = run.errors.relmse.zip(before.errors.relmse).map(|(now, before)| (now / before).ln());
        all.error.extend(error.filter(|logarithm| logarithm.is_finite()));
    }
    if all.error.len() < all.time.len() {
        all.error.clear();
    }
    (!all.time.is_empty() && point.failed.is_none()).then_some(all)
}

impl Factors {
    /// Of relMSE times time; empty where an error is unknown.
    fn product(&self) -> Vec<f64> {
        self.time.iter().zip(&self.error).map(|(t, e)| t + e).collect()
    }
}

fn change(factors: &Factors) -> Change {
    let estimate = |logarithms: &[f64]| {
        let values: Vec<f64> = logarithms.iter().map(|l| l.exp()).collect();
        (!values.is_empty()).then(|| interval::geometric_mean(&values, CONFIDENCE))
    };
    Change { time: estimate(&factors.time), relmse: estimate(&factors.error), product: estimate(&factors.product()) }
}

/// Which options lower relMSE times time, for each point without options. All tests together keep the probability of naming a
/// wrong one below 1 - [`CONFIDENCE`].
pub fn findings(points: &[Point]) -> Vec<Finding> {
    let changed = points.iter().filter_map(|point| Some((point, plain(points, point)?)));
    let changed: Vec<_> = changed.filter_map(|(point, plain)| Some((point, plain, factors(point, plain)?))).collect();
    let alpha = (1.0 - CONFIDENCE) / changed.len().max(1) as f64;
    let of = |without: &Point| {
        let own = changed.iter().filter(|(_, plain, _)| plain.method == without.method);
        let own: Vec<_> = own.map(|(point, _, factors)| (*point, factors)).collect();
        (!own.is_empty()).then(|| about(without, own, alpha)).into_iter().flatten().collect::<Vec<_>>()
    };
    points.iter().flat_map(of).collect()
}

fn about(without: &Point, mut changed: Vec<(&Point, &Factors)>, alpha: f64) -> Vec<Finding> {
    let product = |factors: &Factors| mean(&factors.product());
    changed.sort_by(|(_, a), (_, b)| product(a).total_cmp(&product(b)));
    let told = |factors: &&Factors| interval::differs_from_0(&factors.product(), alpha);
    let better = changed.iter().filter(|(_, factors)| told(factors) && product(factors) < 0.0);
    let mut found: Vec<Finding> = better.take(NAMED).map(|(point, _)| better_option(without, point)).collect();
    let plain = without.method.label();
    if found.is_empty() {
        let text = format!("No option that was tried lowers relMSE times time of {plain} by more than the noise.");
        found.push(Finding { verdict: Verdict::Clear, text });
    }
    let open: Vec<&str> = changed.iter().filter(|(_, f)| !told(f)).map(|(point, _)| option(point)).collect();
    if !open.is_empty() {
        let text = format!("Whether {plain} gains by {} the data cannot tell.", list(&open));
        found.push(Finding { verdict: Verdict::TooNoisy, text });
    }
    found
}

fn better_option(without: &Point, point: &Point) -> Finding {
    let change = point.summary.as_ref().and_then(|summary| summary.change).unwrap_or_default();
    let of = |estimate: Option<Estimate>| estimate.map_or_else(String::new, |e| factor(&e));
    let text = format!(
        "With {}, {} takes {} of the time and has {} of the relMSE.",
        option(point),
        without.method.label(),
        of(change.time),
        of(change.relmse)
    );
    Finding { verdict: Verdict::Clear, text }
}

/// Infinite without a value.
fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { f64::INFINITY } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// What a point changes, such as "max-depth 4".
pub fn option(point: &Point) -> &str {
    point.method.options.first().map_or("", |option| option.trim_start_matches('-'))
}
