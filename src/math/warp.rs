//! Twin of `glsl/shared/warp.glsl`.
use glam::{Mat3, Vec2, Vec3, vec2, vec3};

/// The reciprocal of pi.
pub const INV_PI: f32 = std::f32::consts::FRAC_1_PI;

/// (cos, sin) of 2 pi u, u in [0, 1).
pub fn circle_point(u: f32) -> Vec2 {
    let x = u - 0.5;
    let q = x.abs() - 0.25;
    let q2 = q * q;
    let s = q * (6.2831853 + q2 * (-41.341681 + q2 * (81.602481 + q2 * (-76.581285 + q2 * 39.760722))));
    let c = 1.0 + q2 * (-19.739206 + q2 * (64.937843 + q2 * (-85.332222 + q2 * 57.026768)));
    vec2(s, if x < 0.0 { c } else { -c })
}

/// Sine and cosine of an angle from 0 to pi (errors below 1e-6), up to pi/2 the sine to a share of itself.
pub fn sine_cosine(angle: f32) -> [f32; 2] {
    let h = 0.5 * angle;
    let q = h * h;
    let s =
        h + h * q * (-0.16666667 + q * (0.0083333333 + q * (-1.9841270e-4 + q * (2.7557319e-6 + q * -2.5052108e-8))));
    let c = 1.0
        + q * (-0.5
            + q * (0.041666667 + q * (-0.0013888889 + q * (2.4801587e-5 + q * (-2.7557319e-7 + q * 2.0876757e-9)))));
    [2.0 * s * c, 1.0 - 2.0 * s * s]
}

/// A point uniformly distributed on the unit disk.
pub fn warp_disk(u: Vec2) -> Vec2 {
    u.x.sqrt() * circle_point(u.y)
}

/// A direction around +z with density cos / pi.
pub fn warp_cosine_hemisphere(u: Vec2) -> Vec3 {
    warp_disk(u).extend((1.0 - u.x).sqrt())
}

/// A direction uniformly distributed on the unit sphere.
pub fn warp_sphere(u: Vec2) -> Vec3 {
    (2.0 * (u.x * (1.0 - u.x)).sqrt() * circle_point(u.y)).extend(1.0 - 2.0 * u.x)
}

/// A direction uniformly distributed in the cone around z.
pub fn warp_cone(u: Vec2, one_minus_cos_max: f32) -> Vec3 {
    let t = u.x * one_minus_cos_max;
    ((t * (2.0 - t)).sqrt() * circle_point(u.y)).extend(1.0 - t)
}

/// Barycentric weights of vertices 1 and 2 of a point uniformly distributed by area.
pub fn warp_triangle(u: Vec2) -> Vec2 {
    let h = 0.5 * u;
    if u.x < u.y { vec2(h.x, u.y - h.x) } else { vec2(u.x - h.y, h.y) }
}

/// An offset in [-1, 1] pixels along one axis, distributed as the triangle filter of radius 1.
pub fn warp_tent(u: f32) -> f32 {
    let v = 2.0 * u - 1.0;
    let r = 1.0 - (1.0 - v.abs()).sqrt();
    if v < 0.0 { -r } else { r }
}

/// erfc(x) exp(x^2) for x >= 0, absolute error 1.5e-7 before the exponential.
pub fn erfc_scaled(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.3275911 * x);
    t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))))
}

/// Inverse error function; finite on [-1, 1].
pub fn erf_inverse(x: f32) -> f32 {
    let w = -((1.0 - x) * (1.0 + x)).max(1.2e-7).ln();
    let tail = w >= 5.0;
    let w = if tail { w.sqrt() - 3.0 } else { w - 2.5 };
    let mut p = if tail { -0.000200214257 } else { 2.81022636e-08 };
    p = (if tail { 0.000100950558 } else { 3.43273939e-07 }) + p * w;
    p = (if tail { 0.00134934322 } else { -3.5233877e-06 }) + p * w;
    p = (if tail { -0.00367342844 } else { -4.39150654e-06 }) + p * w;
    p = (if tail { 0.00573950773 } else { 0.00021858087 }) + p * w;
    p = (if tail { -0.0076224613 } else { -0.00125372503 }) + p * w;
    p = (if tail { 0.00943887047 } else { -0.00417768164 }) + p * w;
    p = (if tail { 1.00167406 } else { 0.246640727 }) + p * w;
    p = (if tail { 2.83297682 } else { 1.50140941 }) + p * w;
    p * x
}

/// An offset along one axis, distributed as the Gaussian filter of standard deviation 0.5 pixels, cut at 2 pixels.
pub fn warp_gaussian(u: f32) -> f32 {
    (0.707106781 * erf_inverse(0.99993666 * (2.0 * u - 1.0))).clamp(-2.0, 2.0)
}

/// A right-handed frame around any unit n; its columns are tangent, bitangent, n.
pub fn basis_from_normal(n: Vec3) -> Mat3 {
    let s = if n.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    let tangent = vec3(1.0 + s * n.x * n.x * a, s * b, -s * n.x);
    Mat3::from_cols(tangent, vec3(b, s + n.y * n.y * a, -n.y), n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn circle_point_matches_the_library() {
        for i in 0..100_000 {
            let u = i as f32 / 100_000.0;
            let (s, c) = (f64::from(u) * std::f64::consts::TAU).sin_cos();
            assert!((circle_point(u) - vec2(c as f32, s as f32)).length() < 5e-7, "{u}");
        }
    }

    #[test]
    fn sines_and_cosines_match_the_library_and_small_sines_keep_their_digits() {
        for i in 1..=100_000 {
            let angle = std::f32::consts::PI * i as f32 / 100_000.0;
            for angle in [angle, 1e-4 * angle] {
                let (s, c) = f64::from(angle).sin_cos();
                let [sine, cosine] = sine_cosine(angle).map(f64::from);
                // Towards pi the angle itself has fewer digits.
                assert!((sine - s).abs() < 3e-7 * s + if angle > 1.6 { 5e-7 } else { 0.0 }, "sine of {angle}");
                assert!((cosine - c).abs() < 1e-6, "cosine of {angle}");
            }
        }
        assert_eq!(sine_cosine(0.0), [0.0, 1.0]);
    }

    #[test]
    fn error_functions_match_published_values() {
        // Abramowitz and Stegun, table 7.1.
        for (x, erf) in [(0.1f32, 0.1124629160), (0.5, 0.5204998778), (1.0, 0.8427007929), (2.0, 0.9953222650)] {
            assert!((1.0 - erfc_scaled(x) * (-x * x).exp() - erf).abs() < 3e-7, "erf({x})");
            assert!((erf_inverse(erf) - x).abs() < 2e-5 && (erf_inverse(-erf) + x).abs() < 2e-5, "inverse at {x}");
        }
        assert!(erf_inverse(1.0).is_finite() && erf_inverse(-1.0) < -3.5);
    }

    #[test]
    fn filters_hit_their_ends_and_quartiles() {
        assert_eq!([warp_tent(0.0), warp_tent(0.5), warp_tent(0.125), warp_tent(0.875)], [-1.0, 0.0, -0.5, 0.5]);
        // Upper quartile of the normal distribution: 0.6744898 standard deviations.
        assert!((warp_gaussian(0.75) - 0.5 * 0.6744898).abs() < 1e-4);
        assert!((warp_gaussian(0.0) + 2.0).abs() < 2e-2);
    }

    #[test]
    fn basis_is_right_handed_everywhere() {
        for n in [Vec3::Z, -Vec3::Z, Vec3::X, -Vec3::Y, vec3(1e-4, -1e-4, -1.0).normalize()] {
            let m = basis_from_normal(n);
            assert!((m.transpose() * m - Mat3::IDENTITY).to_cols_array().iter().all(|e| e.abs() < 1e-6), "{n}");
            assert!((m.determinant() - 1.0).abs() < 1e-6, "{n}");
        }
    }
}
