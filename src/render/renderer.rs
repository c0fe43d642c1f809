//! The renderer that an engine embeds and that the command line drives: a scene on a device, kernels specialised for
//! it, and frames recorded batch by batch into command buffers.
use crate::allocate::{HostInputs, Row};
use crate::error::{Error, Result};
use crate::gpu::{FrameResources, Gpu, Kernel, PassTime, PerBlock, Recorder, thread_items};
use crate::layout::{
    Apportionment, Camera, Effects, LIGHT_ENVIRONMENT, NONE, PathPush, PixelLight, PixelStats, PriorityPush,
    ROOT_OF_INSTANCES,
};
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::render::frame::{self, Allocation, Stages};
use crate::render::pass::apportion::Apportion;
use crate::render::pass::scan::Scan;
use crate::render::schedule::{self, Cut};
use crate::render::schedule::{Progress, Step};
use crate::render::settings::{Placing, Sampler, Settings};
use crate::scene::{self, Scene};
use crate::shaders::shared::traverse;
use crate::shaders::{accumulate, path, primary_hit};
use crate::statistics::BrokenSamples;
use std::time::Duration;

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

/// A scene on a device and the kernels to render it. Everything is created in [`Renderer::new`], nothing later.
pub struct Renderer {
    pub(super) gpu: Gpu,
    pub(super) scene: DeviceScene,
    pub(super) stages: Stages,
    pub(super) allocation: Option<Allocation>,
    pub(super) film: FilmBuffers,
    pub(super) effects: Effects,
    pub(super) outputs: Outputs,
    pub(super) settings: Settings,
    pub(super) push: PathPush,
    pub(super) priority: PriorityPush,
    pub(super) paths: u32,
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
    /// [`crate::error::Error::Usage`] for settings out of range, [`crate::error::Error::Scene`] for a scene that
    /// [`Scene::check`] refuses, [`crate::error::Error::Device`] when the device refuses something.
    pub fn new(gpu: &Gpu, scene: &Scene, settings: &Settings, outputs: Outputs) -> Result<Self> {
        Self::specialised(gpu, scene, settings, outputs, called_for(scene, settings, outputs))
    }

    /// [`Renderer::new`] with other effects compiled in: more of them change nothing but the speed, fewer leave things
    /// out of the picture. The effects that the outputs stand for are taken from `outputs`.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn specialised(
        gpu: &Gpu,
        scene: &Scene,
        settings: &Settings,
        outputs: Outputs,
        effects: Effects,
    ) -> Result<Self> {
        settings.validate()?;
        scene.check()?;
        let policy = settings.allocate.policy;
        let split_light = outputs.split_light || policy.split_light;
        let effects = Effects { split_light, counters: outputs.counters, ..effects };
        let (thread, traverse) = (gpu.tuning().thread(), traverse::Constants { stack: scene.stack });
        let stages = Stages {
            guide: Kernel::new(gpu, &primary_hit::Constants { effects, thread, traverse })?,
            path: Kernel::new(gpu, &path::Constants { effects, thread, traverse })?,
            fold: Kernel::new(gpu, &accumulate::Constants { effects, thread })?,
        };
        let pixels = settings.pixels() as u32;
        let allocation = effects.adaptive.then(|| allocation(gpu, policy, pixels)).transpose()?;
        let paths = paths_in_flight(gpu, settings, &effects);
        let film = FilmBuffers::new(gpu, pixels, paths, &effects, outputs.guides || policy.guides)?;
        // Offsets are the widest records that are bound whole.
        let most = (gpu.info().max_storage_range / 8 - 1).min(film.tiles[0].pixels.into());
        if !settings.allocate.is_even() && u64::from(pixels) > most {
            return Err(Error::Usage(format!(
                "a film of {pixels} pixels is too large to place samples on this device: choose at most {most} pixels, \
                 or --allocate uniform"
            )));
        }
        let (push, priority) = (path_push(scene, settings)?, priority_push(scene, settings));
        let scene = DeviceScene::new(gpu, scene, &effects)?;
        Ok(Self {
            gpu: gpu.clone(),
            scene,
            stages,
            allocation,
            film,
            effects,
            outputs,
            settings: settings.clone(),
            push,
            priority,
            paths,
        })
    }

    /// The work of a whole render, in the order that it must be recorded in. The result does not depend on how the work
    /// is cut into batches.
    pub fn steps(&self) -> impl Iterator<Item = Step> + use<> {
        schedule::steps(&self.settings, &self.cut())
    }

    /// The rest of the work, once [`Renderer::resume`] has put back what there was.
    pub fn rest(&self, progress: Progress) -> impl Iterator<Item = Step> + use<> {
        schedule::rest(&self.settings, &self.cut(), progress)
    }

    fn cut(&self) -> Cut {
        Cut { pixels: self.settings.pixels() as u32, tile: self.film.tiles[0].window, paths: self.paths }
    }

    /// Records one step.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] for a step of another renderer, [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, step: &Step) -> Result<()> {
        if !self.cut().has_room_for(step) {
            return Err(Error::Usage(format!("{step:?} is of another renderer: take those of Renderer::steps")));
        }
        let (st, s, f, push) = (&self.stages, &self.scene, &self.film, &self.push);
        match (step, &self.allocation) {
            (Step::Start, allocation) => {
                frame::record_start(rec, st, s, f, push)?;
                allocation.as_ref().map_or(Ok(()), |a| frame::record_preparation(rec, a, f, &self.priority))
            }
            (Step::Uniform(batch), _) => frame::record_uniform(rec, st, s, f, push, batch),
            (Step::Allocate(plan), Some(a)) => frame::record_allocation(rec, a, f, &self.priority, plan),
            (Step::Choose(choice), Some(a)) => frame::record_choice(rec, a, f, &self.priority, choice, push.seed),
            (Step::Listed(range), Some(a)) => {
                if self.list_may_be_short() {
                    rec.fill(&f.paths, NONE)?;
                }
                frame::record_listed(rec, st, a, s, f, push, range)
            }
            _ => Err(Error::Usage("this renderer was made without the effect \"adaptive\"".into())),
        }
    }

    /// Whether only the device knows how many paths [`Renderer::listed`] are listed.
    pub fn list_may_be_short(&self) -> bool {
        let allocate = &self.settings.allocate;
        allocate.policy.placing == Placing::Chosen || allocate.noise_threshold > 0.0
    }

    /// Runs one step on the renderer's own queue and waits.
    ///
    /// # Errors
    /// As [`Renderer::record`].
    pub fn run(&self, frame: &mut FrameResources, step: &Step) -> Result<Vec<PassTime>> {
        self.gpu.run(frame, |rec| self.record(rec, step))
    }

    /// Puts back what an earlier render had: statistics, light (empty unless it is kept apart or the policy asks for it), priorities (empty unless
    /// the policy keeps them from round to round), and how many samples each pixel still lacks of what it was to have.
    /// Follow it with [`Renderer::rest`]. Needs the effect `adaptive`.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] when there is no such effect, or when the lengths are not those of the film;
    /// [`crate::error::Error::Device`].
    pub fn resume(
        &self,
        frame: &mut FrameResources,
        stats: &[PixelStats],
        light: &[PixelLight],
        priority: &[f32],
        pending: &[u32],
    ) -> Result<()> {
        let Some(a) = &self.allocation else {
            return Err(Error::Usage("this renderer was made without the effect \"adaptive\"".into()));
        };
        let pixels = self.settings.pixels();
        let of_film = |what: &str, len: usize, may_be_empty: bool| match len == pixels || (may_be_empty && len == 0) {
            true => Ok(()),
            false => Err(Error::Usage(format!("{len} {what} for a film of {pixels} pixels: give one each"))),
        };
        of_film("statistics", stats.len(), false)?;
        of_film("lights", light.len(), !self.effects.split_light)?;
        of_film("priorities", priority.len(), true)?;
        of_film("pending counts", pending.len(), false)?;
        self.run(frame, &Step::Start)?;
        self.film.tiles[0].stats.write(0, stats)?;
        if self.effects.split_light {
            self.film.tiles[0].light.write(0, light)?;
        }
        self.film.priority.write(0, priority)?;
        self.film.counts.count.write(0, pending)?;
        self.gpu.run(frame, |rec| a.scan.record(rec, &self.film.counts))?;
        Ok(())
    }

    /// The priorities that the policy gives to pixels of these statistics, found on the host, if no pixel were full
    /// before `limit` samples.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] for statistics of another film, [`crate::error::Error::Device`].
    pub fn priorities_of(&self, stats: &[PixelStats], limit: u32) -> Result<Vec<f32>> {
        let (found, pixels) = (stats.len(), self.settings.pixels());
        if found != pixels {
            return Err(Error::Usage(format!("statistics of {found} pixels: the film has {pixels}")));
        }
        let push = PriorityPush { limit, ..self.priority };
        let guide = self.film.tiles[0].guide.read()?;
        let light = self.film.tiles[0].light.read()?;
        let inputs = HostInputs { guide: &guide, stats, light: &light, priority: &[], push };
        Ok((self.settings.allocate.policy.reference)(&inputs))
    }

    /// How the last allocation went.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn apportionment(&self) -> Result<Apportionment> {
        Ok(self.film.counts.state.read()?[0])
    }

    /// Paths of the list that the last [`Step::Allocate`] or [`Step::Choose`] made.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn listed(&self) -> Result<u64> {
        let pixels = self.settings.pixels();
        let [low, high] = self.film.counts.offset.read_range(pixels..pixels + 1)?[0];
        Ok(u64::from(low) | u64::from(high) << 32)
    }

    /// Moves the camera; what was accumulated belongs to the old one, so begin with [`Step::Start`].
    ///
    /// # Errors
    /// [`crate::error::Error::Scene`] for a number that is not finite, and
    /// [`crate::error::Error::Usage`] for a lens when the scene was loaded with a pinhole: the kernels have no lens then.
    /// Ask [`Renderer::specialised`] for the effect `lens`, or load the scene with one.
    pub fn set_camera(&mut self, camera: Camera) -> Result<()> {
        scene::check_camera(&camera)?;
        if camera.lens_radius > 0.0 && !self.effects.lens {
            return Err(Error::Usage("this renderer was made without the effect \"lens\"".into()));
        }
        self.push.camera = camera;
        Ok(())
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
            ("primary_hit", milliseconds(self.stages.guide.compile_time())),
            ("path", milliseconds(self.stages.path.compile_time())),
            ("accumulate", milliseconds(self.stages.fold.compile_time())),
        ]
    }

    /// Samples since [`Step::Start`] that were no number, and counted as black: a fault of the renderer, or of a scene whose
    /// numbers are too large.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn broken_samples(&self) -> Result<Option<BrokenSamples>> {
        let found = self.film.broken.read()?[0];
        let (pixel, Settings { width, first_sample, seed, .. }) = (!found.pixel, &self.settings);
        Ok((found.count > 0).then(|| BrokenSamples {
            count: found.count.into(),
            pixel: [pixel % width, pixel / width],
            sample: first_sample.wrapping_add(found.index),
            seed: *seed,
        }))
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
pub fn called_for(scene: &Scene, settings: &Settings, outputs: Outputs) -> Effects {
    scene::effects(scene, settings, outputs.split_light, outputs.counters).0
}

/// Every effect of light and matter; the random numbers stay those that the settings chose.
pub fn all_effects(scene: &Scene, settings: &Settings) -> Effects {
    let independent_sampler = settings.sampler == Sampler::Independent;
    Effects { independent_sampler, large_lamps: scene.large_lamps, ..Effects::ALL }
}

/// Paths per dispatch, whose samples fit a storage buffer.
fn paths_in_flight(gpu: &Gpu, settings: &Settings, effects: &Effects) -> u32 {
    let bytes = if effects.split_light { 48 } else { 16 };
    let room = gpu.info().max_storage_range / bytes;
    let all = settings.pixels() as u64 * u64::from(settings.spp);
    gpu.tuning().paths_in_flight.min(room).min(all).max(1) as u32
}

fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

fn allocation(gpu: &Gpu, policy: &Row, pixels: u32) -> Result<Allocation> {
    let thread_items = thread_items(gpu, pixels);
    Ok(Allocation {
        policy: (policy.make)(gpu, pixels)?,
        apportion: Apportion::new(gpu, thread_items)?,
        choose: Kernel::new(gpu, &gpu.tuning().thread().into())?,
        scan: Scan::new(gpu, thread_items)?,
        batch: PerBlock::new(gpu, thread_items)?,
    })
}

/// What the policies are told of a scene.
pub fn priority_push(scene: &Scene, s: &Settings) -> PriorityPush {
    let a = &s.allocate;
    let [low, high] = scene.bounds.map(glam::Vec3::from);
    let sigma = (a.geometry.sigma_position * high.distance(low)).max(f32::MIN_POSITIVE.sqrt());
    PriorityPush {
        size: [s.width, s.height],
        window: a.geometry.window,
        normal_scale: a.geometry.sigma_normal.powi(-2),
        position_scale: sigma.powi(-2),
        luminance_floor: a.variance.luminance_floor,
        limit: schedule::limit(s),
        threshold: a.noise_threshold,
        filtered: a.both.filtered,
        round: 0,
    }
}

/// What the kernels are told of a scene; the batch is still to be filled in.
///
/// # Errors
/// Those of [`Scene::camera`].
pub fn path_push(scene: &Scene, settings: &Settings) -> Result<PathPush> {
    let environment = scene.lights.iter().position(|l| l.kind == LIGHT_ENVIRONMENT);
    Ok(PathPush {
        camera: scene.camera([settings.width, settings.height])?,
        size: [settings.width, settings.height],
        first_sample: settings.first_sample,
        seed: settings.seed,
        max_depth: settings.max_depth,
        roulette_depth: settings.roulette_depth,
        clamp_indirect: settings.clamp_indirect,
        pixel_filter: settings.filter.code(),
        light_count: scene.lights.len() as u32,
        triangle_pdf_scale: scene.triangle_pdf_scale,
        environment: environment.map_or(NONE, |i| i as u32),
        environment_width: scene.environment.as_ref().map_or(0, |e| e.width),
        root: scene.root | if scene.instances.is_empty() { 0 } else { ROOT_OF_INSTANCES },
        ..PathPush::default()
    })
}
