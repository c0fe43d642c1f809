//! Compares two renders of one scene by the same samples, whose kernels round differently.
use crate::statistics::sidak_quantile;
use tallow::layout::PixelStats;

/// What rounding alone may make of a value, relative.
const ROUNDING: f64 = 1e-4;

/// Pixels that must agree. Of few samples some do not know their own error (two seeds of 16: 559 of 561 agree), and where
/// surfaces touch, rounding decides for all samples of a pixel.
const SHARE: f64 = 0.99;

/// Rounding sends a few paths elsewhere, where they are other draws of the same estimator; a fault moves the mean.
///
/// One pixel by both standard errors: what the renders share makes their errors go together, so that the difference's
/// variance is at most their sum, and that of independent seeds exactly. For the whole image that bound is far too wide,
/// since nearly all paths are the same: there the pixels' own differences tell how much chance explains (paired z-test).
/// Relative to the pixel, (b - a) / (b + a) changes its sign when the two draws change places, and so is 0 on average
/// without a fault, however unlike pixels are. `renders` pairs are judged in all.
///
/// # Errors
/// Which of them is off, and by how much.
pub fn alike(a: &[PixelStats], b: &[PixelStats], renders: usize) -> Result<(), String> {
    let limit = sidak_quantile(3 * a.len());
    let passing = a.iter().zip(b).filter(|(a, b)| (0..3).all(|c| pixels_agree(a, b, c, limit))).count();
    if (passing as f64) < SHARE * a.len() as f64 {
        return Err(format!("only {passing} of {} pixels agree", a.len()));
    }
    let limit = sidak_quantile(3 * renders);
    for c in 0..3 {
        let (difference, error) = paired(a, b, c);
        if difference.abs() > limit * error + ROUNDING {
            return Err(format!("channel {c} is off by {difference:.1e} +- {error:.0e} of its light"));
        }
    }
    Ok(())
}

fn pixels_agree(a: &PixelStats, b: &PixelStats, c: usize, limit: f64) -> bool {
    let error2 = |s: &PixelStats| f64::from(s.m2[c]) / (f64::from(s.count) * f64::from(s.count - 1));
    let (x, y) = (f64::from(a.mean[c]), f64::from(b.mean[c]));
    a.count == b.count && (x - y).abs() <= limit * (error2(a) + error2(b)).sqrt() + ROUNDING * x.abs().max(y.abs())
}

/// Mean relative difference of a channel, and its standard error.
fn paired(a: &[PixelStats], b: &[PixelStats], c: usize) -> (f64, f64) {
    let relative = |(a, b): (&PixelStats, &PixelStats)| {
        let (x, y) = (f64::from(a.mean[c]), f64::from(b.mean[c]));
        if x == y { 0.0 } else { 2.0 * (y - x) / (y + x) }
    };
    let (n, differences) = (a.len() as f64, a.iter().zip(b).map(relative).collect::<Vec<_>>());
    let mean = differences.iter().sum::<f64>() / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}
