//! Twin of `glsl/shared/microfacet.glsl`: isotropic distributions over normals m with m.z > 0, `alpha` in [0.01, 1].
use crate::math::warp::{INV_PI, circle_point, erf_inverse, erfc_scaled};
use crate::shaders::shared::microfacet::INV_SQRT_PI;
use glam::{Vec2, Vec3, Vec3Swizzles, vec2, vec3};

/// Normal distribution D(m), per steradian; GGX when `ggx`, else Beckmann.
pub fn microfacet_d(ggx: bool, m: Vec3, alpha: f32) -> f32 {
    let c2 = (m.z * m.z).max(1e-8);
    let a2 = alpha * alpha;
    let x = m.xy().length_squared() / (a2 * c2);
    let shape = if ggx { 1.0 / ((1.0 + x) * (1.0 + x)) } else { (-x).exp() };
    shape * INV_PI / (a2 * c2 * c2)
}

/// Smith's masking G1(w), w.z > 0; Beckmann by Walter's rational fit.
pub fn microfacet_g1(ggx: bool, w: Vec3, alpha: f32) -> f32 {
    let t = alpha * w.xy().length();
    if ggx {
        return 2.0 * w.z / (w.z + (w.z * w.z + t * t).sqrt());
    }
    let z2 = w.z * w.z;
    let fit = (3.535 * w.z * t + 2.181 * z2) / (t * t + 2.276 * w.z * t + 2.577 * z2);
    if w.z < 1.6 * t { fit } else { 1.0 }
}

/// c (1 + erf(c / s)) + s exp(-(c / s)^2) / sqrt(pi).
fn beckmann_area(c: f32, s: f32) -> f32 {
    let cot = (c / s.max(1e-10)).min(8.0);
    let e = (-cot * cot).exp();
    c * (2.0 - erfc_scaled(cot) * e) + s * INV_SQRT_PI * e
}

/// Projected area of the microfacets visible along w: w.z / G1 with the exact G1.
pub fn microfacet_area(ggx: bool, w: Vec3, alpha: f32) -> f32 {
    let t = alpha * w.xy().length();
    if ggx { 0.5 * (w.z + (w.z * w.z + t * t).sqrt()) } else { 0.5 * beckmann_area(w.z, t) }
}

/// Spherical caps (Dupuy and Benyoub 2023); `w` stretched to alpha 1, `azimuth` on the unit circle.
fn ggx_visible_normal(w: Vec3, azimuth: Vec2, v: f32) -> Vec3 {
    let t = v * (1.0 + w.z);
    ((t * (2.0 - t)).sqrt() * azimuth + w.xy()).extend((1.0 - t + w.z).max(1e-6))
}

/// One Halley step towards the slope whose visible area is `target`; `mass` = 1 + erf(b).
fn beckmann_step(b: f32, mass: f32, c: f32, s: f32, target: f32) -> f32 {
    let e = INV_SQRT_PI * (-b * b).exp();
    let visible = (c - s * b).max(1e-6);
    let newton = (c * mass + s * e - target) / (2.0 * e * visible);
    let curvature = -2.0 * b - s / visible;
    b - newton / (1.0 - 0.5 * newton * curvature).clamp(0.25, 4.0)
}

/// Slope along the azimuth of the unit direction (s, 0, c) whose visible mass below is `u`, for alpha 1.
pub fn beckmann_slope(c: f32, s: f32, u: f32) -> f32 {
    let cot = (c / s.max(1e-10)).min(4.0);
    let e = (-cot * cot).exp();
    let mass = 2.0 - erfc_scaled(cot) * e;
    let target = u * (c * mass + s * INV_SQRT_PI * e);
    let mass = (mass - mass * (1.0 - u).powf(1.0 + s * (0.3054 * s - 0.9062))).clamp(1e-7, 1.9999998);
    let b = beckmann_step(erf_inverse(mass - 1.0), mass, c, s, target).clamp(-4.0, cot);
    let tail = erfc_scaled(b.abs()) * (-b * b).exp();
    beckmann_step(b, if b < 0.0 { tail } else { 2.0 - tail }, c, s, target).clamp(-4.0, cot)
}

/// `along` and `across` are slopes in and across the azimuth of `w`.
fn beckmann_visible_normal(w: Vec3, along: f32, across: f32) -> Vec3 {
    let s2 = w.xy().length_squared();
    let azimuth = if s2 > 1e-14 { w.xy() / s2.sqrt() } else { vec2(1.0, 0.0) };
    (-along * azimuth + across * vec2(azimuth.y, -azimuth.x)).extend(1.0)
}

/// A normal visible from w: density D(m) max(w.m, 0) / `microfacet_area(w)`.
pub fn microfacet_sample(ggx: bool, w: Vec3, alpha: f32, u: Vec2) -> Vec3 {
    let normals = VisibleNormals::new(ggx, w, alpha);
    normals.at(normals.first(u.x), normals.second(u.y))
}

/// [`microfacet_sample`] in steps: for a grid of random numbers, what follows from one of them alone is computed once.
pub struct VisibleNormals {
    ggx: bool,
    alpha: f32,
    /// The direction that they are visible from, stretched to alpha 1.
    w: Vec3,
}

impl VisibleNormals {
    /// Of those visible from w.
    pub fn new(ggx: bool, w: Vec3, alpha: f32) -> Self {
        Self { ggx, alpha, w: vec3(alpha * w.x, alpha * w.y, w.z).normalize() }
    }

    /// What follows from the first random number: with GGX a point of the unit circle, else a slope in x.
    pub fn first(&self, u: f32) -> Vec2 {
        let w = self.w;
        if self.ggx { circle_point(u) } else { vec2(beckmann_slope(w.z, w.xy().length_squared().sqrt(), u), 0.0) }
    }

    /// What follows from the second random number: with GGX itself, else a slope.
    pub fn second(&self, v: f32) -> f32 {
        if self.ggx { v } else { erf_inverse(2.0 * v - 1.0) }
    }

    /// The normal, of what [`Self::first`] and [`Self::second`] return.
    pub fn at(&self, first: Vec2, second: f32) -> Vec3 {
        let (w, alpha) = (self.w, self.alpha);
        let m = match self.ggx {
            true => ggx_visible_normal(w, first, second),
            false => beckmann_visible_normal(w, first.x, second),
        };
        vec3(alpha * m.x, alpha * m.y, m.z).normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masking_solves_the_worked_example() {
        // alpha 0.5 at 60 degrees: a = 1 / (0.5 tan 60) = 1.154701.
        let w = vec3(0.75f32.sqrt(), 0.0, 0.5);
        let a = 1.154_700_5_f32;
        let fit = (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a);
        assert!((microfacet_g1(false, w, 0.5) - fit).abs() < 1e-6);
        assert!((microfacet_g1(true, w, 0.5) - 2.0 / (1.0 + 1.75f32.sqrt())).abs() < 1e-6);
        assert_eq!(microfacet_g1(false, Vec3::Z, 0.5), 1.0);
    }

    #[test]
    fn fit_stays_within_half_a_percent_of_the_exact_masking() {
        for i in 1..900 {
            let (s, c) = (i as f32 * 0.1).to_radians().sin_cos();
            let w = vec3(s, 0.0, c);
            let ratio = microfacet_g1(false, w, 1.0) * microfacet_area(false, w, 1.0) / c;
            assert!((ratio - 1.0).abs() < 5e-3, "{} degrees: {ratio}", i as f32 * 0.1);
        }
    }

    #[test]
    fn slope_inverts_its_distribution() {
        let cdf = |c: f32, s: f32, b: f32| {
            let tail = erfc_scaled(b.abs()) * (-b * b).exp();
            c * (if b < 0.0 { tail } else { 2.0 - tail }) + s * INV_SQRT_PI * (-b * b).exp()
        };
        for degrees in [0.0f32, 0.01, 5.0, 20.0, 45.0, 70.0, 85.0, 89.0, 89.99, 90.0] {
            let (s, c) = degrees.to_radians().sin_cos();
            let c = c.max(0.0);
            for i in 0..4096 {
                let u = (i as f32 + 0.5) / 4096.0;
                let found = cdf(c, s, beckmann_slope(c, s, u)) / beckmann_area(c, s);
                assert!((found - u).abs() < 2e-6, "{degrees} degrees, u {u}: {found}");
            }
        }
    }
}
