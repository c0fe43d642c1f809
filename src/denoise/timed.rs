//! One image filtered as [`Filtered`](super::Filtered) does it, to the same bits, but with kernels that have run before: what the
//! filter costs once its first use is over.
use super::demodulated::Demodulated;
use super::filter::{Filter, Method, Planes, Row, Scales, oidn};
use super::filtered::{Colour, Recipe, colour};
use super::noisy::Noisy;
use crate::error::Result;
use crate::gpu::{FrameResources, Gpu, PassTime};
use crate::machine::wake;
use std::time::{Duration, Instant};

/// A filtered image, and what it took.
pub struct Timed {
    /// The image.
    pub colour: Colour,
    /// Every pass of one command buffer that filters the image.
    pub times: Vec<PassTime>,
    /// Wall time of that command buffer.
    pub wall: Duration,
    /// Wall time of making kernels, planes and pipelines.
    pub compile: Duration,
    /// Wall time of the first run, in which drivers compile what they put off.
    pub first_run: Duration,
    /// Device memory in bytes that the filter and its planes take.
    pub device_bytes: u64,
}

/// The compiled kernels and planes for one image, which may change between runs.
pub(crate) struct Chain<'a> {
    noisy: Noisy,
    parts: Demodulated,
    filter: Box<dyn Filter>,
    /// For direct light that some pixels lack.
    of_direct: Option<Box<dyn Filter>>,
    gpu: &'a Gpu,
}

/// Filters `noisy` twice and times the second run.
///
/// # Errors
/// [`crate::error::Error::Usage`] for settings out of range, [`crate::error::Error::Device`] when the image is too large or the
/// device fails.
pub fn timed(gpu: &Gpu, noisy: Noisy, recipe: &Recipe) -> Result<Timed> {
    recipe.method.check_stride(noisy.holds().indirect_stride)?;
    let before = gpu.allocated_bytes();
    let begun = Instant::now();
    let row = match recipe.method {
        Method::Kernels(row) => row,
        Method::Oidn => return timed_on_host(gpu, noisy, recipe),
    };
    let chain = Chain::new(gpu, noisy, recipe, row)?;
    let compile = begun.elapsed();
    let device_bytes = gpu.allocated_bytes().saturating_sub(before);
    let (_, first_run) = chain.run()?;
    wake(gpu)?;
    let (times, wall) = chain.run()?;
    Ok(Timed { colour: chain.colour()?, times, wall, compile, first_run, device_bytes })
}

/// The same for Open Image Denoise: its own pass is timed by the host's clock, and loading the library is part of the first run.
fn timed_on_host(gpu: &Gpu, noisy: Noisy, recipe: &Recipe) -> Result<Timed> {
    let before = gpu.allocated_bytes();
    let begun = Instant::now();
    let parts = recipe.demodulated(gpu, &noisy)?;
    let compile = begun.elapsed();
    let device_bytes = gpu.allocated_bytes().saturating_sub(before);
    let once = || -> Result<(Vec<PassTime>, Duration)> {
        let begun = Instant::now();
        let mut times = gpu.run(&mut FrameResources::new(gpu)?, |rec| parts.record_split(rec, &noisy))?;
        let mut wall = begun.elapsed();
        let settings = (recipe.settings)(&Scales::of_planes(&parts.planes)?);
        let passes = oidn::filter(settings.oidn, &parts.planes)?;
        if let Some((name, took)) = passes.last() {
            times.push(PassTime { name, begin_ns: 0, end_ns: took.as_nanos() as u64 });
            wall += *took;
        }
        let begun = Instant::now();
        times.extend(gpu.run(&mut FrameResources::new(gpu)?, |rec| parts.record_join(rec))?);
        Ok((times, wall + begun.elapsed()))
    };
    let begun = Instant::now();
    once()?;
    let first_run = begun.elapsed();
    wake(gpu)?;
    let (times, wall) = once()?;
    Ok(Timed { colour: colour(&parts.picture)?, times, wall, compile, first_run, device_bytes })
}

impl<'a> Chain<'a> {
    /// Its settings are scaled to the image as it is now.
    ///
    /// # Errors
    /// Those of [`timed`].
    pub(crate) fn new(gpu: &'a Gpu, noisy: Noisy, recipe: &Recipe, row: &Row) -> Result<Self> {
        let parts = recipe.demodulated(gpu, &noisy)?;
        // The scales that settings count in are those of the light that is filtered.
        gpu.run(&mut FrameResources::new(gpu)?, |rec| parts.record_split(rec, &noisy))?;
        let scales = Scales::of_planes(&parts.planes)?;
        let compiled = |scales: &Scales, size| row.compile(gpu, &(recipe.settings)(scales), size);
        let of_direct = |planes: Planes| compiled(&scales.with_light(&planes.radiance)?, planes.size);
        let of_direct = parts.direct_planes().map(of_direct).transpose()?;
        Ok(Self { filter: compiled(&scales, parts.planes.size)?, of_direct, parts, noisy, gpu })
    }

    /// All passes in one command buffer, as an engine would record them.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub(crate) fn run(&self) -> Result<(Vec<PassTime>, Duration)> {
        let mut frame = FrameResources::new(self.gpu)?;
        let begun = Instant::now();
        let (filter, of_direct) = (&*self.filter, self.of_direct.as_deref());
        let times = self.gpu.run(&mut frame, |rec| self.parts.record(rec, &self.noisy, filter, of_direct))?;
        Ok((times, begun.elapsed()))
    }

    /// What the last run made of the image.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub(crate) fn colour(&self) -> Result<Colour> {
        colour(&self.parts.picture)
    }
}
