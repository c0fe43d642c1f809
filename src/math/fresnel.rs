//! Twin of `glsl/shared/fresnel.glsl`.
use glam::{Vec2, Vec3, vec2};

/// x: reflectance at cosine `c` >= 0 for `eta` = index beyond / index on this side; y: cosine of the refracted ray.
pub fn fresnel_dielectric(c: f32, eta: f32) -> Vec2 {
    let c = c.max(1e-10);
    let g2 = (eta - 1.0) * (eta + 1.0) + c * c;
    let g = g2.max(0.0).sqrt();
    let e = eta * eta;
    let rs = (c - g) / (c + g);
    let rp = (e * c - g) / (e * c + g);
    if g2 > 0.0 { vec2(0.5 * (rs * rs + rp * rp), (g / eta).min(1.0)) } else { vec2(1.0, 0.0) }
}

/// Reflectance of a conductor per channel, from index `eta` and extinction `k` relative to the outside.
pub fn fresnel_conductor(c: f32, eta: Vec3, k: Vec3) -> Vec3 {
    let c = c.clamp(1e-8, 1.0);
    let c2 = c * c;
    let s2 = 1.0 - c2;
    let t = (eta - 1.0) * (eta + 1.0) - k * k + c2;
    let m = (t * t + 4.0 * eta * eta * k * k).map(f32::sqrt);
    let ac = 2.0 * c * (0.5 * (m + t)).max(Vec3::ZERO).map(f32::sqrt);
    let rs = (m + c2 - ac) / (m + c2 + ac);
    let p = (c2 * m + s2 * s2).max(Vec3::splat(1e-30));
    let rp = rs * (p - ac * s2) / (p + ac * s2);
    0.5 * (rs + rp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3;

    #[test]
    fn dielectric_solves_the_worked_examples() {
        // Normal incidence ((n - 1) / (n + 1))^2; Brewster's angle: the parallel amplitude is gone; total reflection.
        assert!((fresnel_dielectric(1.0, 1.5).x - 0.04).abs() < 1e-7);
        let brewster = fresnel_dielectric((1.0f32 / (1.0 + 2.25)).sqrt(), 1.5).x;
        assert!((brewster - 0.5 * (1.25f32 / 3.25).powi(2)).abs() < 1e-6, "{brewster}");
        assert_eq!(fresnel_dielectric(0.5, 1.0 / 1.5), vec2(1.0, 0.0));
        assert!(fresnel_dielectric(1e-7, 1.0).x < 1e-6 && fresnel_dielectric(0.3, 1.0).x < 1e-12);
    }

    #[test]
    fn conductor_without_extinction_is_a_dielectric() {
        for c in [0.0, 1e-7, 0.01, 0.3, 0.8, 1.0] {
            for eta in [0.6, 1.0, 1.5, 3.0] {
                let r = fresnel_conductor(c, Vec3::splat(eta), Vec3::ZERO).x;
                let expected = if eta == 1.0 { 0.0 } else { fresnel_dielectric(c, eta).x };
                assert!((r - expected).abs() < 2e-4, "cos {c} eta {eta}: {r} {expected}");
            }
        }
        // Normal incidence: ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
        let gold = fresnel_conductor(1.0, vec3(0.2, 0.92, 1.1), vec3(3.9, 2.45, 2.14));
        assert!((gold.x - (0.64 + 15.21) / (1.44 + 15.21)).abs() < 1e-6, "{gold}");
    }

    #[test]
    fn a_conductor_of_index_zero_reflects_all() {
        for c in [0.0, 1e-7, 0.3, 0.8, 1.0 - 6e-8, 1.0] {
            let r = fresnel_conductor(c, Vec3::ZERO, vec3(0.0, 1e-30, 1.0));
            assert!((r - 1.0).abs().cmplt(Vec3::splat(1e-6)).all(), "cos {c}: {r}");
        }
    }
}
