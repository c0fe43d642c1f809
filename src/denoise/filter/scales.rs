//! The scales that settings count in, taken from an image. This is decided on the host, here and nowhere else: settings are constants
//! of kernels. Pixels are looked at in their order, so that windows of planes tell the same as whole images.
use super::pixel::known_radiance;
use super::{EdgeSettings, FilterInput, Planes};
use crate::denoise::windows;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::layout::{Guide, vec4};
use crate::math::srgb::luminance;
use glam::Vec3;

/// What an image is measured by.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    brightest: f32,
    /// Sum of the roots of luminances.
    roots: f64,
    /// Pixels whose light is known.
    known: usize,
    low: Vec3,
    high: Vec3,
    deepest: f32,
}

impl Default for Scales {
    fn default() -> Self {
        Self { brightest: 0.0, roots: 0.0, known: 0, low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, deepest: 0.0 }
    }
}

impl Scales {
    /// Of an image on the host.
    pub fn of(input: &FilterInput) -> Self {
        let mut scales = Self::default();
        scales.add_light(&input.radiance);
        scales.add_surfaces(&input.guide);
        scales
    }

    /// Of an image on the device, read back a window at a time.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn of_planes(planes: &Planes) -> Result<Self> {
        let mut scales = Self::default().with_light(&planes.radiance)?;
        for window in windows(planes.guide.len()) {
            scales.add_surfaces(&planes.guide.read_range(window)?);
        }
        Ok(scales)
    }

    /// Of other light on the same surfaces.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn with_light(self, radiance: &Buffer<vec4>) -> Result<Self> {
        let mut scales = Self { brightest: 0.0, roots: 0.0, known: 0, ..self };
        for window in windows(radiance.len()) {
            scales.add_light(&radiance.read_range(window)?);
        }
        Ok(scales)
    }

    fn add_light(&mut self, radiance: &[vec4]) {
        for light in radiance.iter().filter_map(|c| known_radiance(*c)) {
            self.brightest = self.brightest.max(light.max_element());
            self.roots += f64::from(luminance(light).max(0.0)).sqrt();
            self.known += 1;
        }
    }

    fn add_surfaces(&mut self, guide: &[Guide]) {
        for hit in guide.iter().filter(|g| g.depth > 0.0 || g.position != [0.0; 3]) {
            let place = Vec3::from(hit.position);
            if place.is_finite() {
                (self.low, self.high) = (self.low.min(place), self.high.max(place));
            }
            if hit.depth.is_finite() {
                self.deepest = self.deepest.max(hit.depth);
            }
        }
    }

    /// `edge` with `intensity`, `usual` and `extent` of the image: its largest known channel, the square of the mean root of its
    /// luminance, which few bright pixels hardly raise, and the diagonal of the box around the hits, or where there are no positions
    /// the largest depth. 1 where there is nothing to measure.
    pub fn applied_to(&self, edge: EdgeSettings) -> EdgeSettings {
        let usable = |v: f32| if v.is_normal() && v > 0.0 { v } else { 1.0 };
        let diagonal = if self.low.x <= self.high.x { (self.high - self.low).length() } else { 0.0 };
        let extent = usable(if diagonal > 0.0 { diagonal } else { self.deepest });
        let usual = usable((self.roots / self.known.max(1) as f64).powi(2) as f32);
        EdgeSettings { intensity: usable(self.brightest), usual, extent, ..edge }
    }
}
