//! Quantiles of the normal distribution, for z-tests.

/// Two-sided quantile of the normal distribution at which `tests` independent tests together fail once in a hundred
/// times (Sidak 1967): 1 - (1 - 0.01)^(1 / tests).
pub fn sidak_quantile(tests: usize) -> f64 {
    let level = 1.0 - (1.0f64 - 0.01).powf(1.0 / tests as f64);
    let tail = |z: f64| erfc(z / 2f64.sqrt());
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if tail(middle) > level { low = middle } else { high = middle }
    }
    high
}

/// Complementary error function for x >= 0, relative error below 1.2e-7 (Numerical Recipes, erfcc).
fn erfc(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.5 * x);
    let c = [
        -1.26551223,
        1.00002368,
        0.37409196,
        0.09678418,
        -0.18628806,
        0.27886807,
        -1.13520398,
        1.48851587,
        -0.82215223,
        0.17087277,
    ];
    let poly = c.iter().rev().fold(0.0, |sum, &c| sum * t + c);
    t * (-x * x + poly).exp()
}

#[test]
fn quantiles_are_the_published_ones() {
    // 1 % two-sided: 2.5758. A hundred tests: 1 - 0.99^(1/100) = 1.00499e-4, whose quantile is 3.8893.
    assert!((sidak_quantile(1) - 2.5758).abs() < 1e-3, "{}", sidak_quantile(1));
    assert!((sidak_quantile(100) - 3.8893).abs() < 1e-3, "{}", sidak_quantile(100));
}
