//! A noisy image taken apart on the device, to be filtered and put together again. Kernels: those of `glsl/film` whose names
//! tell of modulation. Twin: [`super::twin`].
use super::filter::firefly::{Cut, Fireflies, Removed};
use super::filter::{Filter, Planes};
use super::gloss::Gloss;
use super::sparse::Sparse;
use super::{Demodulation, ExpectedError, Holds, Noisy};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{PackPush, SizePush, vec3, vec4};
use crate::shaders::{demodulate, demodulate_direct, remodulate, remodulate_direct};

/// The kernels and planes of one image.
pub struct Demodulated {
    split: Kernel<demodulate::Bind<'static>>,
    join: Kernel<remodulate::Bind<'static>>,
    /// What goes through the filter, and what comes out; of a sparse image, the traced pixels.
    pub planes: Planes,
    /// All pixels, where some are not traced.
    sparse: Option<Sparse>,
    /// One element where none is known, and then no part of the planes.
    variance: Buffer<vec3>,
    factor: Buffer<vec4>,
    /// What is not filtered; [`Demodulated::record_join`] makes it the whole image.
    pub picture: Buffer<vec4>,
    direct: Option<Direct>,
    cut: Option<Cut>,
    gloss: Gloss,
}

/// Direct light before albedo, where some pixels have none of their own: a filter in-paints it.
struct Direct {
    split: Kernel<demodulate_direct::Bind<'static>>,
    join: Kernel<remodulate_direct::Bind<'static>>,
    plane: Buffer<vec4>,
}

impl Demodulated {
    /// For `noisy` and images that hold the same. With `in_paint`, pixels without direct light take it from the others. For filters that weigh
    /// noise (`weighs_noise`), light that does not follow albedo is not divided by it: what a gloss mirrors and, unless pixels are
    /// in-painted, the share of a pixel that a lens blurs. Of what is filtered, `fireflies` are cut.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the planes do not fit.
    pub fn new(
        gpu: &Gpu,
        noisy: &Noisy,
        demodulation: Demodulation,
        weighs_noise: bool,
        in_paint: bool,
        fireflies: Fireflies,
    ) -> Result<Self> {
        let (holds, pixels) = (noisy.holds, noisy.stats.len());
        let measured = holds.variance_of_filtered(demodulation);
        let gloss = Gloss::new(gpu, noisy, demodulation, weighs_noise)?;
        let constants = demodulate::Constants {
            demodulation: demodulation as u32,
            indirect_variance: holds.indirect_variance,
            measured,
            lens: weighs_noise && holds.blur && !in_paint,
            gloss: gloss.is_wanted(),
            noisy: holds.constants(),
            ..Default::default()
        };
        let plane = |name| Buffer::new(gpu, name, pixels, Location::Device);
        let variance = Buffer::new(gpu, "variance", if measured { pixels } else { 1 }, Location::Device)?;
        let whole = Planes {
            size: noisy.size,
            radiance: plane("radiance")?,
            guide: noisy.guide.clone(),
            light: noisy.holds.light.then(|| noisy.light.clone()),
            variance: measured.then(|| variance.clone()),
            output: plane("filtered")?,
        };
        let (sparse, planes) = match holds.indirect_stride {
            1 => (None, whole),
            stride => Sparse::new(gpu, whole, stride).map(|(sparse, traced)| (Some(sparse), traced))?,
        };
        let cut = |factor| {
            let whole = Buffer::new(gpu, "whole", planes.radiance.len(), Location::Device)?;
            Cut::new(gpu, whole, &planes, factor)
        };
        let light = constants.demodulation == Demodulation::Light as u32;
        Ok(Self {
            split: Kernel::new(gpu, &constants)?,
            join: Kernel::new(gpu, &remodulate::Constants { light, ..Default::default() })?,
            cut: fireflies.factor().map(cut).transpose()?,
            planes,
            sparse,
            variance,
            factor: plane("factor")?,
            picture: plane("picture")?,
            gloss,
            direct: in_paint.then(|| Direct::new(gpu, holds, pixels)).transpose()?,
        })
    }

    /// All passes in one command buffer: stats\[P\], light\[P\], guide\[P\] -> picture\[P\]. `of_direct` in-paints direct light, where some
    /// pixels lack it.
    pub fn record(
        &self,
        rec: &mut Recorder,
        noisy: &Noisy,
        filter: &dyn Filter,
        of_direct: Option<&dyn Filter>,
    ) -> Result<()> {
        self.record_split(rec, noisy)?;
        filter.record(rec, &self.planes)?;
        self.record_fill(rec)?;
        if let Some((direct, filter)) = self.direct_planes().zip(of_direct) {
            filter.record(rec, &direct)?;
            self.record_direct_join(rec)?;
        }
        self.record_join(rec)
    }

    /// stats\[P\], light\[P\], guide\[P\] -> radiance\[P\], variance\[P\], factor\[P\], picture\[P\], direct\[P\]
    pub fn record_split(&self, rec: &mut Recorder, noisy: &Noisy) -> Result<()> {
        let (planes, size, count) = (&self.planes, self.whole().size, self.whole().pixels());
        let uncut = self.cut.as_ref().map_or(&planes.radiance, |cut| &cut.whole);
        let bind = demodulate::Bind {
            noisy: noisy.bind(),
            radiance: self.sparse.as_ref().map_or(uncut, |sparse| &sparse.whole.radiance),
            variance: &self.variance,
            factor: &self.factor,
            sharp: &self.picture,
            blur: &noisy.blur,
            gloss: &self.gloss.cells,
        };
        self.gloss.record(rec, noisy)?;
        rec.dispatch_threads(&self.split, bind, &SizePush { size, ..Default::default() }, count)?;
        if let Some(sparse) = &self.sparse {
            sparse.record_decimate(rec, planes, uncut)?;
        }
        if let Some(cut) = &self.cut {
            cut.record(rec, planes)?;
        }
        let Some(direct) = &self.direct else { return Ok(()) };
        let bind = demodulate_direct::Bind { noisy: noisy.bind(), direct: &direct.plane };
        rec.dispatch_threads(&direct.split, bind, &SizePush { size, ..Default::default() }, count)
    }

    /// All pixels: what is filtered of them, once [`Demodulated::record_fill`] has run.
    pub fn whole(&self) -> &Planes {
        self.sparse.as_ref().map_or(&self.planes, |sparse| &sparse.whole)
    }

    /// filtered\[T\] of the traced pixels -> filtered\[P\], where not all are
    pub fn record_fill(&self, rec: &mut Recorder) -> Result<()> {
        let Some(sparse) = &self.sparse else { return Ok(()) };
        sparse.record_upsample(rec, &self.planes)
    }

    /// Direct light for a filter, where it is to be in-painted: what comes out takes the place of the radiance, which must have
    /// been filtered by then.
    pub fn direct_planes(&self) -> Option<Planes> {
        let Planes { size, radiance, guide, light, .. } = self.whole();
        let (guide, light, output) = (guide.clone(), light.clone(), radiance.clone());
        let planes = |radiance| Planes { size: *size, radiance, guide, light, variance: None, output };
        self.direct.as_ref().map(|d| planes(d.plane.clone()))
    }

    /// direct\[P\], and what a filter made of it -> picture\[P\] of the pixels that lack it
    pub fn record_direct_join(&self, rec: &mut Recorder) -> Result<()> {
        let Some(direct) = &self.direct else { return Ok(()) };
        let (planes, count) = (self.whole(), self.whole().pixels());
        let bind = remodulate_direct::Bind {
            guide: &planes.guide,
            direct: &direct.plane,
            filtered: &planes.radiance,
            sharp: &self.picture,
        };
        rec.dispatch_threads(&direct.join, bind, &PackPush { count, ..Default::default() }, count)
    }

    /// filtered\[P\], factor\[P\] -> picture\[P\]: once for each split, since the picture takes the place of the light that was
    /// not filtered.
    pub fn record_join(&self, rec: &mut Recorder) -> Result<()> {
        let (whole, count) = (self.whole(), self.whole().pixels());
        let bind = remodulate::Bind { filtered: &whole.output, factor: &self.factor, picture: &self.picture };
        rec.dispatch_threads(&self.join, bind, &PackPush { count, ..Default::default() }, count)
    }

    /// What the last split has cut, if anything was to be.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn removed(&self) -> Result<Option<Removed>> {
        self.cut.as_ref().map(|cut| cut.removed(&self.planes)).transpose()
    }

    /// How far the joined picture is expected to be from the truth: see [`ExpectedError::of`].
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn expected_error(&self, gpu: &Gpu, expected: &Buffer<vec3>) -> Result<Option<ExpectedError>> {
        if self.sparse.is_some() {
            return Ok(None); // of pixels that are filled in nobody knows
        }
        ExpectedError::of(gpu, &self.planes, &self.factor, &self.picture, expected)
    }
}

impl Direct {
    fn new(gpu: &Gpu, holds: Holds, pixels: usize) -> Result<Self> {
        let noisy = holds.constants();
        Ok(Self {
            split: Kernel::new(gpu, &demodulate_direct::Constants { noisy, ..Default::default() })?,
            join: Kernel::new(gpu, &Default::default())?,
            plane: Buffer::new(gpu, "direct light", pixels, Location::Device)?,
        })
    }
}
