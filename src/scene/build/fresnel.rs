//! Mean Fresnel reflectance of a dielectric.

/// Unpolarised Fresnel reflectance for relative index `eta` (transmitted / incident side).
fn dielectric(cos: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let inner = (1.0 - sin2).sqrt();
    let parallel = (eta * cos - inner) / (eta * cos + inner);
    let perpendicular = (cos - eta * inner) / (cos + eta * inner);
    (parallel * parallel + perpendicular * perpendicular) / 2.0
}

/// Mean over cosine-weighted directions inside a medium of index `eta` of the reflectance of its interface: what a
/// diffuse base under a coat gets back. From the outside mean by reciprocity, `1 - (1 - outside) / eta^2`.
pub fn mean_internal(eta: f32) -> f32 {
    let (eta, steps) = (f64::from(eta), 2048);
    let outside: f64 = (0..steps)
        .map(|i| (f64::from(i) + 0.5) / f64::from(steps))
        .map(|cos| 2.0 * cos * dielectric(cos, eta) / f64::from(steps))
        .sum();
    (1.0 - (1.0 - outside) / (eta * eta)).clamp(0.0, 1.0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Exact mean for light from OUTSIDE (Walsh 1926, as given by Duntley 1942), n > 1.
    fn walsh(n: f64) -> f64 {
        let (n2, n4) = (n * n, n.powi(4));
        0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
            + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
            - 2.0 * n.powi(3) * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
            + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln()
    }

    #[test]
    fn mean_reflectance_matches_walsh() {
        for n in [1.05f32, 1.33, 1.5, 1.9, 2.4] {
            let (outside, found) = (walsh(f64::from(n)), f64::from(mean_internal(n)));
            let exact = 1.0 - (1.0 - outside) / f64::from(n * n);
            assert!((found - exact).abs() < 1e-5, "{n}: {found} {exact}");
        }
        // Published: glass of 1.5 reflects 9.18 % of diffuse light from outside (Judd 1942).
        assert!((walsh(1.5) - 0.0918).abs() < 1e-4);
    }

    #[test]
    fn internal_mean_agrees_with_integration_from_inside() {
        // The published value for 1.5 (d'Eon and Irving 2011), and the integral that reciprocity was used for.
        assert!((mean_internal(1.5) - 0.5963).abs() < 5e-4, "{}", mean_internal(1.5));
        for eta in [1.1, 1.333, 2.4] {
            let cosines = (0..200_000).map(|i| (f64::from(i) + 0.5) / 2e5);
            let inside: f64 = cosines.map(|cos| 2.0 * cos * dielectric(cos, 1.0 / f64::from(eta)) / 2e5).sum();
            assert!((f64::from(mean_internal(eta)) - inside).abs() < 1e-4, "{eta}: {inside}");
        }
        assert_eq!(mean_internal(1.0), 0.0);
    }
}
