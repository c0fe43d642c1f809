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

/// What an image is measured by. 1 where there is nothing to measure.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// See [`Light::intensity`].
    intensity: f32,
    /// See [`Light::usual`].
    usual: f32,
    /// The diagonal of the box around the hits, or where there are no positions the largest depth.
    extent: f32,
}

/// The known light of an image.
struct Light {
    /// How many pixels have a largest channel above 0 whose bits begin like the number of the bin.
    bins: Vec<u32>,
    brightest: f32,
    /// Sum of the roots of luminances.
    roots: f64,
    /// Pixels whose light is known.
    known: usize,
}

/// The surfaces of an image.
struct Surfaces {
    low: Vec3,
    high: Vec3,
    deepest: f32,
}

/// Bits of a number that its bin does not tell. What is left are sign, exponent and 8 bits: numbers of a bin differ by 1/256 at most.
const BITS_DROPPED: u32 = 15;

/// Share of the lit pixels that are no brighter than what counts as white. Of the rest, a lamp or one path that found it, the largest
/// tells nothing of the other pixels.
const NO_BRIGHTER: f64 = 0.997;

impl Scales {
    /// Of an image on the host.
    pub fn of(input: &FilterInput) -> Self {
        let (mut light, mut surfaces) = (Light::default(), Surfaces::default());
        light.add(&input.radiance);
        surfaces.add(&input.guide);
        Self { intensity: light.intensity(), usual: light.usual(), extent: surfaces.extent() }
    }

    /// Of an image on the device, read back a window at a time.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn of_planes(planes: &Planes) -> Result<Self> {
        let mut surfaces = Surfaces::default();
        for window in windows(planes.guide.len()) {
            surfaces.add(&planes.guide.read_range(window)?);
        }
        Self { intensity: 1.0, usual: 1.0, extent: surfaces.extent() }.with_light(&planes.radiance)
    }

    /// Of other light on the same surfaces.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn with_light(self, radiance: &Buffer<vec4>) -> Result<Self> {
        let mut light = Light::default();
        for window in windows(radiance.len()) {
            light.add(&radiance.read_range(window)?);
        }
        Ok(Self { intensity: light.intensity(), usual: light.usual(), ..self })
    }

    /// `edge` with `intensity`, `usual` and `extent` of the image.
    pub fn applied_to(&self, edge: EdgeSettings) -> EdgeSettings {
        EdgeSettings { intensity: self.intensity, usual: self.usual, extent: self.extent, ..edge }
    }
}

impl Default for Light {
    fn default() -> Self {
        let bins = vec![0; (f32::MAX.to_bits() >> BITS_DROPPED) as usize + 1];
        Self { bins, brightest: 0.0, roots: 0.0, known: 0 }
    }
}

impl Light {
    fn add(&mut self, radiance: &[vec4]) {
        for light in radiance.iter().filter_map(|c| known_radiance(*c)) {
            let most = light.max_element();
            if most > 0.0 {
                self.bins[(most.to_bits() >> BITS_DROPPED) as usize] += 1;
            }
            self.brightest = self.brightest.max(most);
            self.roots += f64::from(luminance(light).max(0.0)).sqrt();
            self.known += 1;
        }
    }

    /// The largest channel that [`NO_BRIGHTER`] of the lit pixels do not exceed: of few pixels, or of like ones, the brightest's.
    fn intensity(&self) -> f32 {
        let lit: u64 = self.bins.iter().map(|&pixels| u64::from(pixels)).sum();
        let wanted = (NO_BRIGHTER * lit as f64).ceil() as u64;
        let mut passed = 0;
        let last = self.bins.iter().position(|&pixels| {
            passed += u64::from(pixels);
            passed >= wanted
        });
        let above = (last.unwrap_or(0) as u32 + 1) << BITS_DROPPED;
        usable(self.brightest.min(f32::from_bits(above - 1)))
    }

    /// The square of the mean root of luminances, which few bright pixels hardly raise.
    fn usual(&self) -> f32 {
        usable((self.roots / self.known.max(1) as f64).powi(2) as f32)
    }
}

impl Default for Surfaces {
    fn default() -> Self {
        Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, deepest: 0.0 }
    }
}

impl Surfaces {
    fn add(&mut self, guide: &[Guide]) {
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

    fn extent(&self) -> f32 {
        let diagonal = if self.low.x <= self.high.x { (self.high - self.low).length() } else { 0.0 };
        usable(if diagonal > 0.0 { diagonal } else { self.deepest })
    }
}

/// The number, or 1 where nothing can be divided by it.
fn usable(v: f32) -> f32 {
    if v.is_normal() && v > 0.0 { v } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn intensity(radiance: Vec<vec4>) -> f32 {
        Scales::of(&FilterInput { radiance, ..FilterInput::default() }).intensity
    }

    #[test]
    fn few_bright_pixels_do_not_tell_what_is_white() {
        let grey = |n: usize| vec![[0.25, 0.5, 0.125, 1.0]; n];
        let black = vec![[0.0, 0.0, 0.0, 1.0]; 5000];
        let with = |lamp: usize, n: usize| [grey(n - lamp), vec![[0.0, 1e6, 0.0, 1.0]; lamp], black.clone()].concat();
        assert_eq!(intensity(grey(1000)), 0.5, "to the bit");
        assert!((0.5..0.503).contains(&intensity(with(3, 1000))), "{}", intensity(with(3, 1000)));
        assert_eq!(intensity(with(4, 1000)), 1e6, "control: a lamp that is no outlier");
        assert_eq!((intensity(black.clone()), intensity(with(1, 1)), intensity(Vec::new())), (1.0, 1e6, 1.0));
        let unknown = [grey(9), vec![[9.0, 9.0, 9.0, 0.0], [f32::NAN, 9.0, 9.0, 1.0]]].concat();
        assert_eq!(intensity(unknown), 0.5);
    }
}
