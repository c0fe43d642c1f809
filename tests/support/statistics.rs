//! Pearson's chi-square test, as pbrt and nori use it for samplers.

/// ln Gamma(x) for x > 0 (Lanczos, Numerical Recipes).
fn ln_gamma(x: f64) -> f64 {
    const C: [f64; 6] = [
        76.18009172947146,
        -86.50532032941677,
        24.01409824083091,
        -1.231739572450155,
        1.208650973866179e-3,
        -5.395239384953e-6,
    ];
    let t = x + 5.5;
    let series = C.iter().enumerate().fold(1.000000000190015, |sum, (i, c)| sum + c / (x + 1.0 + i as f64));
    (x + 0.5) * t.ln() - t + (2.5066282746310005 * series / x).ln()
}

/// Regularised upper incomplete gamma function Q(a, x).
fn gamma_q(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..10_000 {
            term *= x / (a + f64::from(n));
            sum += term;
        }
        return (1.0 - scale * sum).max(0.0);
    }
    // Lentz's continued fraction.
    let (mut b, mut c) = (x + 1.0 - a, 1e300);
    let mut d = 1.0 / b;
    let mut h = d;
    for n in 1..10_000 {
        let an = -f64::from(n) * (f64::from(n) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-14 {
            break;
        }
    }
    scale * h
}

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
    if degrees < 1.0 { 1.0 } else { gamma_q(0.5 * degrees, 0.5 * statistic) }
}

/// Level of each of `tests` tests that together err with probability 0.01 (Sidak).
pub fn sidak(tests: usize) -> f64 {
    1.0 - 0.99f64.powf(1.0 / tests as f64)
}

/// Probability that points spread this unevenly over 16 x 16 cells are uniform on the unit square.
#[allow(dead_code)] // each test file compiles its own copy
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
    assert!((gamma_q(0.5, 0.5 * 3.841459) - 0.05).abs() < 1e-6);
    assert!((gamma_q(50.0, 0.5 * 124.342113) - 0.05).abs() < 1e-6);
    assert!(chi_square(&[60.0, 40.0], &[50.0, 50.0]) < 0.05);
    assert!(chi_square(&[50.0, 50.0, 30.0], &[50.0, 50.0, 0.0]) < 1e-4);
}
