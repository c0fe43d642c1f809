//! Everything that a profile is made of, measured in its order.
use super::ceilings::{self, Ceilings};
use super::frames::{Frames, Workload};
use super::work::FrameWork;
use crate::denoise::filter::{FilterSettings, Row};
use crate::denoise::{Denoiser, Noisy, Recipe};
use crate::error::Result;
use crate::gpu::{Calibration, FrameResources, Gpu};
use crate::machine::{device_mhz, wake};
use crate::render::settings::Settings;
use crate::render::{Counters, Job, Outputs, Renderer};
use crate::scene::Scene;

/// What was measured.
pub struct Measured {
    /// The frames.
    pub frames: Frames,
    /// What their passes have in common.
    pub frame_work: FrameWork,
    /// What the device can do at most.
    pub ceilings: Ceilings,
    /// [`Ceilings::arithmetic_gop_s`] again, after the frames.
    pub arithmetic_gop_s_after: f64,
    /// Clock of the device in MHz before and after the frames, where the system tells it.
    pub device_mhz: Option<[u64; 2]>,
    /// The device's timestamps and the host's clock after the frames.
    pub calibration: Option<Calibration>,
}

/// A filter for the frames of `renderer`, with its default settings and the scales of the renderer's own light, as `tallow render
/// --denoise` chooses them. It renders a frame for that.
///
/// # Errors
/// As [`Denoiser::new`] and [`Job::run`].
pub fn denoiser(gpu: &Gpu, renderer: &Renderer, row: &'static Row) -> Result<Denoiser> {
    let demodulation = Noisy::of_film(renderer)?.holds().usual_demodulation();
    let fireflies = Recipe::new(row.into()).fireflies();
    let make = |settings: &FilterSettings| Denoiser::new(gpu, renderer, row, settings, demodulation, fireflies);
    let (first, mut frame) = (make(&FilterSettings::default())?, FrameResources::new(gpu)?);
    Job::new(renderer).run_to_end(&mut frame)?;
    gpu.run(&mut frame, |rec| first.record(rec))?;
    let scales = first.scales()?;
    drop(first);
    make(&FilterSettings::default().scaled_by(&scales))
}

/// Measures `count` frames of a scene. Its rays are counted in a frame of their own, because counting takes time. `done` is told of
/// each of the other frames: twice `count`, and one.
///
/// # Errors
/// [`crate::error::Error::Device`] for a device without timestamps, and those of a render.
pub fn measure(
    gpu: &Gpu,
    scene: &Scene,
    settings: &Settings,
    filter: Option<&'static Row>,
    count: usize,
    done: &mut dyn FnMut(),
) -> Result<Measured> {
    gpu.check_clock()?;
    let outputs = Outputs::for_filter(filter.is_some());
    let counters = count_rays(gpu, scene, settings, Outputs { counters: true, ..outputs })?;
    wake(gpu)?;
    let ceilings = Ceilings::measure(gpu)?;
    let renderer = Renderer::new(gpu, scene, settings, outputs)?;
    let denoiser = filter.map(|row| denoiser(gpu, &renderer, row)).transpose()?;
    wake(gpu)?;
    let before = device_mhz(gpu.info());
    wake(gpu)?; // asking may take a while
    let frames = Workload { gpu, renderer: &renderer, denoiser: denoiser.as_ref() }.run(count, done)?;
    let device_mhz = before.zip(device_mhz(gpu.info())).map(|(before, after)| [before, after]);
    let split_light = renderer.effects().split_light;
    Ok(Measured {
        frames,
        frame_work: FrameWork { pixels: settings.pixels() as u64, split_light, counters },
        ceilings,
        arithmetic_gop_s_after: ceilings::arithmetic_gop_s(gpu)?,
        device_mhz,
        calibration: gpu.calibrate(),
    })
}

fn count_rays(gpu: &Gpu, scene: &Scene, settings: &Settings, outputs: Outputs) -> Result<Counters> {
    let renderer = Renderer::new(gpu, scene, settings, outputs)?;
    Job::new(&renderer).run_to_end(&mut FrameResources::new(gpu)?)?;
    renderer.counters()
}
