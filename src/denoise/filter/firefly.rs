//! Outliers cut before filtering, as a step of its own that says what it took away. Kernel: `glsl/filter/firefly.comp`. Twin:
//! [`reference()`].
use super::pixel::known_radiance;
use super::{FilterInput, Planes};
use crate::denoise::windows;
use crate::error::{Checked, Error, Result};
use crate::gpu::{Buffer, FrameResources, Gpu, Kernel, Location, Recorder};
use crate::layout::{FireflyPush, vec3, vec4};
use crate::math::srgb::luminance;
use crate::shaders::firefly::{Bind, Constants};
use crate::shaders::shared::dominated::DOMINATED;
use glam::Vec3;
use std::str::FromStr;

/// Which outliers are cut: pixels so many times brighter than the second brightest of the 24 around them, if one sample has brought
/// their light. Without the variance of samples, or with one sample, nothing tells, and stars and glints count as outliers too.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Fireflies {
    /// None.
    Off,
    /// Those above [`Fireflies::USUAL`] times.
    #[default]
    Usual,
    /// Those above so many times, at least 1.
    Above(f32),
}

impl Fireflies {
    /// Of 4, 8 and 20, at 2 samples 4 raises FLIP of Crytek Sponza by .4 %, and 20 leaves 4 % more error in a glass
    /// Cornell box than 8. Without variance, at 4 and 32 samples of two scenes of Mitsuba, `auto` has .94 to 1.005
    /// times the error with 8, .99 to 1 with 16.
    pub const USUAL: f32 = 8.0;

    /// None where nothing is cut.
    pub fn factor(self) -> Option<f32> {
        match self {
            Self::Off => None,
            Self::Usual => Some(Self::USUAL),
            Self::Above(factor) => Some(factor),
        }
    }
}

impl FromStr for Fireflies {
    type Err = String;

    fn from_str(text: &str) -> Checked<Self> {
        match text.parse() {
            _ if text == "off" => Ok(Self::Off),
            Ok(factor) if factor >= 1.0 => Ok(Self::Above(factor)),
            _ => Err("expected off, or a number of at least 1".to_owned()),
        }
    }
}

/// What was cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Removed {
    /// Pixels that were cut.
    pub pixels: usize,
    /// Sum of the known radiance that was cut off, per channel.
    pub radiance: [f64; 3],
    /// Size of what was cut off over that of all the image's light, summed over pixels and channels without their signs; 0 for a black
    /// image.
    pub share: f64,
}

impl Removed {
    /// One line for the user.
    pub fn note(&self) -> String {
        format!("fireflies: {} pixels cut, {:.3} % of what is filtered", self.pixels, 100.0 * self.share)
    }
}

/// The kernel, and the light as it was.
pub struct Cut {
    kernel: Kernel<Bind<'static>>,
    /// Of every pixel, to be cut into [`Planes::radiance`].
    pub whole: Buffer<vec4>,
    nothing: Buffer<vec3>,
    factor: f32,
}

impl Cut {
    /// Of the `whole` light of images such as `planes`.
    ///
    /// # Errors
    /// [`Error::Usage`] for a factor below 1, [`Error::Device`] when it does not fit.
    pub fn new(gpu: &Gpu, whole: Buffer<vec4>, planes: &Planes, factor: f32) -> Result<Self> {
        if factor.is_nan() || factor < 1.0 {
            return Err(Error::Usage(format!("the firefly factor is {factor}: choose a number of at least 1")));
        }
        let (measured, local_size_x) = (planes.variance.is_some(), gpu.tuning().filter_workgroup);
        Ok(Self {
            kernel: Kernel::new(gpu, &Constants { local_size_x, measured })?,
            whole,
            nothing: Buffer::new(gpu, "no variance", 1, Location::Device)?,
            factor,
        })
    }

    /// whole\[P\], variance\[P\] -> radiance\[P\], variance\[P\]
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let push = FireflyPush { size: planes.size, factor: self.factor, ..Default::default() };
        let variance = planes.variance.as_ref().unwrap_or(&self.nothing);
        let bind = Bind { radiance: &self.whole, variance, cut: &planes.radiance };
        rec.dispatch(&self.kernel, bind, &push, self.kernel.groups(planes.size))
    }

    /// What the last run has cut.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn removed(&self, planes: &Planes) -> Result<Removed> {
        let mut tally = Tally::default();
        for window in windows(self.whole.len()) {
            tally.add(&self.whole.read_range(window.clone())?, &planes.radiance.read_range(window)?);
        }
        Ok(tally.removed())
    }
}

/// Cuts the pixels of `input` that are more than `factor` (at least 1) times brighter than the second brightest of the 24 around
/// them, most of which are lit, and where their variance is known, if one sample has brought their light. Negative light counts by its size.
///
/// # Errors
/// [`Error::Usage`] for a factor below 1 or planes of wrong sizes, [`Error::Device`] when the device fails.
pub fn remove_fireflies(gpu: &Gpu, input: &mut FilterInput, factor: f32) -> Result<Removed> {
    input.validate()?;
    let mut planes = Planes::new(gpu, input)?;
    let cut = Cut::new(gpu, planes.radiance.clone(), &planes, factor)?;
    planes.radiance = Buffer::new(gpu, "cut", cut.whole.len(), Location::Device)?;
    gpu.run(&mut FrameResources::new(gpu)?, |rec| cut.record(rec, &planes))?;
    input.radiance = planes.radiance.read()?;
    input.variance = planes.variance.as_ref().map(Buffer::read).transpose()?;
    cut.removed(&planes)
}

/// What is missing in `after`.
pub fn removed(before: &[vec4], after: &[vec4]) -> Removed {
    let mut tally = Tally::default();
    tally.add(before, after);
    tally.removed()
}

/// Sums over pixels.
#[derive(Default)]
struct Tally {
    pixels: usize,
    radiance: [f64; 3],
    /// Over all channels, without their signs: what was cut, and what there was.
    cut: f64,
    all: f64,
}

impl Tally {
    fn add(&mut self, before: &[vec4], after: &[vec4]) {
        for (before, after) in before.iter().zip(after) {
            let Some(before) = known_radiance(*before) else { continue };
            self.pixels += usize::from(before.to_array() != after[..3]);
            for c in 0..3 {
                let cut = f64::from(before[c]) - f64::from(after[c]);
                self.radiance[c] += cut;
                self.cut += cut.abs();
            }
            self.all += before.as_dvec3().abs().element_sum();
        }
    }

    fn removed(self) -> Removed {
        let Self { pixels, radiance, cut, all } = self;
        let share = if all > 0.0 { cut / all } else { 0.0 };
        Removed { pixels, radiance, share }
    }
}

/// Twin of the kernel.
pub fn reference(input: &FilterInput, factor: f32) -> FilterInput {
    let mut cut = input.clone();
    for (at, radiance) in input.radiance.iter().enumerate() {
        let Some(here) = known_radiance(*radiance) else {
            cut.radiance[at] = [0.0; 4];
            continue;
        };
        let around = around(input, at);
        let lit = around.iter().filter(|v| **v > 0.0).count();
        let (bright, most) = (luminance(here).abs(), around.get(1).map_or(f32::INFINITY, |second| factor * second));
        let outlier = 2 * lit > around.len() && bright > most && dominated(input, at, bright);
        let kept = if outlier { most / bright } else { 1.0 };
        cut.radiance[at] = (here * kept).extend(radiance[3]).into();
        cut.variance.iter_mut().filter(|_| outlier).for_each(|v| v[at] = v[at].map(|v| v * kept * kept));
    }
    cut
}

/// Sizes of the luminances of the known pixels around one, the largest first.
fn around(input: &FilterInput, at: usize) -> Vec<f32> {
    let (width, height) = (i64::from(input.width), i64::from(input.height));
    let at = at as i64;
    let mut around: Vec<f32> = (0..25)
        .map(|i| (at % width + i % 5 - 2, at / width + i / 5 - 2))
        .filter(|&(u, v)| (0..width).contains(&u) && (0..height).contains(&v) && v * width + u != at)
        .filter_map(|(u, v)| known_radiance(input.radiance[(v * width + u) as usize]))
        .map(|c| luminance(c).abs())
        .collect();
    around.sort_by(|a, b| b.total_cmp(a));
    around
}

fn dominated(input: &FilterInput, at: usize, bright: f32) -> bool {
    let Some(variance) = input.variance.as_ref().filter(|_| input.radiance[at][3] >= 2.0) else { return true };
    let v = Vec3::from(variance[at]);
    v.is_finite() && luminance(v.max(Vec3::ZERO).map(f32::sqrt)) > DOMINATED * bright
}
