//! Pearson's chi-square test, as pbrt and nori use it for samplers, and quantiles for z-tests.
#![allow(dead_code, reason = "each test program compiles its own copy and uses a part")]
use statrs::distribution::{ContinuousCDF, Normal};
use statrs::function::gamma::gamma_ur;

/// Probability of a statistic as large as the one observed, if `expected` were true. Cells that expect fewer than 5
/// are pooled, smallest first, so that counts where nothing is expected weigh on a small cell.
pub fn chi_square(observed: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(observed.len(), expected.len());
    let mut cells: Vec<(f64, f64)> = observed.iter().copied().zip(expected.iter().copied()).collect();
    cells.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (mut pooled, mut statistic, mut degrees) = ((0.0, 0.0), 0.0, -1.0);
    for (seen, wanted) in cells {
        pooled = (pooled.0 + seen, pooled.1 + wanted);
        if pooled.1 >= 5.0 {
            statistic += (pooled.0 - pooled.1).powi(2) / pooled.1;
            degrees += 1.0;
            pooled = (0.0, 0.0);
        }
    }
    if pooled.0 > 20.0 {
        return 0.0;
    }
    if degrees < 1.0 { 1.0 } else { gamma_ur(0.5 * degrees, 0.5 * statistic.max(f64::MIN_POSITIVE)) }
}

/// Level of each of `tests` tests that together err with probability 0.01 (Sidak).
pub fn sidak(tests: usize) -> f64 {
    1.0 - 0.99f64.powf(1.0 / tests as f64)
}

/// Two-sided quantile of the normal distribution at which `tests` independent tests together fail once in a hundred times.
pub fn sidak_quantile(tests: usize) -> f64 {
    -Normal::standard().inverse_cdf(0.5 * sidak(tests))
}

/// Probability that points spread this unevenly over 16 x 16 cells are uniform on the unit square.
pub fn uniform_2d(points: impl Iterator<Item = [f64; 2]>) -> f64 {
    let mut counts = vec![0.0; 256];
    for [x, y] in points {
        let cell = |v: f64| (v * 16.0).clamp(0.0, 15.0) as usize;
        counts[16 * cell(y) + cell(x)] += 1.0;
    }
    let mean = counts.iter().sum::<f64>() / 256.0;
    chi_square(&counts, &[mean; 256])
}

#[test]
fn chi_square_matches_published_quantiles() {
    // 5 % points: 3.841 with 1 degree of freedom, 124.342 with 100.
    // A statistic of 3.841459 over two cells: 100 expected in each, 13.859 more in one and less in the other.
    let off = (3.841459f64 * 50.0).sqrt();
    assert!((chi_square(&[100.0 + off, 100.0 - off], &[100.0; 2]) - 0.05).abs() < 1e-6);
    assert!((gamma_ur(50.0, 0.5 * 124.342113) - 0.05).abs() < 1e-6);
    assert!(chi_square(&[60.0, 40.0], &[50.0, 50.0]) < 0.05);
    assert!(chi_square(&[50.0, 50.0, 30.0], &[50.0, 50.0, 0.0]) < 1e-4);
}

#[test]
fn quantiles_are_the_published_ones() {
    // 1 % two-sided: 2.5758. A hundred tests: 1 - 0.99^(1/100) = 1.00499e-4, whose quantile is 3.8893.
    assert!((sidak_quantile(1) - 2.5758).abs() < 1e-3, "{}", sidak_quantile(1));
    assert!((sidak_quantile(100) - 3.8893).abs() < 1e-3, "{}", sidak_quantile(100));
}
