//! À-Trous wavelets steered by each pixel's variance: the spatial half of SVGF (Schied et al., HPG 2017). Kernel:
//! `glsl/filter/svgf.comp`.
use super::edge::{Rates, edge_weight};
use super::noise_estimate::{self, Estimate, contrast};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, FilterSettings, Planes, Row};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{SvgfPush, vec4};
use crate::settings::{FROM_0, settings};
use crate::shaders::svgf::{Bind, Constants};
use glam::Vec3;
use std::f32::consts::LOG2_E;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "svgf",
    about: "À-Trous wavelets whose radiance weight counts in each pixel's standard deviations",
    bytes: super::pack::BYTES + 32, // estimate and scratch
    make: |gpu, settings, size| Ok(Box::new(Svgf::new(gpu, settings, size)?)),
    reference,
};

/// Per standard deviation, in base 2; finite also over a deviation of [`LEAST_DEVIATION`].
fn rate_l(settings: &FilterSettings) -> f32 {
    (LOG2_E / settings.svgf.sigma_l).min(1e8)
}

/// Stands for 0, so that equal pixels are alike where nothing varies.
const LEAST_DEVIATION: f32 = 1e-30;

settings! {
    /// What `svgf` alone can be told.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SvgfSettings {
        /// What is given of them.
        SvgfOverrides {
            /// Standard deviations of a pixel's luminance that count as an edge for svgf.
            sigma_l: f32 = 4.0, FROM_0;
        }
    }
}

struct Svgf {
    pack: Pack,
    estimate: Estimate,
    /// All levels but the last, and the last.
    kernels: [Kernel<Bind<'static>>; 2],
    scratch: Buffer<vec4>,
    settings: FilterSettings,
}

impl Svgf {
    fn new(gpu: &Gpu, settings: &FilterSettings, size: [u32; 2]) -> Result<Self> {
        let kernel = |last| Kernel::new(gpu, &Constants { edge: Rates::of_surfaces(&settings.edge).constants(), last });
        let pack = Pack::new(gpu, size)?;
        let scratch = Buffer::new(gpu, "svgf", pack.colour.len(), Location::Device)?;
        let estimate = Estimate::new(gpu, settings, size)?;
        Ok(Self { pack, estimate, kernels: [kernel(false)?, kernel(true)?], scratch, settings: *settings })
    }
}

impl Filter for Svgf {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        self.estimate.record(rec, planes, &self.pack, &self.settings)?;
        let mut from = &self.estimate.plane;
        for level in 0..self.settings.footprint.levels {
            let last = level + 1 == self.settings.footprint.levels;
            let to = match last {
                true => &planes.output,
                false if level % 2 == 0 => &self.scratch,
                false => &self.estimate.plane,
            };
            let push = SvgfPush {
                size: planes.size,
                spacing: 1 << level,
                rate_l: rate_l(&self.settings),
                rates: Rates::of_surfaces(&self.settings.edge).as_array(),
                ..Default::default()
            };
            let bind = Bind { estimate: from, place: &self.pack.place, colour: &self.pack.colour, filtered: to };
            let kernel = &self.kernels[usize::from(last)];
            rec.dispatch(kernel, bind, &push, kernel.groups(planes.size))?;
            from = to;
        }
        Ok(())
    }
}

/// A pixel with the variance of its luminance, -1 where it is unknown.
type Noisy = (Packed, f32);

fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let packed = Packed::reference(input);
    let noise = noise_estimate::reference(input, &packed, settings);
    let mut image: Vec<Noisy> = packed.into_iter().zip(noise).collect();
    for level in 0..settings.footprint.levels {
        let size = [i64::from(input.width), i64::from(input.height)];
        image = (0..image.len()).map(|at| filtered(&image, size, at, 1 << level, settings)).collect();
    }
    image.iter().map(|(pixel, _)| pixel.output()).collect()
}

fn filtered(image: &[Noisy], [width, height]: [i64; 2], at: usize, spacing: i64, settings: &FilterSettings) -> Noisy {
    const B3: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
    let (p, noise) = image[at];
    let tap = |i: i64, j: i64| {
        let (u, v) = (at as i64 % width + i, at as i64 / width + j);
        ((0..width).contains(&u) && (0..height).contains(&v)).then(|| &image[(v * width + u) as usize])
    };
    let around = |reach: i64| (-reach..=reach).flat_map(move |i| (-reach..=reach).map(move |j| (i, j)));
    let near = around(1).filter_map(|(i, j)| Some((tap(i, j)?, 1.0 / (4 << (i.abs() + j.abs())) as f32)));
    let (total, sum) = near
        .filter(|((_, variance), _)| *variance >= 0.0)
        .fold((0.0, 0.0), |(total, sum), ((_, variance), w)| (total + w, sum + w * variance));
    let rate = rate_l(settings) / (f32::sqrt(sum / total) + LEAST_DEVIATION);
    let rates = Rates::of_surfaces(&settings.edge);
    let (mut sum, mut total, mut spread) = (Vec3::ZERO, 0.0, 0.0);
    for (i, j) in around(2) {
        let Some((q, variance)) = tap(i * spacing, j * spacing) else { continue };
        let steps = if noise >= 0.0 { rate * contrast(q.colour, p.colour).abs() } else { 0.0 };
        let exponent = rates.exponent(&p, q) - steps;
        let w = B3[i.unsigned_abs() as usize] * B3[j.unsigned_abs() as usize] * edge_weight(q, exponent);
        sum += w * (q.colour - p.colour);
        total += w;
        spread += w * w * variance;
    }
    (p.moved_by(sum, total), if total > 0.0 { spread / (total * total) } else { noise })
}
