//! How far an image is expected to be from the truth, as a filter estimates it that knows its own errors. Kernel:
//! `glsl/film/expected_error.comp`.
use super::filter::Planes;
use super::twin::Parts;
use crate::error::Result;
use crate::gpu::{Buffer, FrameResources, Gpu, Kernel, Location};
use crate::layout::{SizePush, vec3, vec4};
use crate::shaders::expected_error::{Bind, EACH, EPSILON, THREADS};
use glam::Vec3;
use serde::Serialize;

/// Expected [`relmse`](crate::image::metrics::Metrics::relmse) of an image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ExpectedError {
    /// Of the noisy image.
    pub before: f64,
    /// Of the filtered one.
    pub after: f64,
}

impl ExpectedError {
    /// One line for the user. It goes by the variance of samples, which takes them for independent: points of a sequence, which are
    /// spread better, leave smaller errors.
    pub fn note(&self) -> String {
        let Self { before, after } = self;
        format!("estimated relMSE, were samples independent: {before:.2e} before filtering, roughly {after:.2e} after")
    }

    /// Of an image on the device: what was filtered with its `variance` and what came out, the `factor` behind it, the whole
    /// `picture`, and what the filter [expects](super::filter::Filter::expected). `None` where its samples tell no variance.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub(super) fn of(
        gpu: &Gpu,
        planes: &Planes,
        factor: &Buffer<vec4>,
        picture: &Buffer<vec4>,
        expected: &Buffer<vec3>,
    ) -> Result<Option<Self>> {
        let Some(variance) = &planes.variance else { return Ok(None) };
        let groups = planes.pixels().div_ceil(THREADS * EACH);
        let sums = Buffer::new(gpu, "expected errors", groups as usize, Location::Device)?;
        let kernel = Kernel::new(gpu, &Default::default())?;
        let (radiance, filtered) = (&planes.radiance, &planes.output);
        let bind = Bind { radiance, filtered, factor, variance, picture, expected, sums: &sums };
        let push = SizePush { size: planes.size, ..Default::default() };
        gpu.run(&mut FrameResources::new(gpu)?, |rec| rec.dispatch(&kernel, bind, &push, [groups, 1, 1]))?;
        Ok(Self::of_sums(&sums.read()?))
    }

    /// An unbiased estimate of a small error under much noise may be less than nothing: then the filter's own holds.
    fn of_sums(sums: &[vec4]) -> Option<Self> {
        let [before, after, excess, pixels] =
            [0, 1, 2, 3].map(|k| sums.iter().map(|sum| f64::from(sum[k])).sum::<f64>());
        (before > 0.0).then(|| Self { before: before / pixels, after: (after + excess.max(0.0)) / pixels })
    }
}

/// The twin: of an image taken apart, what a filter made of it and expects of that.
pub fn reference(parts: &Parts, filtered: &[vec4], expected: &[vec3]) -> Option<ExpectedError> {
    let (input, picture) = (&parts.input, parts.remodulate(filtered));
    let variance = input.variance.as_ref()?;
    let pixel = |i: usize| -> vec4 {
        let (whole, factor) = (Vec3::from(picture[i]), Vec3::from(parts.factor[i]));
        let light = factor * Vec3::from_slice(&filtered[i][..3]);
        let [error, noise, kept] = if input.radiance[i][3] > 0.0 { expected[i] } else { [0.0, 1.0, 0.0] };
        let sharp = noise_of_sharp(parts, i, noise * parts.sharp_variance[i]);
        let over = (whole * whole + EPSILON).recip() / 3.0;
        let off = light - factor * Vec3::from_slice(&input.radiance[i][..3]);
        let (mut before, mut after, mut unbiased) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        if input.radiance[i][3] > 0.0 {
            (before, after) = (noise * factor * factor * Vec3::from(variance[i]), error * light * light);
            unbiased = off * off - (1.0 - 2.0 * kept) * before;
        }
        let all = [(before + sharp).dot(over), (after + sharp).dot(over), (unbiased - after).dot(over), 1.0];
        if all.iter().all(|v| v.is_finite()) { all } else { [0.0; 4] }
    };
    ExpectedError::of_sums(&(0..filtered.len()).map(pixel).collect::<Vec<_>>())
}

fn noise_of_sharp(parts: &Parts, i: usize, of_samples: f32) -> f32 {
    let [width, height] = parts.input.size().map(i64::from);
    let factor = Vec3::from(parts.factor[i]);
    let sharp = |i: usize| {
        let (sharp, factor) = (Vec3::from(parts.sharp[i]), Vec3::from(parts.factor[i]));
        Vec3::select(factor.cmpgt(Vec3::ZERO), sharp / factor, sharp)
    };
    let (mut sum, mut squares) = (Vec3::ZERO, Vec3::ZERO);
    for k in 0..9 {
        let (x, y) = (i as i64 % width + k % 3 - 1, i as i64 / width + k / 3 - 1);
        let off = sharp((y.clamp(0, height - 1) * width + x.clamp(0, width - 1)) as usize) - sharp(i);
        sum += off;
        squares += off * off;
    }
    let scale = Vec3::select(factor.cmpgt(Vec3::ZERO), factor * factor, Vec3::ONE);
    let around = (squares - sum * sum / 9.0) / 8.0 * scale;
    of_samples.min((around.element_sum() / 3.0).max(0.0))
}
