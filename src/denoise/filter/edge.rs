//! How alike two pixels are. Twin of `glsl/shared/edge.glsl`.
use super::pack::Packed;
use crate::layout::vec3;
use crate::settings::{FINITE_ABOVE_0, FROM_0, settings};
use crate::shaders::shared::edge::{Constants, LEAST_EXPONENT};
use glam::Vec3;
use std::f32::consts::LOG2_E;

settings! {
    /// Which differences stop a filter. A sigma of infinity switches its weight off.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct EdgeSettings {
        /// What is given of them.
        EdgeOverrides {
            /// Scale of radiance: what is white [default: what 99.7 % of the image's lit pixels do not exceed]
            intensity: f32 = 1.0, FINITE_ABOVE_0;
            /// Radiance that is usual: auto takes errors as relative down to a tenth of it [default: the square of the mean root of
            /// the image's luminance]
            usual: f32 = 0.01, FINITE_ABOVE_0;
            /// Scale of distances: the size of what is seen in world units [default: the diagonal of what is seen]
            extent: f32 = 1.0, FINITE_ABOVE_0;
            /// Radiance difference that counts as an edge, in units of --intensity; inf switches it off.
            sigma_rt: f32 = 1.0, FROM_0;
            /// Difference of normals that counts as an edge; inf switches it off.
            sigma_n: f32 = 0.3, FROM_0;
            /// Distance that counts as an edge, in units of --extent; inf switches it off.
            sigma_x: f32 = 0.05, FROM_0;
        }
    }
}

/// Exponents of the edge-stopping weights, in base 2, per squared (or plain) difference; 0 switches a weight off.
#[derive(Clone, Copy, Debug)]
pub struct Rates {
    rt: f32,
    n: f32,
    x: f32,
    squared: bool,
}

/// Of exp(-difference / sigma^2); 0 where that is 1 for every difference.
pub fn rate(sigma: f32) -> f32 {
    match f64::from(LOG2_E) / f64::from(sigma).powi(2) {
        rate if rate < f64::from(f32::MIN_POSITIVE) => 0.0,
        rate => rate.min(f64::from(f32::MAX)) as f32,
    }
}

impl Rates {
    /// The settings' sigmas as they are.
    pub fn new(s: &EdgeSettings) -> Self {
        Self { rt: rate(s.sigma_rt * s.intensity), n: rate(s.sigma_n), x: rate(s.sigma_x * s.extent), squared: true }
    }

    /// The same, per squared difference or per plain one.
    pub fn per_square(self, squared: bool) -> Self {
        Self { squared, ..self }
    }

    /// Without the weight of radiance.
    pub fn of_surfaces(s: &EdgeSettings) -> Self {
        Self { rt: 0.0, ..Self::new(s) }
    }

    /// Constants that leave out the weights that are off.
    pub fn constants(&self) -> Constants {
        Constants { weight_rt: self.rt > 0.0, weight_n: self.n > 0.0, weight_x: self.x > 0.0, squared: self.squared }
    }

    /// As push constants have them.
    pub fn as_array(&self) -> vec3 {
        [self.rt, self.n, self.x]
    }

    /// In base 2. An unknown `p` has no radiance to compare.
    pub fn exponent(&self, p: &Packed, q: &Packed) -> f32 {
        let difference = |d: Vec3| if self.squared { d.length_squared() } else { d.length() };
        let term = |rate: f32, d: Vec3| if rate > 0.0 { rate * difference(d) } else { 0.0 };
        let rt = if p.count > 0.0 { term(self.rt, q.colour - p.colour) } else { 0.0 };
        -rt - term(self.n, q.normal - p.normal) - term(self.x, q.position - p.position)
    }
}

/// The weight of a neighbour; 0 where it is unknown.
pub fn edge_weight(q: &Packed, exponent: f32) -> f32 {
    if q.count > 0.0 && exponent > LEAST_EXPONENT { exponent.exp2() } else { 0.0 }
}
