//! Image files of any renderer as noisy images: which AOV fills which plane, and what has to be made up.
mod albedo;
mod places;

use super::noisy::{Holds, Noisy};
use super::windows;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Location};
use crate::image::aov::{Aov, Aovs};
use crate::layout::{Guide, NONE, PixelLight, PixelStats};
use crate::render::film::{ALBEDO, BLUR, INDIRECT_M2, INDIRECT_STRIDE, LIGHT_REMAINDER, SHARP_DIRECT};
use bytemuck::Pod;
use glam::Vec3;
use places::Places;

/// The AOVs of a file, read pixel by pixel as the planes of a [`Noisy`] image: nothing is copied before it is asked for.
pub struct Layers<'a> {
    aovs: &'a Aovs<'a>,
    places: Places,
    /// Whether the file tells what surfaces reflect.
    reflects: bool,
    indirect_m2: Option<&'a [f32]>,
    remainder: Option<&'a [u32]>,
    blur: Option<&'a [f32]>,
    /// What had to be made up: one line each.
    pub notes: Vec<String>,
}

impl<'a> Layers<'a> {
    /// Looks at all that must be known before the first pixel.
    pub fn new(aovs: &'a Aovs<'a>) -> Self {
        let (film, mut notes) = (aovs.film, Vec::new());
        let apart = [Aov::Direct, Aov::Indirect, Aov::Albedo].iter().all(|aov| aovs.get(*aov).is_some());
        if apart && !film.metadata.contains_key(ALBEDO) {
            notes.push(
                "an earlier version of tallow wrote this file, with another albedo: pixels that show several surfaces come out \
                 too bright or too dark; render it anew"
                    .to_owned(),
            );
        }
        let mut layers = Self {
            aovs,
            places: Places::new(aovs, &mut notes),
            reflects: false,
            indirect_m2: film.floats(INDIRECT_M2).filter(|_| aovs.get(Aov::Indirect).is_some()),
            remainder: film.words(LIGHT_REMAINDER),
            blur: film.floats(BLUR),
            notes,
        };
        layers.reflects = layers.judge_albedo();
        layers
    }

    /// What the planes will hold.
    pub fn holds(&self) -> Holds {
        let has = |aov| self.aovs.get(aov).is_some();
        Holds {
            of_file: true,
            albedo: self.reflects,
            light: has(Aov::Direct) && has(Aov::Indirect),
            variance: has(Aov::Variance),
            indirect_variance: self.indirect_m2.is_some(),
            sharp_direct: self.aovs.film.metadata.get(SHARP_DIRECT).is_none_or(|said| said != "false"),
            blur: self.blur.is_some(),
            indirect_stride: self.indirect_stride(),
        }
    }

    fn indirect_stride(&self) -> u32 {
        let said = self.aovs.film.metadata.get(INDIRECT_STRIDE).filter(|_| self.aovs.get(Aov::Indirect).is_some());
        said.and_then(|n| n.parse().ok()).unwrap_or(1).max(1)
    }

    /// The colour as it is, a plane a channel; a pixel of it that is no number becomes 0.
    pub fn colour(&self) -> [Vec<f32>; 3] {
        let pixels = self.aovs.film.pixels();
        let mut planes = [0; 3].map(|_| Vec::with_capacity(pixels));
        let Some(stored) = self.aovs.get(Aov::Colour) else { return planes };
        for pixel in (0..pixels).map(|i| stored.at(i)) {
            let known = pixel.iter().all(|v| v.is_finite());
            planes.iter_mut().zip(pixel).for_each(|(plane, v)| plane.push(if known { v } else { 0.0 }));
        }
        planes
    }

    /// Copies the file's pixels to the device.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when they do not fit.
    pub fn upload(&self, gpu: &Gpu) -> Result<Noisy> {
        let (pixels, holds) = (self.aovs.film.pixels(), self.holds());
        Ok(Noisy {
            size: self.aovs.film.size(),
            stats: filled(gpu, "stats", pixels, |i| self.stats(i))?,
            light: filled(gpu, "light", if holds.light { pixels } else { 1 }, |i| self.light(i))?,
            guide: filled(gpu, "guide", pixels, |i| self.guide(i))?,
            blur: filled(gpu, "blur of the lens", self.blur.map_or(1, <[f32]>::len), |i| self.blur(i))?,
            holds,
        })
    }

    /// Colour and variance with their samples: those of the pixel, or of all; `UNTOLD` where the file does not say; 0 where it
    /// holds nothing.
    pub fn stats(&self, i: usize) -> PixelStats {
        let count = if self.aovs.holds(i) { self.aovs.samples(i).unwrap_or(UNTOLD) } else { 0.0 };
        let m2 = self.aovs.variance(i).unwrap_or_default();
        let mean = self.aovs.get(Aov::Colour).map_or([0.0; 3], |plane| plane.at(i));
        PixelStats { mean, count: count.to_bits(), m2, ..Default::default() }
    }

    /// Direct light and the albedo of all other light, 0 where the file does not keep them apart.
    pub fn light(&self, i: usize) -> PixelLight {
        let at = |aov| self.aovs.get(aov).map_or([0.0; 3], |plane| plane.at(i));
        PixelLight {
            direct: at(Aov::Direct),
            indirect_m2: self.indirect_m2.map_or(0.0, |m2| m2[i]),
            albedo: self.albedo(i),
            remainder: self.remainder.map_or(0, |words| words[i]),
            ..Default::default()
        }
    }

    /// How far a lens blurs what the pixel shows, from 0 to 1; 0 for what is no number.
    pub fn blur(&self, i: usize) -> f32 {
        let blur = self.blur.map_or(0.0, |blur| blur[i]);
        if blur > 0.0 { blur.min(1.0) } else { 0.0 }
    }

    /// The surface, zero where nothing is known.
    pub fn guide(&self, i: usize) -> Guide {
        let normal = vector(self.aovs, Aov::Normal, i);
        // Means over a pixel's samples are shorter than 1. Normals that are unit but for rounding stay as they are, so that a
        // render and its file become the same picture, to the bit.
        let normal = if normal.is_normalized() { normal } else { normal.normalize_or_zero() };
        let (position, depth) = self.places.at(self.aovs, i);
        let hit = (self.aovs.holds(i) && depth > 0.0) || normal != Vec3::ZERO;
        Guide {
            normal: normal.into(),
            depth,
            position: position.into(),
            object: if hit { 0 } else { NONE },
            albedo: self.albedo(i),
            material: if hit && self.blur(i) == 0.0 { 0 } else { NONE },
            ..Default::default()
        }
    }
}

/// Samples that a pixel is taken to have where its file does not say. Of fewer `auto` trusts neither the image nor svgf: a Cycles file of
/// 64 samples, taken for one, came out with more error than it had.
const UNTOLD: f32 = 4.0;

/// 0 where there is none, or what there is is no number.
fn vector(aovs: &Aovs, aov: Aov, i: usize) -> Vec3 {
    let plane = aovs.get(aov).map(|plane| Vec3::from(plane.at(i)));
    plane.filter(|v| v.is_finite()).unwrap_or_default()
}

/// A buffer on the device, filled a window at a time.
fn filled<T: Pod>(gpu: &Gpu, name: &str, len: usize, value: impl Fn(usize) -> T) -> Result<Buffer<T>> {
    let buffer = Buffer::new(gpu, name, len, Location::Device)?;
    for window in windows(len) {
        let first = window.start;
        buffer.write(first, &window.map(&value).collect::<Vec<_>>())?;
    }
    Ok(buffer)
}
