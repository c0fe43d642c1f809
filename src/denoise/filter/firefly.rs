//! Outliers cut before filtering, as a step of its own that says what it took away. Kernel: `glsl/filter/firefly.comp`.
use super::pixel::known_radiance;
use super::{FilterInput, Planes};
use crate::denoise::windows;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, FrameResources, Gpu, Kernel, Location, Recorder};
use crate::layout::{FireflyPush, vec4};
use crate::math::srgb::luminance;
use crate::shaders::firefly::{Bind, Constants};

/// What was cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Removed {
    /// Pixels that were cut.
    pub pixels: usize,
    /// Sum of the known radiance that was cut off, per channel.
    pub radiance: [f64; 3],
    /// The same as a share of all the image's, over all channels; 0 for a black image.
    pub share: f64,
}

/// The kernel.
pub struct Fireflies(Kernel<Bind<'static>>);

impl Fireflies {
    /// # Errors
    /// [`Error::Device`] when the driver refuses it.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(Kernel::new(gpu, &Constants::default())?))
    }

    /// radiance\[P\] -> cut\[P\]; `factor` as in [`remove_fireflies`].
    pub fn record(
        &self,
        rec: &mut Recorder,
        size: [u32; 2],
        factor: f32,
        radiance: &Buffer<vec4>,
        cut: &Buffer<vec4>,
    ) -> Result<()> {
        let push = FireflyPush { size, factor, ..Default::default() };
        rec.dispatch(&self.0, Bind { radiance, cut }, &push, self.0.groups(size))
    }
}

/// Cuts the pixels of `input` that are more than `factor` (at least 1) times brighter than the second brightest of the
/// 24 around them.
///
/// # Errors
/// [`Error::Usage`] for a factor below 1 or planes of wrong sizes, [`Error::Device`] when the device fails.
pub fn remove_fireflies(gpu: &Gpu, input: &mut FilterInput, factor: f32) -> Result<Removed> {
    input.validate()?;
    let mut planes = Planes::new(gpu, input)?;
    let removed = cut(gpu, &mut planes, factor)?;
    input.radiance = planes.radiance.read()?;
    Ok(removed)
}

/// The same on the device.
///
/// # Errors
/// As [`remove_fireflies`].
pub fn cut(gpu: &Gpu, planes: &mut Planes, factor: f32) -> Result<Removed> {
    if !(factor >= 1.0 && factor.is_finite()) {
        return Err(Error::Usage(format!("the firefly factor is {factor}: choose a finite number of at least 1")));
    }
    let cut = Buffer::new(gpu, "cut", planes.radiance.len(), Location::Device)?;
    let kernel = Fireflies::new(gpu)?;
    let record = |rec: &mut Recorder| kernel.record(rec, planes.size, factor, &planes.radiance, &cut);
    gpu.run(&mut FrameResources::new(gpu)?, record)?;
    let mut tally = Tally::default();
    for window in windows(cut.len()) {
        tally.add(&planes.radiance.read_range(window.clone())?, &cut.read_range(window)?);
    }
    planes.radiance = cut;
    Ok(tally.removed())
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
    all: f64,
}

impl Tally {
    fn add(&mut self, before: &[vec4], after: &[vec4]) {
        for (before, after) in before.iter().zip(after) {
            let Some(before) = known_radiance(*before) else { continue };
            self.pixels += usize::from(before.to_array() != after[..3]);
            (0..3).for_each(|c| self.radiance[c] += f64::from(before[c]) - f64::from(after[c]));
            self.all += before.as_dvec3().element_sum();
        }
    }

    fn removed(self) -> Removed {
        let Self { pixels, radiance, all } = self;
        let share = if all > 0.0 { radiance.iter().sum::<f64>() / all } else { 0.0 };
        Removed { pixels, radiance, share }
    }
}

/// Twin of the kernel.
pub fn reference(input: &FilterInput, factor: f32) -> Vec<vec4> {
    let (width, height) = (i64::from(input.width), i64::from(input.height));
    let pixel = |at: i64| {
        let Some(here) = known_radiance(input.radiance[at as usize]) else { return [0.0; 4] };
        let mut around: Vec<f32> = (0..25)
            .map(|i| (at % width + i % 5 - 2, at / width + i / 5 - 2))
            .filter(|&(u, v)| (0..width).contains(&u) && (0..height).contains(&v) && v * width + u != at)
            .filter_map(|(u, v)| known_radiance(input.radiance[(v * width + u) as usize]))
            .map(|c| luminance(c).max(0.0))
            .collect();
        around.sort_by(|a, b| b.total_cmp(a));
        let (bright, most) = (luminance(here), around.get(1).map_or(f32::INFINITY, |second| factor * second));
        let kept = if bright > most { here * (most / bright) } else { here };
        kept.extend(input.radiance[at as usize][3]).into()
    };
    (0..width * height).map(pixel).collect()
}
