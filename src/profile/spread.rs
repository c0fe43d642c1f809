//! What repeated measurements have in common.
use serde::{Deserialize, Serialize};

/// Measurements from which on a 95th percentile is more than the largest of them.
const ENOUGH_FOR_P95: usize = 20;
/// Parts into which measurements are cut to see how much their median varies.
const REPEATS: usize = 5;

/// Measurements of one thing, in the order in which they were made, and what is said of them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The middle one; of an even number, the mean of the middle two.
    pub median: f64,
    /// The least.
    pub min: f64,
    /// The largest.
    pub max: f64,
    /// That below or at which 95 % of them are; only of 20 and more.
    pub p95: Option<f64>,
    /// Largest minus least median of the runs into which they are cut: up to five, of consecutive measurements, two at least in
    /// each. `None` where there are fewer than four measurements: then it is not known how they vary.
    pub range_of_repeats: Option<f64>,
    /// All of them.
    pub samples: Vec<f64>,
}

impl Spread {
    /// Of measurements in the order in which they were made.
    pub fn of(samples: Vec<f64>) -> Self {
        let mut sorted = samples.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |i: usize| sorted.get(i).copied().unwrap_or(0.0);
        let count = sorted.len();
        Self {
            median: median(&samples),
            min: at(0),
            max: at(count.saturating_sub(1)),
            p95: (count >= ENOUGH_FOR_P95).then(|| at((count * 95).div_ceil(100) - 1)),
            range_of_repeats: range_of_repeats(&samples),
            samples,
        }
    }
}

fn range_of_repeats(samples: &[f64]) -> Option<f64> {
    let repeats = REPEATS.min(samples.len() / 2);
    if repeats < 2 {
        return None;
    }
    let run = |i: usize| &samples[i * samples.len() / repeats..(i + 1) * samples.len() / repeats];
    let medians: Vec<f64> = (0..repeats).map(|i| median(run(i))).collect();
    let most = medians.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let least = medians.iter().copied().fold(f64::INFINITY, f64::min);
    Some(most - least)
}

/// The middle one of the samples; of an even number, the mean of the middle two; 0 of none.
pub fn median(samples: &[f64]) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => 0.0,
        n if n % 2 == 1 => sorted[middle],
        _ => 0.5 * (sorted[middle - 1] + sorted[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_percentiles_are_those_of_worked_examples() {
        assert_eq!(median(&[]), 0.0);
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 9.0]), 3.0);
        let of = |count: u32| Spread::of((1..=count).rev().map(f64::from).collect());
        assert_eq!((of(19).p95, of(20).p95, of(100).p95), (None, Some(19.0), Some(95.0)));
        assert_eq!((of(21).median, of(21).min, of(21).max, of(21).p95), (11.0, 1.0, 21.0, Some(20.0)));
    }

    #[test]
    fn the_range_of_repeats_is_that_of_the_medians_of_runs() {
        assert_eq!(Spread::of(vec![1.0, 2.0, 3.0]).range_of_repeats, None);
        // Runs of two: 1.5, 3.5.
        assert_eq!(Spread::of(vec![1.0, 2.0, 3.0, 4.0]).range_of_repeats, Some(2.0));
        // Five runs of four, one of them with an outlier that its median does not see.
        let mut samples = vec![5.0; 20];
        samples[7] = 900.0;
        assert_eq!(Spread::of(samples.clone()).range_of_repeats, Some(0.0));
        samples[4..8].copy_from_slice(&[5.5; 4]);
        assert_eq!(Spread::of(samples).range_of_repeats, Some(0.5));
    }
}
