//! Images whose light is traced for pixels a stride apart (as Dammertz et al. 2010 render them): those pixels are filtered as an image
//! of their own, and fill in the others. Kernels: `glsl/film/decimate.comp`, `glsl/film/upsample.comp`.
//!
//! Departure from the paper, whose filter in-paints what it was not given while it filters. Filters that fill in pixels themselves
//! must be wide, and those that judge pixels by their neighbours find none.
use super::filter::{FilterInput, Planes};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{Guide, NONE, PixelLight, SparsePush, vec3, vec4};
use crate::shaders::shared::sampled_albedo;
use crate::shaders::upsample::{FARTHEST_APART, RATE};
use crate::shaders::{decimate, upsample};
use glam::Vec3;

/// Planes of the whole image, and the kernels between them and those of the traced pixels.
pub struct Sparse {
    decimate: Kernel<decimate::Bind<'static>>,
    upsample: Kernel<upsample::Bind<'static>>,
    /// The image.
    pub whole: Planes,
    variance: Buffer<vec3>,
    /// One element where the image has none.
    light: Buffer<PixelLight>,
    stride: u32,
}

/// Columns and rows that are traced.
pub fn traced_size(size: [u32; 2], stride: u32) -> [u32; 2] {
    size.map(|edge| edge.div_ceil(stride))
}

impl Sparse {
    /// Of a `whole` image; also planes for its traced pixels.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when they do not fit.
    pub fn new(gpu: &Gpu, whole: Planes, stride: u32) -> Result<(Self, Planes)> {
        let size = traced_size(whole.size, stride);
        let pixels = size[0] as usize * size[1] as usize;
        let plane = |name| Buffer::new(gpu, name, pixels, Location::Device);
        let measured = whole.variance.is_some();
        let variance = Buffer::new(gpu, "variance of traced", if measured { pixels } else { 1 }, Location::Device)?;
        let traced = Planes {
            size,
            radiance: plane("traced radiance")?,
            guide: Buffer::new(gpu, "guides of traced", pixels, Location::Device)?,
            light: None, // its guides have the albedo of the samples
            variance: measured.then(|| variance.clone()),
            output: plane("filtered, traced")?,
        };
        let no_light = || Buffer::new(gpu, "no light", 1, Location::Device);
        let light = whole.light.clone().map_or_else(no_light, Ok)?;
        let sampled_albedo = sampled_albedo::Constants { has_light: whole.light.is_some() };
        let constants = decimate::Constants { measured, sampled_albedo, ..Default::default() };
        let (decimate, upsample) = (Kernel::new(gpu, &constants)?, Kernel::new(gpu, &Default::default())?);
        Ok((Self { decimate, upsample, whole, variance, light, stride }, traced))
    }

    /// radiance\[P\], guide\[P\], light\[P\], variance\[P\] -> `radiance`\[T\], guide\[T\], variance\[T\] of the T traced pixels
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record_decimate(&self, rec: &mut Recorder, traced: &Planes, radiance: &Buffer<vec4>) -> Result<()> {
        let bind = decimate::Bind {
            radiance: &self.whole.radiance,
            guide: &self.whole.guide,
            sampled_albedo: sampled_albedo::Bind { light: &self.light },
            variance: self.whole.variance.as_ref().unwrap_or(&self.variance),
            traced_radiance: radiance,
            traced_guide: &traced.guide,
            traced_variance: &self.variance,
        };
        rec.dispatch_threads(&self.decimate, bind, &self.push(), traced.pixels())
    }

    /// output\[T\], guide\[P\] -> output\[P\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record_upsample(&self, rec: &mut Recorder, traced: &Planes) -> Result<()> {
        let bind = upsample::Bind { traced: &traced.output, guide: &self.whole.guide, filtered: &self.whole.output };
        rec.dispatch_threads(&self.upsample, bind, &self.push(), self.whole.pixels())
    }

    fn push(&self) -> SparsePush {
        SparsePush { size: self.whole.size, stride: self.stride, ..Default::default() }
    }
}

/// Twin of `decimate.comp`.
pub fn decimated(whole: &FilterInput, stride: u32) -> FilterInput {
    let [width, height] = traced_size(whole.size(), stride);
    let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
    let at = |[x, y]: [u32; 2]| (y * stride * whole.width + x * stride) as usize;
    FilterInput {
        width,
        height,
        radiance: pixels().map(|p| whole.radiance[at(p)]).collect(),
        guide: pixels().map(|p| whole.guide[at(p)]).collect(),
        variance: whole.variance.as_ref().map(|v| pixels().map(|p| v[at(p)]).collect()),
    }
}

/// Twin of `upsample.comp`.
pub fn upsampled(traced: &[vec4], guide: &[Guide], size: [u32; 2], stride: u32) -> Vec<vec4> {
    let [columns, rows] = traced_size(size, stride);
    let pixel = |i: usize| {
        let (x, y) = (i as u32 % size[0], i as u32 / size[0]);
        let share = [x, y].map(|v| (v % stride) as f32 / stride as f32);
        let taps = [0u32, 1, 2, 3].map(|k| {
            let [right, down] = [k & 1, k >> 1];
            let (u, v) = ((x / stride + right).min(columns - 1), (y / stride + down).min(rows - 1));
            let by = [(right, share[0]), (down, share[1])].map(|(far, s)| if far == 1 { s } else { 1.0 - s });
            let filtered = traced[(v * columns + u) as usize];
            let there = &guide[(v * stride * size[0] + u * stride) as usize];
            (filtered, if filtered[3] > 0.0 { by[0] * by[1] } else { 0.0 }, apart(&guide[i], there))
        });
        let known = || taps.iter().filter(|tap| tap.1 > 0.0);
        let nearest = known().map(|tap| tap.2).fold(FARTHEST_APART, f32::min);
        let weight = |tap: &&(vec4, f32, f32)| tap.1 * (nearest - tap.2).exp2();
        let total: f32 = known().map(|tap| weight(&tap)).sum();
        let base = Vec3::from_slice(&taps[0].0[..3]);
        let sum: Vec3 = known().map(|tap| weight(&tap) * (Vec3::from_slice(&tap.0[..3]) - base)).sum();
        if total > 0.0 { (base + sum / total).extend(1.0).into() } else { [0.0; 4] }
    };
    (0..guide.len()).map(pixel).collect()
}

/// How unlike two surfaces are, as an exponent in base 2.
fn apart(a: &Guide, b: &Guide) -> f32 {
    let [normal, other] = [a, b].map(|guide| Vec3::from(guide.normal));
    let way = Vec3::from(b.position) - Vec3::from(a.position);
    let (distance, off) = (way.length_squared(), way.dot(normal));
    let sine = if distance > 0.0 { off * off / distance } else { 0.0 };
    let exponent = RATE * (normal.distance_squared(other) + sine);
    let one_is_hit = (a.object == NONE) != (b.object == NONE);
    if exponent.is_finite() && !one_is_hit { exponent.min(FARTHEST_APART) } else { FARTHEST_APART }
}
