//! The renderer that an engine embeds and that the command line drives: a scene on a device, kernels specialised for
//! it, and frames recorded batch by batch into command buffers.
use crate::allocate::HostInputs;
use crate::error::{Error, Result};
use crate::gpu::{DeviceInfo, FrameResources, Gpu, PassTime, Recorder, milliseconds};
use crate::image::Picture;
use crate::layout::{Apportionment, Camera, Effect, Effects, PixelStats, PriorityPush, uvec2, vec4};
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::render::frame::{self, Frame};
use crate::render::kernels::{Allocation, Kernels};
use crate::render::pass::wavefront;
use crate::render::push::{frame_constants, priority_push};
use crate::render::schedule::{self, Cut, Step};
use crate::render::settings::{Sampler, Settings, Split};
use crate::scene::{self, Fingerprint, Scene};
use crate::statistics::BrokenSamples;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

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

impl Outputs {
    /// All that filters read, and nothing more.
    pub const FILTERED: Self = Self { split_light: true, guides: true, counters: false };

    /// [`Self::FILTERED`] if a filter follows, and the fewest otherwise.
    pub fn for_filter(follows: bool) -> Self {
        if follows { Self::FILTERED } else { Self::default() }
    }

    /// What one of both leaves.
    pub fn or(self, other: Self) -> Self {
        Self {
            split_light: self.split_light || other.split_light,
            guides: self.guides || other.guides,
            counters: self.counters || other.counters,
        }
    }
}

/// A scene on a device and the kernels to render it, all made in [`Renderer::new`]. Later, only [`Renderer::keep_history`] makes more, and
/// [`Renderer::update`] allocates memory where the scene has grown.
///
/// It has one film. Threads that run or record it at the same time add samples to those of each other, which makes wrong pictures and no
/// error: give each thread a renderer of its own.
pub struct Renderer {
    pub(crate) gpu: Gpu,
    pub(super) frame: Frame,
    pub(super) effects: Effects,
    pub(super) outputs: Outputs,
    pub(super) settings: Settings,
    pub(super) stack: u32,
    paths: u32,
    pub(super) soft_lights: bool,
    pub(super) fingerprint: Option<Fingerprint>,
    /// [`Scene::serial`] of what the device has; none after an update that has failed half way.
    pub(super) serial: Option<u64>,
    /// Whether what was accumulated is of another seed, first sample or scene than the renderer is set to: until the next start.
    pub(super) relabelled: AtomicBool,
}

/// Ray counts since the renderer was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
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

    /// [`Renderer::new`] for a render that goes on from a [`Checkpoint`](super::Checkpoint). One that places samples can do so
    /// by itself; one that spreads them evenly gets the kernels and the buffers that give each pixel what it lacks.
    ///
    /// # Errors
    /// As [`Renderer::new`], and [`crate::error::Error::Usage`] for a film of more pixels than the device can bind offsets of: see
    /// [`Renderer::can_resume`].
    pub fn resumable(gpu: &Gpu, scene: &Scene, settings: &Settings, outputs: Outputs) -> Result<Self> {
        let effects = Effects { adaptive: true, ..called_for(scene, settings, outputs) };
        let renderer = Self::specialised(gpu, scene, settings, outputs, effects)?;
        renderer.check_offsets("go on with", "")?;
        Ok(renderer)
    }

    /// Whether a render like this one can go on from a checkpoint on this device: most devices have room for that of films of some
    /// 44 million pixels, software ones for 16 million.
    pub fn can_resume(&self) -> bool {
        self.settings.pixels() as u64 <= self.most_offsets()
    }

    /// Pixels whose offsets in a list of paths one storage binding holds, the widest records that are bound whole, in a film of one tile.
    fn most_offsets(&self) -> u64 {
        (self.gpu.info().max_storage_range / size_of::<uvec2>() as u64 - 1).min(self.frame.film.tiles[0].pixels.into())
    }

    fn check_offsets(&self, to: &str, or: &str) -> Result<()> {
        let (pixels, most) = (self.settings.pixels(), self.most_offsets());
        if self.can_resume() {
            return Ok(());
        }
        Err(Error::Usage(format!(
            "a film of {pixels} pixels is too large to {to} on this device: choose at most {most} pixels{or}"
        )))
    }

    /// [`Renderer::new`] with other effects compiled in: more of them, up to [`crate::render::all_effects`], change nothing but the speed, fewer
    /// leave things out of the picture. The effects that the outputs stand for are taken from `outputs`.
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
        settings.check_most()?;
        scene.check()?;
        let policy = settings.allocate.policy;
        let split_light = outputs.split_light || policy.split_light;
        let effects = Effects { split_light, counters: outputs.counters, ..effects };
        let pixels = settings.pixels() as u32;
        let allocation = effects.adaptive.then(|| Allocation::new(gpu, policy, settings)).transpose()?;
        let paths = paths_in_flight(gpu, scene, settings, &effects);
        let kernels = Kernels::new(gpu, effects, scene.stack, settings.max_depth, paths)?;
        let film = FilmBuffers::new(gpu, pixels, paths, &effects, outputs.guides || policy.guides)?;
        let (constants, priority_push) = (frame_constants(scene, settings)?, priority_push(scene, settings));
        let (soft_lights, stack) = (scene.has_soft_lights(), scene.stack);
        let fingerprint = Some(scene.fingerprint(settings.size())?);
        let serial = Some(scene.serial());
        let scene = DeviceScene::new(gpu, scene, &effects)?;
        let (settings, first_sample) = (settings.clone(), settings.first_sample);
        let history = None;
        let frame = Frame { scene, film, kernels, allocation, history, constants, first_sample, priority_push };
        let renderer = Self {
            gpu: gpu.clone(),
            frame,
            effects,
            outputs,
            settings,
            paths,
            stack,
            soft_lights,
            fingerprint,
            serial,
            relabelled: AtomicBool::new(false),
        };
        if !renderer.settings.allocate.is_even() {
            renderer.check_offsets("place samples of", ", or --allocate uniform")?;
        }
        Ok(renderer)
    }

    /// Whether direct light, where it is kept apart, holds none of lamps and sky: their shadows are soft and noisy.
    pub fn sharp_direct(&self) -> bool {
        self.effects.soft_light || !self.soft_lights
    }

    /// The work of a whole render, in the order that it must be recorded in. The result does not depend on how the work
    /// is cut into batches.
    pub fn steps(&self) -> impl Iterator<Item = Step> + use<> {
        schedule::steps(&self.settings, &self.cut())
    }

    /// Steps behind [`Step::Start`] that give every pixel `count` samples, from its sample `first` on ([`Settings::first_sample`] not
    /// counted). Who renders so decides from frame to frame how many there are; the buffers are those for [`Settings::spp`].
    pub fn samples(&self, first: u32, count: u32) -> impl Iterator<Item = Step> + use<> {
        schedule::uniform(&self.cut(), self.settings.first_sample.wrapping_add(first), count).map(Step::Uniform)
    }

    /// Reads back the mean radiance of every pixel.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn picture(&self) -> Result<Picture> {
        let mut pixels = Vec::with_capacity(self.settings.pixels());
        for tile in &self.frame.film.tiles {
            for window in tile.windows() {
                let stats = tile.stats.read_range(window.start as usize..window.end as usize)?;
                pixels.extend(stats.iter().map(|s| s.mean));
            }
        }
        Ok(Picture { width: self.settings.width, height: self.settings.height, pixels })
    }

    pub(super) fn cut(&self) -> Cut {
        Cut { pixels: self.settings.pixels() as u32, tile: self.frame.film.tiles[0].window, paths: self.paths }
    }

    /// Records one step.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] for a recorder of another device, a step that this renderer has no room for, and after
    /// [`Renderer::update`] has failed on the device, [`crate::error::Error::Device`]. Other steps of another renderer are not told apart
    /// and make a wrong picture.
    pub fn record(&self, rec: &mut Recorder, step: &Step) -> Result<()> {
        rec.gpu().owns("the renderer", &self.gpu)?;
        self.serial.ok_or_else(half_updated)?;
        if !self.cut().has_room_for(step) {
            return Err(Error::Usage(format!("{step:?} is of another renderer: take those of Renderer::steps")));
        }
        frame::record(rec, &self.frame, step)?;
        if let Step::Start = step {
            self.relabelled.store(false, Relaxed);
        }
        Ok(())
    }

    /// Whether only the device knows how many paths [`Renderer::listed`] are listed.
    pub fn list_may_be_short(&self) -> bool {
        self.settings.allocate.list_may_be_short()
    }

    /// Runs one step on the renderer's own queue and waits.
    ///
    /// # Errors
    /// As [`Renderer::record`].
    pub fn run(&self, frame: &mut FrameResources, step: &Step) -> Result<Vec<PassTime>> {
        self.gpu.run(frame, |rec| self.record(rec, step))
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
        let push = PriorityPush { limit, ..self.frame.priority_push };
        let guide = self.frame.film.tiles[0].guide.read()?;
        let light = self.frame.film.tiles[0].light.read()?;
        let inputs = HostInputs { guide: &guide, stats, light: &light, priority: &[], push };
        Ok((self.settings.allocate.policy.reference)(&inputs))
    }

    /// How the last [`Step::Allocate`] went; all zeros before the first.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] for a renderer that cannot place samples, [`crate::error::Error::Device`].
    pub fn apportionment(&self) -> Result<Apportionment> {
        self.frame.allocation()?;
        Ok(self.frame.film.counts.state.read()?[0])
    }

    /// Paths of the list that the last [`Step::Allocate`] or [`Step::Choose`] made; 0 before the first.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] for a renderer that cannot place samples, [`crate::error::Error::Device`].
    pub fn listed(&self) -> Result<u64> {
        self.frame.allocation()?;
        let pixels = self.settings.pixels();
        let [low, high] = self.frame.film.counts.offset.read_range(pixels..pixels + 1)?[0];
        Ok(u64::from(low) | u64::from(high) << 32)
    }

    /// Moves the camera from the next [`Step::Start`] on; what was accumulated belongs to the old one. Steps that were recorded
    /// before keep theirs, done or not.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] as [`scene::check_camera`] says, and for a lens when the scene was loaded with a pinhole: the
    /// kernels have no lens then. Make it by [`Renderer::specialised`] with the effect `lens`, or load the scene with one. Likewise for
    /// parallel rays and the effect `orthographic`.
    pub fn set_camera(&mut self, camera: Camera) -> Result<()> {
        scene::check_camera(&camera)?;
        if camera.lens_radius > 0.0 && !self.effects.lens {
            return Err(lacks_effect(Effect::lens));
        }
        if camera.orthographic != 0 && !self.effects.orthographic {
            return Err(lacks_effect(Effect::orthographic));
        }
        self.frame.constants.camera = camera;
        self.fingerprint = None;
        Ok(())
    }

    /// Chooses another random sequence from the next [`Step::Start`] on, which has to follow; what was accumulated belongs to the old
    /// one, and its films can be neither resumed nor merged from here on.
    pub fn set_seed(&mut self, seed: u32) {
        *self.relabelled.get_mut() |= self.settings.seed != seed;
        self.frame.constants.path.seed = seed;
        self.settings.seed = seed;
    }

    /// The buffers, for reading back and for stages of the caller's own.
    pub fn film(&self) -> &FilmBuffers {
        &self.frame.film
    }

    /// The scene's buffers.
    pub fn scene(&self) -> &DeviceScene {
        &self.frame.scene
    }

    /// That of the scene; none once the camera was moved, nor where what was accumulated is of something else, nor where the sequence may
    /// begin again among the samples.
    pub(super) fn fingerprint(&self) -> Option<&Fingerprint> {
        let ends = self.settings.first_sample.checked_add(Settings::MAX_SPP).is_some();
        self.fingerprint.as_ref().filter(|_| ends && !self.relabelled.load(Relaxed))
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
            ("primary_hit", milliseconds(self.frame.kernels.primary_hit.compile_time())),
            ("path", milliseconds(self.frame.kernels.path.compile_time())),
            ("accumulate", milliseconds(self.frame.kernels.accumulate.compile_time())),
        ]
    }

    /// Samples since [`Step::Start`] that are wrong: those that were no number, a fault of the renderer, or of a scene whose numbers
    /// are too large, and those of paths whose rays had to search for too long for llvmpipe.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn broken_samples(&self) -> Result<Option<BrokenSamples>> {
        let found = self.frame.film.broken.read()?[0];
        let (pixel, Settings { width, first_sample, seed, .. }) = (!found.pixel, &self.settings);
        let carried = if found.count > 0 { self.carried_at(pixel)? } else { 0 };
        Ok((found.count > 0).then(|| BrokenSamples {
            count: found.count.into(),
            pixel: [pixel % width, pixel / width],
            sample: first_sample.wrapping_add(found.index.wrapping_sub(carried)),
            seed: *seed,
        }))
    }

    /// Reads the counters; zero unless they were asked for.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn counters(&self) -> Result<Counters> {
        let words = self.frame.film.counters.read()?;
        let pair = |i: usize| u64::from(words[2 * i]) | u64::from(words[2 * i + 1]) << 32;
        Ok(Counters { closest: pair(0), any: pair(1), nodes: pair(2) })
    }
}

/// For what a renderer has no kernels for.
pub(super) fn lacks_effect(effect: Effect) -> Error {
    Error::Usage(format!(
        "this renderer was made without the effect \"{}\": make it by Renderer::specialised, with what render::called_for \
         finds in the scene as it will be",
        effect.name()
    ))
}

/// For a renderer that knows neither the scene before a change nor that after it.
pub(super) fn half_updated() -> Error {
    Error::Usage("the last update of this renderer failed half way: update with Change::everything first".into())
}

/// The effects that a scene, its settings and the outputs call for.
pub fn called_for(scene: &Scene, settings: &Settings, outputs: Outputs) -> Effects {
    scene::effects(scene, settings, outputs.split_light, outputs.counters).0
}

/// Every effect of light and matter; random numbers and layers stay those that the settings chose.
pub fn all_effects(scene: &Scene, settings: &Settings) -> Effects {
    let independent_sampler = settings.sampler == Sampler::Independent;
    // Lamps and sky may come to shine later.
    let soft_light = settings.split == Split::Soft;
    let Scene { large_lamps, weighed_lights, .. } = *scene;
    let light_tree = scene.has_light_tree();
    Effects { independent_sampler, large_lamps, weighed_lights, light_tree, soft_light, ..Effects::ALL }
}

/// Bytes of device memory that samples in flight take in a render with these effects.
#[cfg(feature = "cli")]
pub(crate) fn bytes_in_flight(gpu: &Gpu, scene: &Scene, settings: &Settings, effects: &Effects) -> u64 {
    u64::from(paths_in_flight(gpu, scene, settings, effects)) * FilmBuffers::bytes_per_path(effects)
}

/// Paths per dispatch, whose samples, or what a wavefront keeps of them, have room.
fn paths_in_flight(gpu: &Gpu, scene: &Scene, settings: &Settings, effects: &Effects) -> u32 {
    let wavefront = gpu.tuning().has_wavefront(scene.stack, settings.max_depth);
    let records = effects.records_per_path() as u64;
    let waiting = if wavefront { wavefront::BYTES_PER_PATH } else { 0 };
    let DeviceInfo { max_storage_range, max_texel_elements, memory_heap, .. } = *gpu.info();
    let room = room_for_paths(records, waiting, [max_storage_range, max_texel_elements, memory_heap]);
    let all = settings.pixels() as u64 * u64::from(settings.spp);
    gpu.tuning().paths_in_flight.min(room).min(all).max(1) as u32
}

/// Paths of a batch, whose samples have `records` of a texel each, and that take so many bytes while they wait: the largest buffer of
/// theirs is one storage binding, in a small part of the device's memory, and samples are read as texels.
fn room_for_paths(records: u64, waiting: u64, [binding, texels, heap]: [u64; 3]) -> u64 {
    const PART: u64 = 8;
    const TEXEL: u64 = size_of::<vec4>() as u64;
    (binding.min(heap / PART) / waiting.max(records * TEXEL)).min(texels / records)
}

#[cfg(test)]
mod tests {
    use super::room_for_paths;

    #[test]
    fn batches_fit_the_limits_of_a_device_and_leave_most_of_its_memory() {
        const GIB: u64 = 1 << 30;
        assert_eq!(room_for_paths(1, 0, [4 * GIB, 1 << 27, 4 * GIB]), GIB / 2 / 16);
        assert_eq!(room_for_paths(3, 0, [GIB / 8, 1 << 27, 80 * GIB]), GIB / 8 / 48);
        assert_eq!(room_for_paths(3, 176, [GIB / 8, 1 << 27, 80 * GIB]), GIB / 8 / 176);
        assert_eq!(room_for_paths(3, 176, [GIB / 8, 65_536, 80 * GIB]), 65_536 / 3, "the least that Vulkan asks for");
    }
}
