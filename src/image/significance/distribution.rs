//! Tail probabilities, and which of many are significant.
use statrs::function::beta::beta_reg;
use statrs::function::erf::erfc;

/// Degrees of freedom from which Student's t is taken for normal: the series of the t distribution does not end in time
/// for more, and the tails differ by 3 % at six standard errors.
const NORMAL: f64 = 1e4;

/// Probability that |t| is at least this, for Student's t with so many degrees of freedom.
pub fn two_sided(t: f64, freedom: f64) -> f64 {
    match () {
        () if t <= 0.0 => 1.0,
        () if t.is_infinite() => 0.0,
        () if freedom > NORMAL => erfc(t * std::f64::consts::FRAC_1_SQRT_2),
        () => beta_reg(0.5 * freedom, 0.5, freedom / (freedom + t * t)),
    }
}

/// The t that is exceeded with probability `p` on both sides together: the inverse of [`two_sided`], by bisection.
pub fn quantile(p: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while two_sided(high, freedom) > p && high < 1e150 {
        (low, high) = (high, 2.0 * high);
    }
    while high - low > 1e-9 * high {
        let middle = 0.5 * (low + high);
        match two_sided(middle, freedom) > p {
            true => low = middle,
            false => high = middle,
        }
    }
    high
}

/// The largest p-value that is significant by Benjamini and Hochberg's step-up procedure (1995): the largest of the sorted
/// p_1 ≤ ... ≤ p_m with p_k ≤ k `level` / m. `None` if none is.
pub fn largest_significant(mut p: Vec<f64>, level: f64) -> Option<f64> {
    let m = p.len() as f64;
    p.retain(|&p| p <= level);
    p.sort_by(f64::total_cmp);
    let significant = |(k, p): &(usize, f64)| *p <= (k + 1) as f64 * level / m;
    p.into_iter().enumerate().rfind(significant).map(|(_, p)| p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_the_published_ones() {
        // Two-sided 1 % points: 63.657 with 1 degree of freedom, 3.1693 with 10, 2.5758 of the normal distribution.
        for (t, freedom) in [(63.6567, 1.0), (3.16927, 10.0), (2.575829, 1e9), (2.576321, 10_000.0)] {
            assert!((two_sided(t, freedom) - 0.01).abs() < 1e-6, "{t}: {}", two_sided(t, freedom));
            assert!((quantile(0.01, freedom) / t - 1.0).abs() < 1e-5, "{freedom}: {}", quantile(0.01, freedom));
        }
        // Far out, and where the series hands over to the normal distribution: 1.9732e-9 at six standard errors.
        assert!((two_sided(6.0, 1e9) / 1.97318e-9 - 1.0).abs() < 1e-3);
        assert!((two_sided(6.0, 9999.0) / two_sided(6.0, 10_001.0) - 1.0).abs() < 0.05);
        assert_eq!([two_sided(0.0, 3.0), two_sided(f64::INFINITY, 3.0)], [1.0, 0.0]);
    }

    #[test]
    fn the_step_up_procedure_solves_the_published_example() {
        // Benjamini and Hochberg (1995), section 4: of these 15 at the level 0.05 the first four are significant.
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719, 0.6528,
            0.7590, 1.0,
        ];
        assert_eq!(largest_significant(p.to_vec(), 0.05), Some(0.0095));
        assert_eq!(largest_significant(p[4..].to_vec(), 0.05), None);
        assert_eq!(largest_significant(vec![0.0; 3], 0.05), Some(0.0));
    }
}
