//! Confidence intervals of few runs.
use super::document::Estimate;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, StudentsT};

/// Confidence level of all intervals that are told.
pub const CONFIDENCE: f64 = 0.95;

/// Mean of the values, and its two-sided interval at `confidence` by Student's t.
///
/// # Panics
/// Without a value.
pub fn mean(values: &[f64], confidence: f64) -> Estimate {
    let value = average(values);
    let half = standard_error(values).map(|error| error * t_quantile(values.len(), confidence));
    Estimate { value, low: half.map(|h| value - h), high: half.map(|h| value + h) }
}

/// Geometric mean of values above 0, and its interval: that of the mean of their logarithms.
///
/// # Panics
/// Without a value.
pub fn geometric_mean(values: &[f64], confidence: f64) -> Estimate {
    let logarithms: Vec<f64> = values.iter().map(|v| v.ln()).collect();
    let Estimate { value, low, high } = mean(&logarithms, confidence);
    Estimate { value: value.exp(), low: low.map(f64::exp), high: high.map(f64::exp) }
}

/// Geometric mean of errors, and its interval, which is above 0: errors scatter by factors. Where one is 0 and has no logarithm, it is
/// their plain mean, and an interval that is cut at 0.
///
/// # Panics
/// Without a value.
pub fn mean_error(values: &[f64], confidence: f64) -> Estimate {
    if values.iter().all(|&v| v > 0.0) {
        return geometric_mean(values, confidence);
    }
    let plain = mean(values, confidence);
    Estimate { low: plain.low.map(|low| low.max(0.0)), ..plain }
}

/// The least number of values, up to 1000, whose mean has an interval of this half width or less if they scatter like these.
pub fn runs_needed(values: &[f64], half: f64, confidence: f64) -> usize {
    let deviation = standard_error(values).unwrap_or(0.0) * (values.len() as f64).sqrt();
    let is_enough = |runs: &usize| t_quantile(*runs, confidence) * deviation <= half * (*runs as f64).sqrt();
    (2..1000).find(is_enough).unwrap_or(1000)
}

/// Median of the values, and the narrowest symmetric pair of order statistics that covers it at `confidence`. Fewer than six
/// values do not reach 0.95: their interval is the whole range, which covers the median with 1 - 2 / 2^n.
///
/// # Panics
/// Without a value.
pub fn median(values: &[f64], confidence: f64) -> Estimate {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    let value = (sorted[(n - 1) / 2] + sorted[n / 2]) / 2.0;
    if n < 2 {
        return Estimate { value, low: None, high: None };
    }
    let outside = ranks_outside(n, confidence);
    Estimate { value, low: Some(sorted[outside]), high: Some(sorted[n - 1 - outside]) }
}

/// Whether [`median`] of so many values has an interval that covers the median at `confidence`, and not merely their range.
pub fn median_is_covered(values: usize, confidence: f64) -> bool {
    1.0 - 2.0 * 0.5_f64.powi(values.min(1000) as i32) >= confidence
}

/// Whether the mean of the values differs from 0, by a two-sided t test at the level `alpha`. Values that are all the same
/// differ if they are not 0. A single value, or none, tells nothing.
pub fn differs_from_0(values: &[f64], alpha: f64) -> bool {
    let Some(error) = standard_error(values) else { return false };
    let mean = average(values);
    mean != 0.0 && mean.abs() > error * t_quantile(values.len(), 1.0 - alpha)
}

fn average(values: &[f64]) -> f64 {
    assert!(!values.is_empty(), "no values");
    values.iter().sum::<f64>() / values.len() as f64
}

/// `None` for fewer than two values, whose error nobody knows.
fn standard_error(values: &[f64]) -> Option<f64> {
    if values.len() < 2 {
        return None;
    }
    let (n, mean) = (values.len() as f64, average(values));
    let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    Some((squares / (n - 1.0) / n).sqrt())
}

fn t_quantile(runs: usize, confidence: f64) -> f64 {
    let distribution = StudentsT::new(0.0, 1.0, (runs - 1) as f64).expect("at least one degree of freedom");
    distribution.inverse_cdf(0.5 + confidence / 2.0)
}

/// Number of values that may be left out at either end of `n` sorted values so that the rest still covers the median.
fn ranks_outside(n: usize, confidence: f64) -> usize {
    let heads = Binomial::new(0.5, n as u64).expect("a fair coin");
    let covers = |outside: &usize| 1.0 - 2.0 * heads.cdf(*outside as u64) >= confidence;
    (0..n / 2).take_while(covers).last().unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(value: Option<f64>, expected: f64) {
        assert!(value.is_some_and(|v| (v - expected).abs() < 1e-3), "{value:?} is not {expected}");
    }

    #[test]
    fn the_interval_of_a_mean_is_student_s() {
        // Mean 3, sample variance 2.5, standard error sqrt(0.5), and t(0.975, 4) = 2.7764.
        let Estimate { value, low, high } = mean(&[1.0, 2.0, 3.0, 4.0, 5.0], 0.95);
        assert_eq!(value, 3.0);
        close(low, 3.0 - 2.7764 * 0.5_f64.sqrt());
        close(high, 3.0 + 2.7764 * 0.5_f64.sqrt());
        assert_eq!(mean(&[7.0], 0.95), Estimate { value: 7.0, low: None, high: None });
        let Estimate { value, low, .. } = geometric_mean(&[1.0, 4.0], 0.95);
        assert!((value - 2.0).abs() < 1e-12);
        // Logarithms 0 and ln 4: standard error ln 2, and t(0.975, 1) = 12.706.
        close(low, 2.0 * (-12.706 * 2.0_f64.ln()).exp());
        let Estimate { value, low, high } = mean_error(&[0.0, 1.0, 0.2], 0.95);
        assert!((value - 0.4).abs() < 1e-12 && low == Some(0.0) && high.is_some_and(|high| high > 1.0));
        // Deviation 1: t(0.975, 17) = 2.110 over the root of 18 is 0.497, t(0.975, 16) = 2.120 over the root of 17 is 0.514.
        assert_eq!(runs_needed(&[0.0, 1.0, 2.0], 0.5, 0.95), 18);
    }

    #[test]
    fn the_interval_of_a_median_is_made_of_order_statistics() {
        let of = |n: u32| {
            let Estimate { value, low, high } = median(&(1..=n).map(f64::from).collect::<Vec<_>>(), 0.95);
            (value, low, high)
        };
        assert_eq!(of(1), (1.0, None, None));
        assert_eq!(of(5), (3.0, Some(1.0), Some(5.0)));
        assert_eq!(of(8), (4.5, Some(1.0), Some(8.0)), "0.992; one less on either side has 0.930");
        assert_eq!(of(10), (5.5, Some(2.0), Some(9.0)), "0.979 by the tables");
        assert_eq!([1, 5, 6, 1000].map(|n| median_is_covered(n, 0.95)), [false, false, true, true]);
    }

    #[test]
    fn a_difference_must_exceed_its_noise() {
        assert!(differs_from_0(&[1.0, 1.1, 0.9, 1.05], 0.05));
        assert!(!differs_from_0(&[1.0, -1.1, 0.9, -1.05], 0.05));
        assert!(
            differs_from_0(&[2.0, 2.0], 0.001) && !differs_from_0(&[0.0, 0.0], 0.05) && !differs_from_0(&[9.0], 0.05)
        );
        assert!(!differs_from_0(&[], 0.05), "nothing differs from nothing");
    }
}
