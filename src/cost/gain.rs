//! How much less error the best method has than uniform unfiltered rendering in the same time.
use super::candidate::Candidate;
use super::curve::Curve;
use super::document::{Estimate, Finding, Verdict};
use super::interval::{self, CONFIDENCE};
use super::words::{factor, milliseconds, number};

/// Number of times at which methods are compared, evenly spaced on a logarithmic axis.
const LEVELS: usize = 16;
/// Upper end of an interval over its lower end, up to which a factor is told even if it may be 1.
const NARROW: f64 = 1.5;
/// Upper end of an interval over its lower end, above which a factor is not printed.
const MAGNITUDE: f64 = 10.0;

/// What the best method gains at a time.
struct Gain<'a> {
    time: f64,
    by: &'a str,
    /// relMSE of uniform unfiltered rendering over that of the best method.
    factor: Estimate,
    /// Its logarithm by seed.
    logarithms: Vec<f64>,
}

/// The least and the most that is gained over the times that uniform unfiltered rendering was measured at. `None` without it, and
/// without another method that is there as early.
pub fn finding(candidates: &[Candidate]) -> Option<Finding> {
    let baseline = candidates.iter().find(|candidate| candidate.is_baseline)?;
    // Times of few samples may vary more between seeds than between numbers of samples.
    let [first, last] = Some(baseline.times()).filter(|[first, last]| first < last)?;
    let time = |i: usize| first * (last / first).powf(i as f64 / (LEVELS - 1) as f64);
    // The best of many methods, at the least of many times, is chosen by the very runs that its interval is of: only what holds for all
    // of them together holds for it.
    let compared = LEVELS * candidates.len().saturating_sub(1).max(1);
    let each = 1.0 - (1.0 - CONFIDENCE) / compared as f64;
    let gains: Vec<Gain> =
        (0..LEVELS).filter_map(|i| gain(candidates, baseline, time(i).clamp(first, last), each)).collect();
    let by_factor = |a: &&Gain, b: &&Gain| a.factor.value.total_cmp(&b.factor.value);
    let (least, most) = (gains.iter().min_by(by_factor)?, gains.iter().max_by(by_factor)?);
    let verdict = if is_told(&least.factor) { Verdict::Clear } else { Verdict::TooNoisy };
    if verdict == Verdict::TooNoisy && !has_magnitude(&least.factor) {
        return Some(Finding { verdict, text: unknown(least, [gains[0].time, last], each) });
    }
    let text = format!(
        "From {} to {}, uniform unfiltered rendering has at least {} times the relMSE of the best other method in the same time ({} at \
         {}), and at most {} times ({} at {}).",
        milliseconds(gains[0].time),
        milliseconds(last),
        factor(&least.factor),
        least.by,
        milliseconds(least.time),
        number(most.factor.value),
        most.by,
        milliseconds(most.time)
    );
    Some(Finding { verdict, text })
}

/// What is said where the runs are too few to tell even the magnitude of what is gained at least.
fn unknown(least: &Gain, [first, last]: [f64; 2], confidence: f64) -> String {
    // With an interval of this half width it is told on which side of 1 the factor is, or that it is near.
    let half = least.factor.value.ln().abs().max(0.5 * NARROW.ln());
    format!(
        "How many times the relMSE of the best other method uniform unfiltered rendering has in the same time, from {} to {}, cannot be \
         told from {} runs: at least {} are needed.",
        milliseconds(first),
        milliseconds(last),
        least.logarithms.len(),
        interval::runs_needed(&least.logarithms, half, confidence)
    )
}

/// Whether an interval tells the magnitude of a factor.
fn has_magnitude(factor: &Estimate) -> bool {
    factor.low.zip(factor.high).is_some_and(|(low, high)| high <= MAGNITUDE * low)
}

/// Whether an interval says on which side of 1 a factor is, or that it is near. A single seed has none: nobody knows how far another
/// would be off.
fn is_told(factor: &Estimate) -> bool {
    let Some((low, high)) = factor.low.zip(factor.high) else { return false };
    low > 1.0 || high < 1.0 || high < NARROW * low
}

/// What is gained at a time by the best of the methods that have begun. One that ends before keeps its last image.
fn gain<'a>(candidates: &'a [Candidate], baseline: &Candidate, time: f64, confidence: f64) -> Option<Gain<'a>> {
    let error = |curve: &Curve| curve.kept_at(time);
    let others = candidates.iter().filter(|candidate| !candidate.is_baseline && candidate.begins_by(time));
    let best = others.min_by(|a, b| a.mean(&error).total_cmp(&b.mean(&error)))?;
    let logarithms = baseline.against(best, &error);
    let factors: Vec<f64> = logarithms.iter().map(|l| l.exp()).collect();
    (!factors.is_empty()).then(|| Gain {
        time,
        by: &best.name,
        factor: interval::geometric_mean(&factors, confidence),
        logarithms,
    })
}
