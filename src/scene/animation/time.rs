//! Times of frames beside those of keys.
use std::ops::Range;

/// Seconds by which times may miss a key, and that relative to times above one second: files hold keys in single precision, frame n is
/// at n / fps, and neither is a whole number of bits.
const SLACK: f64 = 1e-6;

/// Whether a time is at a key or after it.
pub fn reaches(seconds: f64, key: f64) -> bool {
    key <= seconds + SLACK * seconds.abs().max(1.0)
}

/// A time within a period that begins at 0: the end of one is the begin of the next.
pub fn within(seconds: f64, period: f64) -> f64 {
    let rest = seconds.rem_euclid(period);
    if rest.min(period - rest) <= SLACK * seconds.abs().max(1.0) { 0.0 } else { rest }
}

/// From the first begin to the last end.
pub fn hull(spans: impl Iterator<Item = Range<f64>>) -> Option<Range<f64>> {
    spans.reduce(|a, b| a.start.min(b.start)..a.end.max(b.end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_reach_keys_of_single_precision_and_periods_begin_anew() {
        for fps in [24.0, 25.0, 30.0, 60.0] {
            for frame in 0..10_000 {
                let (seconds, key) = (f64::from(frame) / fps, (f64::from(frame) / fps) as f32);
                assert!(reaches(seconds, key.into()) && reaches(key.into(), seconds), "{frame} at {fps}");
                assert!(!reaches(seconds, (f64::from(frame) + 0.1) / fps), "control: {frame} at {fps}");
                for period in [3.0 / fps, 0.4, 0.8] {
                    let rest = within(seconds, period);
                    assert!(rest == 0.0 || (1e-3..period - 1e-3).contains(&rest), "{frame} at {fps}: {rest}");
                }
            }
        }
    }
}
