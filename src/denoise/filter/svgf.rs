//! À-Trous wavelets steered by each pixel's variance: the spatial half of SVGF (Schied et al., HPG 2017). Kernel:
//! `glsl/filter/svgf.comp`.
use super::atrous_taps::{b3_spline, threads};
use super::edge::{EdgeSettings, Rates, edge_weight};
use super::noise_estimate::{self, Estimate, contrast};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, Planes, Row};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{SvgfPush, vec4};
use crate::settings::{FROM_0, settings};
use crate::shaders::svgf::{Bind, Constants, FEW, LEAST_DEVIATION, STEEPEST};
use crate::threads::each;
use glam::Vec3;
use std::f32::consts::LOG2_E;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "svgf",
    about: "À-Trous wavelets whose radiance weight counts in each pixel's standard deviations",
    bytes: super::pack::BYTES + 32, // estimate and scratch
    weighs_noise: true,
    make: |gpu, s, size| Ok(Box::new(Svgf::new(gpu, &s.edge, &s.svgf, s.footprint.levels, size)?)),
    reference: |input, s| reference(input, &s.edge, &s.svgf, s.footprint.levels),
};

settings! {
    /// What `svgf` can be told, and `auto`, which has levels of it.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SvgfSettings {
        /// What is given of them.
        SvgfOverrides {
            /// Standard deviations of a pixel's luminance that count as an edge; `svgf` takes (8 / n)^(1/4) of it for n > 8 samples.
            sigma_l: f32 = 4.0, FROM_0;
        }
    }
}

/// Alone, it packs what it reads and estimates its noise.
struct Svgf {
    pack: Pack,
    estimate: Estimate,
    levels: Levels,
}

/// The levels of the filter, on what is packed and estimated already.
pub struct Levels {
    /// All levels but the last, and the last.
    kernels: [Kernel<Bind<'static>>; 2],
    /// One for each image; of one pixel where there is no second.
    scratch: [Buffer<vec4>; 2],
    rates: Rates,
    rate_l: f32,
    levels: u32,
}

impl SvgfSettings {
    /// Per standard deviation, in base 2.
    fn rate_l(&self) -> f32 {
        (LOG2_E / self.sigma_l).min(STEEPEST)
    }
}

impl Levels {
    /// For images of (width, height): one, whose weights narrow with the number of samples, or `two` that are filtered together.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when it does not fit.
    pub fn new(
        gpu: &Gpu,
        edge: &EdgeSettings,
        own: &SvgfSettings,
        levels: u32,
        [width, height]: [u32; 2],
        two: bool,
    ) -> Result<Self> {
        let rates = Rates::of_surfaces(edge);
        let (edge, local_size_x) = (rates.constants(), gpu.tuning().filter_workgroup);
        let kernel = |last| Kernel::new(gpu, &Constants { edge, local_size_x, last, two });
        let pixels = width as usize * height as usize;
        let scratch = |pixels| Buffer::new(gpu, "svgf", pixels, Location::Device);
        Ok(Self {
            kernels: each([false, true], kernel)?,
            scratch: [scratch(pixels)?, scratch(if two { pixels } else { 1 })?],
            rates,
            rate_l: own.rate_l(),
            levels,
        })
    }

    /// Of each image: estimate\[P\], which is lost, as [`Estimate`] has it, and what is packed -> output\[P\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the image is too large for the device.
    pub fn record(&self, rec: &mut Recorder, size: [u32; 2], pack: &Pack, images: &[[&Buffer<vec4>; 2]]) -> Result<()> {
        // A kernel of one image needs something to bind.
        let images = [images[0], images.get(1).copied().unwrap_or([&self.scratch[1]; 2])];
        let mut from = images.map(|[estimate, _]| estimate);
        for level in 0..self.levels {
            let last = level + 1 == self.levels;
            let to = [0, 1].map(|image| match last {
                true => images[image][1],
                false if level % 2 == 0 => &self.scratch[image],
                false => images[image][0],
            });
            let (spacing, rates) = (1 << level, self.rates.as_array());
            let push = SvgfPush { size, spacing, rate_l: self.rate_l, rates, ..Default::default() };
            let bind = Bind {
                estimate: from[0],
                second: from[1],
                packed_pixels: pack.bind(),
                filtered: to[0],
                second_filtered: to[1],
            };
            let kernel = &self.kernels[usize::from(last)];
            rec.dispatch(kernel, bind, &push, kernel.groups(threads(size, spacing)))?;
            from = to;
        }
        Ok(())
    }
}

impl Svgf {
    fn new(gpu: &Gpu, edge: &EdgeSettings, own: &SvgfSettings, levels: u32, size: [u32; 2]) -> Result<Self> {
        Ok(Self {
            pack: Pack::new(gpu, size)?,
            estimate: Estimate::new(gpu, edge, false, size)?,
            levels: Levels::new(gpu, edge, own, levels, size, false)?,
        })
    }
}

impl Filter for Svgf {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        self.estimate.record(rec, planes, &self.pack)?;
        self.levels.record(rec, planes.size, &self.pack, &[[&self.estimate.plane, &planes.output]])
    }
}

/// A pixel with the variance of its luminance, -1 where it is unknown.
pub type Noisy = (Packed, f32);

/// One level over an image.
struct Level<'a> {
    image: &'a [Noisy],
    size: [i64; 2],
    spacing: i64,
    rates: Rates,
    rate_l: f32,
    narrows: bool,
}

fn reference(input: &FilterInput, edge: &EdgeSettings, own: &SvgfSettings, levels: u32) -> Vec<vec4> {
    let image = Packed::reference(input);
    let noise = noise_estimate::reference(input, &image, edge, false);
    filtered(input.size(), image.into_iter().zip(noise).collect(), edge, own, levels, true)
}

/// The levels on an image whose noise is known; `narrows` says whether weights do with the number of samples.
pub fn filtered(
    size: [u32; 2],
    mut image: Vec<Noisy>,
    edge: &EdgeSettings,
    own: &SvgfSettings,
    levels: u32,
    narrows: bool,
) -> Vec<vec4> {
    let (size, rates, rate_l) = (size.map(i64::from), Rates::of_surfaces(edge), own.rate_l());
    for level in 0..levels {
        let filter = Level { image: &image, size, spacing: 1 << level, rates, rate_l, narrows };
        image = (0..image.len()).map(|at| filter.filtered(at)).collect();
    }
    image.iter().map(|(pixel, _)| pixel.output()).collect()
}

impl Level<'_> {
    /// The pixel so many columns and rows away, if it is in the image.
    fn tap(&self, at: usize, i: i64, j: i64) -> Option<&Noisy> {
        let [width, height] = self.size;
        let (u, v) = (at as i64 % width + i, at as i64 / width + j);
        ((0..width).contains(&u) && (0..height).contains(&v)).then(|| &self.image[(v * width + u) as usize])
    }

    /// Per difference of luminance, in base 2, from the smoothed variance around a pixel.
    fn rate_at(&self, at: usize) -> f32 {
        let near = around(1).filter_map(|(i, j)| Some((self.tap(at, i, j)?, 1.0 / (4 << (i.abs() + j.abs())) as f32)));
        let (total, sum) = near
            .filter(|((_, variance), _)| *variance >= 0.0)
            .fold((0.0, 0.0), |(total, sum), ((_, variance), w)| (total + w, sum + w * variance));
        let narrowed = if self.narrows { (self.image[at].0.count / FEW).max(1.0).sqrt().sqrt() } else { 1.0 };
        (self.rate_l * narrowed).min(STEEPEST) / (f32::sqrt(sum / total) + LEAST_DEVIATION)
    }

    fn filtered(&self, at: usize) -> Noisy {
        let ((p, noise), rate) = (self.image[at], self.rate_at(at));
        let (mut sum, mut total, mut spread) = (Vec3::ZERO, 0.0, 0.0);
        for (i, j) in around(2) {
            let Some((q, variance)) = self.tap(at, i * self.spacing, j * self.spacing) else { continue };
            let steps = if noise >= 0.0 { rate * contrast(q.colour, p.colour).abs() } else { 0.0 };
            let exponent = self.rates.exponent(&p, q) - steps;
            let w = b3_spline(i) * b3_spline(j) * edge_weight(q, exponent);
            sum += w * (q.colour - p.colour);
            total += w;
            spread += w * w * variance;
        }
        (p.moved_by(sum, total), if total > 0.0 { spread / (total * total) } else { noise })
    }
}

/// Steps to the neighbours, column by column.
fn around(reach: i64) -> impl Iterator<Item = (i64, i64)> {
    (-reach..=reach).flat_map(move |i| (-reach..=reach).map(move |j| (i, j)))
}
