//! The renderer that an engine embeds and that the command line drives: a scene on a device, kernels specialised for
//! it, and frames recorded batch by batch into command buffers.
use crate::error::Result;
use crate::frame::{self, Stages};
pub use crate::frame::{Batch, DeviceScene, FilmBuffers, FilmTile};
use crate::gpu::layout::{Camera, Effects, LIGHT_ENVIRONMENT, NONE, PathPush, PixelStats, ROOT_OF_INSTANCES};
use crate::gpu::{FrameResources, Gpu, PassTime, RawBuffer, Recorder};
use crate::scene::{self, Scene};
use crate::settings::{PixelFilter, Sampler, Settings};
use crate::stage::{PerThread, WORKGROUP_CPU, WORKGROUP_GPU};

/// What a render leaves in buffers besides radiance and its variance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// Direct and indirect light apart.
    pub split_light: bool,
    /// Primary hits: normal, position, depth, albedo, object.
    pub guides: bool,
    /// Rays and nodes counted.
    pub counters: bool,
}

/// A result buffer for the caller: pixel `i` of the view (row-major, row 0 at the top) starts at `offset + i * stride`.
#[derive(Clone, Copy, Debug)]
pub struct OutputView {
    /// The Vulkan handle, valid as long as the renderer.
    pub buffer: RawBuffer,
    /// Bytes to the first pixel's first value.
    pub offset: u64,
    /// Bytes from pixel to pixel.
    pub stride: u32,
    /// 32-bit floats of one pixel.
    pub channels: u32,
    /// Pixels in this view.
    pub pixels: u32,
}

/// A scene on a device and the kernels to render it. Everything is created in [`Renderer::new`], nothing later.
pub struct Renderer {
    gpu: Gpu,
    scene: DeviceScene,
    stages: Stages,
    film: FilmBuffers,
    effects: Effects,
    outputs: Outputs,
    settings: Settings,
    push: PathPush,
    paths: u32,
}

/// Ray counts since the renderer was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Rays that look for the closest hit.
    pub closest: u64,
    /// Rays that look for any hit.
    pub any: u64,
    /// BVH nodes that the rays visited.
    pub nodes: u64,
}

impl Counters {
    /// All rays.
    pub fn rays(&self) -> u64 {
        self.closest + self.any
    }
}

impl Renderer {
    /// Uploads the scene and compiles its kernels for what it calls for.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] for settings out of range, [`crate::error::Error::Device`] when the device
    /// refuses something.
    pub fn new(gpu: &Gpu, scene: &Scene, outputs: Outputs) -> Result<Self> {
        Self::specialised(gpu, scene, outputs, called_for(scene, outputs))
    }

    /// [`Renderer::new`] with other effects compiled in: more of them change nothing but the speed, fewer leave things
    /// out of the picture. The effects that the outputs stand for are taken from `outputs`.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn specialised(gpu: &Gpu, scene: &Scene, outputs: Outputs, effects: Effects) -> Result<Self> {
        let settings = scene.settings.clone();
        settings.validate()?;
        let effects = Effects { split_light: outputs.split_light, counters: outputs.counters, ..effects };
        let workgroup = if gpu.info().kind == "CPU" { WORKGROUP_CPU } else { WORKGROUP_GPU };
        let stages = Stages {
            guide: PerThread::new(gpu, &effects, workgroup)?,
            path: PerThread::new(gpu, &effects, workgroup)?,
            fold: PerThread::new(gpu, &effects, workgroup)?,
        };
        let paths = paths_in_flight(gpu, &settings, &effects);
        let film = FilmBuffers::new(gpu, settings.pixels() as u32, paths, &effects, outputs.guides)?;
        let push = path_push(scene);
        let scene = DeviceScene::new(gpu, scene, &effects)?;
        Ok(Self { gpu: gpu.clone(), scene, stages, film, effects, outputs, settings, push, paths })
    }

    /// The work of a whole render, in an order that refines the picture evenly: every pixel gets its first samples
    /// before any gets the next. The result does not depend on how the work is cut.
    pub fn batches(&self) -> Vec<Batch> {
        self.batches_of(0, self.settings.spp)
    }

    /// The work of samples `first .. first + samples` of every pixel.
    pub fn batches_of(&self, first: u32, samples: u32) -> Vec<Batch> {
        let tile = FilmTile::capacity(self.gpu.info().max_storage_range);
        cut(self.settings.pixels() as u32, tile, first, samples, self.paths)
    }

    /// Records the primary hits; nothing when the outputs do not call for guides.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record_guide(&self, rec: &mut Recorder) -> Result<()> {
        match self.outputs.guides {
            true => frame::record_guide(rec, &self.stages, &self.scene, &self.film, &self.push),
            false => Ok(()),
        }
    }

    /// Records one batch. Batches of a pixel must be recorded in order of their samples.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record_batch(&self, rec: &mut Recorder, batch: &Batch) -> Result<()> {
        frame::record_batch(rec, &self.stages, &self.scene, &self.film, &self.push, batch)
    }

    /// Runs one batch on the renderer's own queue and waits; with the guides first when it is the first one.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn run(&self, frame: &mut FrameResources, batch: &Batch) -> Result<Vec<PassTime>> {
        self.gpu.run(frame, |rec| {
            if batch.first_sample == 0 && batch.first_pixel == 0 {
                self.record_guide(rec)?;
            }
            self.record_batch(rec, batch)
        })
    }

    /// Moves the camera; what was accumulated belongs to the old one, so start again from sample 0.
    pub fn set_camera(&mut self, camera: Camera) {
        self.push.camera = camera;
    }

    /// Linear radiance (Rec. 709), 3 floats a pixel: one view for each of [`FilmBuffers::tiles`], in order.
    pub fn radiance(&self) -> Vec<OutputView> {
        let view = |tile: &FilmTile| OutputView {
            buffer: tile.stats.raw(),
            offset: 0,
            stride: size_of::<PixelStats>() as u32,
            channels: 3,
            pixels: tile.pixels,
        };
        self.film.tiles.iter().map(view).collect()
    }

    /// The buffers, for reading back and for stages of the caller's own.
    pub fn film(&self) -> &FilmBuffers {
        &self.film
    }

    /// The scene's buffers.
    pub fn scene(&self) -> &DeviceScene {
        &self.scene
    }

    /// What was asked for.
    pub fn outputs(&self) -> Outputs {
        self.outputs
    }

    /// What was compiled in.
    pub fn effects(&self) -> &Effects {
        &self.effects
    }

    /// What this renderer was made for.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Milliseconds that the pipelines took to create, by kernel.
    pub fn compile_times(&self) -> [(&'static str, f64); 3] {
        [
            ("guide", self.stages.guide.compile_ms()),
            ("path", self.stages.path.compile_ms()),
            ("fold", self.stages.fold.compile_ms()),
        ]
    }

    /// Reads the counters; zero unless they were asked for.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn counters(&self) -> Result<Counters> {
        let words = self.film.counters.read()?;
        let pair = |i: usize| u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32;
        Ok(Counters { closest: pair(0), any: pair(1), nodes: pair(2) })
    }
}

/// The effects that a scene, its settings and the outputs call for.
pub fn called_for(scene: &Scene, outputs: Outputs) -> Effects {
    scene::effects(scene, outputs.split_light, outputs.counters).0
}

/// Every effect of light and matter; the random numbers stay those that the settings chose.
pub fn all_effects(scene: &Scene) -> Effects {
    Effects { independent_sampler: scene.settings.sampler == Sampler::Independent, ..Effects::ALL }
}

/// Paths per dispatch: enough to fill the device, few enough that a batch ends within a fraction of a second, and
/// that the samples fit a storage buffer.
fn paths_in_flight(gpu: &Gpu, settings: &Settings, effects: &Effects) -> u32 {
    let wanted: u64 = if gpu.info().kind == "CPU" { 1 << 20 } else { 1 << 22 };
    let bytes = if effects.split_light { 48 } else { 16 };
    let room = gpu.info().max_storage_range / bytes;
    let all = settings.pixels() as u64 * u64::from(settings.spp);
    wanted.min(room).min(all).max(1) as u32
}

/// Cuts samples `first .. first + samples` of `pixels` pixels into batches of at most `paths` paths, none across a
/// multiple of `tile` pixels.
fn cut(pixels: u32, tile: u32, first: u32, samples: u32, paths: u32) -> Vec<Batch> {
    let run = pixels.min(paths).min(tile);
    let depth = (paths / run).max(1);
    let mut batches = Vec::new();
    let mut sample = 0;
    while sample < samples {
        let n = depth.min(samples - sample);
        let mut first_pixel = 0;
        while first_pixel < pixels {
            let pixels = run.min(pixels - first_pixel).min(tile - first_pixel % tile);
            batches.push(Batch { first_pixel, pixels, first_sample: first + sample, samples: n });
            first_pixel += pixels;
        }
        sample += n;
    }
    batches
}

/// What the kernels are told of a scene; the batch is still to be filled in.
pub fn path_push(scene: &Scene) -> PathPush {
    let settings = &scene.settings;
    let environment = scene.lights.iter().position(|l| l.kind == LIGHT_ENVIRONMENT);
    PathPush {
        camera: scene.camera,
        size: [settings.width, settings.height],
        seed: settings.seed,
        max_depth: settings.max_depth,
        roulette_depth: settings.roulette_depth,
        clamp_indirect: settings.clamp_indirect,
        pixel_filter: match settings.filter {
            PixelFilter::Box => 0,
            PixelFilter::Tent => 1,
            PixelFilter::Gaussian => 2,
        },
        light_count: scene.lights.len() as u32,
        triangle_pdf_scale: scene.triangle_pdf_scale,
        environment: environment.map_or(NONE, |i| i as u32),
        environment_size: scene.environment.as_ref().map_or(0, |e| e.width | e.height << 16),
        root: scene.root | if scene.instances.is_empty() { 0 } else { ROOT_OF_INSTANCES },
        ..PathPush::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every sample of every pixel appears exactly once, and in order within its pixel.
    fn covers(pixels: u32, tile: u32, samples: u32, paths: u32) -> bool {
        let mut next = vec![0; pixels as usize];
        for b in cut(pixels, tile, 0, samples, paths) {
            let crosses = b.first_pixel / tile != (b.first_pixel + b.pixels - 1) / tile;
            if crosses || b.pixels * b.samples > paths.max(1) {
                return false;
            }
            for p in b.first_pixel..b.first_pixel + b.pixels {
                if next[p as usize] != b.first_sample {
                    return false;
                }
                next[p as usize] += b.samples;
            }
        }
        next.iter().all(|&n| n == samples)
    }

    #[test]
    fn batches_cover_all_work_once() {
        for pixels in [1, 31, 64, 65] {
            for samples in [1, 2, 7] {
                for paths in [1, 3, 64, 100, 1000] {
                    for tile in [1, 30, 64, 1000] {
                        assert!(covers(pixels, tile, samples, paths), "{pixels} {tile} {samples} {paths}");
                    }
                }
            }
        }
    }
}
