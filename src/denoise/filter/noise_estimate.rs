//! What is known of each pixel's noise. Kernel: `glsl/filter/noise_estimate.comp`. Twin: [`reference`].
use super::atrous_taps::threads;
use super::edge::{EdgeSettings, Rates, edge_weight};
use super::pack::{Pack, Packed};
use super::{FilterInput, Planes};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{Guide, NONE, SurfacesPush, vec3, vec4};
use crate::math::srgb::luminance;
use crate::shaders::noise_estimate::{self, Bind, Constants, OTHER, PRIOR, SAME};
pub use crate::shaders::shared::luminance::ENOUGH;
use crate::shaders::shared::luminance::STRONGEST;
use crate::shaders::shared::own_variance;
use crate::threads::each;
use glam::{FloatExt, Vec3};

/// Pixels from the centre to the border of the window over which the others' variance is taken.
const REACH: i64 = noise_estimate::REACH as i64;

/// The kernel, with and without a variance to read, and its plane.
pub struct Estimate {
    kernels: [Kernel<Bind<'static>>; 2],
    nothing: Buffer<vec3>,
    rates: Rates,
    /// Radiance, and the variance of its luminance; -1 where nothing is known.
    pub plane: Buffer<vec4>,
}

impl Estimate {
    /// For images of (width, height); `cautious` as in the kernel.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when it does not fit.
    pub fn new(gpu: &Gpu, edge: &EdgeSettings, cautious: bool, [width, height]: [u32; 2]) -> Result<Self> {
        let rates = Rates::of_surfaces(edge);
        let (edge, local_size_x) = (rates.constants(), gpu.tuning().filter_workgroup);
        let kernel = |measured| {
            let own_variance = own_variance::Constants { measured };
            Kernel::new(gpu, &Constants { edge, local_size_x, own_variance, cautious })
        };
        Ok(Self {
            kernels: each([false, true], kernel)?,
            nothing: Buffer::from_slice(gpu, "no variance", &[])?,
            plane: Buffer::new(gpu, "estimate", width as usize * height as usize, Location::Device)?,
            rates,
        })
    }

    /// colour\[P\], place\[P\], variance\[P\] -> plane\[P\]
    pub fn record(&self, rec: &mut Recorder, planes: &Planes, pack: &Pack) -> Result<()> {
        let rates = self.rates.as_array();
        let push = SurfacesPush { size: planes.size, rates, ..Default::default() };
        let variance = planes.variance.as_ref().unwrap_or(&self.nothing);
        let bind = Bind { packed_pixels: pack.bind(), variance, guide: &planes.guide, estimate: &self.plane };
        let kernel = &self.kernels[usize::from(planes.variance.is_some())];
        rec.dispatch(kernel, bind, &push, kernel.groups(threads(planes.size, 1)))
    }
}

/// Difference of luminance.
pub fn contrast(a: Vec3, b: Vec3) -> f32 {
    (luminance(a) - luminance(b)).clamp(-STRONGEST, STRONGEST)
}

/// The variance of every pixel's luminance; -1 where nothing is known. `cautious` as in the kernel.
pub fn reference(input: &FilterInput, image: &[Packed], edge: &EdgeSettings, cautious: bool) -> Vec<f32> {
    let rates = Rates::of_surfaces(edge);
    let own: Vec<Option<f32>> = (0..image.len()).map(|at| own_variance(input, at, image[at].count)).collect();
    let variance = |at: usize| match own[at] {
        _ if image[at].count == 0.0 => -1.0,
        Some(of_pixel) if cautious => {
            let (around, freedom) = (told_around(input, image, &own, at, &rates), image[at].count - 1.0);
            of_pixel.lerp(around, PRIOR / (PRIOR + freedom))
        }
        Some(own) => own,
        None => spread(input, image, at, &rates),
    };
    (0..image.len()).map(variance).collect()
}

/// What the `count` samples of a pixel say of the variance of its luminance.
pub fn own_variance(input: &FilterInput, at: usize, count: f32) -> Option<f32> {
    let v = Vec3::from(input.variance.as_ref()?[at]);
    let measured = count >= ENOUGH && v.is_finite() && v.min_element() >= 0.0;
    measured.then(|| luminance(v.map(f32::sqrt)).min(STRONGEST).powi(2))
}

/// The mean of that over like pixels, as the kernel's.
fn told_around(input: &FilterInput, image: &[Packed], own: &[Option<f32>], at: usize, rates: &Rates) -> f32 {
    let (blurs, of_pixel) = (blurred(&input.guide[at]), own[at].unwrap_or(0.0));
    let (mut total, mut sum) = (0.0, 0.0);
    for (q, variance) in window(input, at, REACH).filter_map(|q| Some((&image[q], own[q]?))) {
        let tells = if blurs { 1.0 } else { tells(of_pixel + variance, contrast(q.colour, image[at].colour)) };
        let w = tells * edge_weight(q, rates.exponent(&image[at], q));
        total += w;
        sum += if w > 0.0 { w * variance } else { 0.0 };
    }
    if total > 0.0 { sum / total } else { 0.0 }
}

/// How much a neighbour that is `apart`, with such a variance of the difference, tells of a pixel's variance.
fn tells(variance: f32, apart: f32) -> f32 {
    let square = apart * apart;
    match variance >= SAME * square {
        true if variance > 0.0 => 1.0,
        true => 0.0,
        false => ((variance / square - OTHER) / (SAME - OTHER)).max(0.0),
    }
}

/// Whether a lens blurs what the pixel shows, or nothing was hit, as in `glsl/shared/blurred.glsl`.
pub fn blurred(guide: &Guide) -> bool {
    guide.material == NONE
}

/// The pixels as near to one along both axes, and itself.
pub fn window(input: &FilterInput, at: usize, reach: i64) -> impl Iterator<Item = usize> + use<> {
    let (width, height) = (i64::from(input.width), i64::from(input.height));
    let (x, y) = (at as i64 % width, at as i64 / width);
    let rows = (y - reach).max(0)..=(y + reach).min(height - 1);
    let columns = (x - reach).max(0)..=(x + reach).min(width - 1);
    rows.flat_map(move |v| columns.clone().map(move |u| (v * width + u) as usize))
}

fn spread(input: &FilterInput, image: &[Packed], at: usize, rates: &Rates) -> f32 {
    let (mut total, mut squares, mut mean, mut m2) = (0.0, 0.0, 0.0, 0.0);
    for q in window(input, at, REACH).map(|q| &image[q]) {
        let w = edge_weight(q, rates.exponent(&image[at], q));
        let off = contrast(q.colour, image[at].colour);
        total += w;
        squares += w * w;
        mean += w * off;
        m2 += w * off * off;
    }
    mean /= total;
    let others = 1.0 - squares / (total * total);
    if others > 1e-3 { (m2 / total - mean * mean) / others } else { 0.0 }
}
