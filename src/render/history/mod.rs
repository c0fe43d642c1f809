//! What is kept from frame to frame: the samples of each pixel, and the points of the scene that they are of.
mod handover;
mod numbers;
mod probes;
mod way;

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{
    Camera, Effects, History as Record, HistoryLight, LightChange, PathConstants, ReprojectPush, SurfacePoint,
};
use crate::render::buffers::most_of_one_tile;
use crate::render::settings::Settings;
use crate::scene::animation::Animation;
use crate::scene::{Change, Relit, Scene};
use crate::settings::{FROM_0, choices, entry, settings};
use crate::shaders;
use crate::threads::both;
pub use handover::Handover;
use numbers::Numbers;
pub use probes::Probes;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
pub(super) use way::{Forward, Way};

choices! {
    /// How frames come to samples of the last.
    pub enum Reprojection {
        /// Not at all: every frame alone
        Off,
        /// Samples move to where their points are now (Schalk 2018)
        #[default]
        Forward,
        /// Pixels look up where their points were, and merge the samples of the four pixels around
        Backward,
    }
}

settings! {
    /// Which samples of a frame are carried to the next.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct Reproject {
        /// The settings of [`Reproject`] that are given; the others are `None`.
        ReprojectOverrides {
            /// Whether frames begin with the samples of the last that still hold; `tallow sequence` moves them forward where something
            /// moves, the camera has no lens, and samples are placed by no threshold or limit
            reproject: Reprojection = Reprojection::Forward, .., [value_name = "HOW"];
            /// Change of light by a new view before carried samples count less, as a share of the noise of one sample, its standard
            /// deviation; 0 carries none whose look changes.
            reproject_error: f32 = 0.25, FROM_0;
            /// Share by which light may change from frame to frame before carried samples count less: the deviation of one sample
            /// that a filter leaves, about.
            reproject_light: f32 = 0.05, FROM_0;
            /// Largest distance of the hits around a pixel from its surface's plane, in widths of the pixel there.
            reproject_aliasing: f32 = 0.5, FROM_0;
            /// Samples that a pixel carries to the next frame at most.
            reproject_samples: u32 = 256, 1..=65535;
            /// Frames that the samples of a pixel are carried through at most, on average: of older ones fewer count.
            reproject_age: u32 = 64, 0..=255;
        }
    }
}

/// Pixels that a key has room for, see `glsl/shared/history.glsl`.
const MOST_PIXELS: u32 = (1 << shaders::shared::history::PIXEL_BITS) - 1;

/// What may change from frame to frame where samples are carried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moves {
    /// The camera. Over any other change nothing is carried.
    Camera,
    /// All that a pose can change. How light has changed is then found by paths, whose kernel is compiled.
    Scene,
}

impl Moves {
    /// What an animation moves: every pose says of all that ever moves where it is. One that lacks the pose of its beginning, such as a
    /// file, may move all.
    pub fn of(animation: &Animation) -> Self {
        let is_of_camera = animation.at(0.0).is_ok_and(|pose| pose.is_of_camera_alone());
        if is_of_camera { Self::Camera } else { Self::Scene }
    }
}

/// The kernels and buffers of reprojection. `P` pixels; 72 bytes each, with [`crate::render::FilmTile::points`], and 32 more where
/// direct and indirect light are kept apart. Where more moves than the camera, 5 more for probes.
pub struct History {
    /// Writes what pixels hand on.
    pub(super) remember: Kernel<shaders::remember::Bind<'static>>,
    /// Brings it to the new ones.
    pub(super) way: Way,
    /// What each pixel of the last frame hands on.
    pub records: Buffer<Record>,
    /// Its light, where direct and indirect light are kept apart; else one unused element.
    pub light: Buffer<HistoryLight>,
    /// Of each pixel of the last frame, a word of `glsl/shared/history.glsl`: how many samples it handed on, or why none.
    pub offered: Buffer<u32>,
    /// The same of each pixel of this frame: how many of its samples are carried. While they are, the keys of the winners.
    pub carried: Buffer<u32>,
    /// The camera of the last frame.
    pub(super) previous: Buffer<Camera>,
    pub(super) numbers: Numbers,
    /// What finds how light has changed, where more moves than the camera.
    pub(super) probes: Option<Probes>,
    no_change: Buffer<LightChange>,
    /// Whether more than the camera has changed since the last frame.
    changed: AtomicBool,
    /// Whether the light of the sky has, by that change.
    sky: bool,
    /// The camera of the last frame, none where nothing of it may be carried.
    last: Mutex<Option<Camera>>,
    settings: Reproject,
    spp: u32,
}

impl History {
    /// Bytes of a pixel, the point of its first hit included.
    pub fn bytes_per_pixel(split_light: bool) -> usize {
        let light = if split_light { size_of::<HistoryLight>() } else { 0 };
        size_of::<Record>() + 2 * size_of::<u32>() + size_of::<SurfacePoint>() + light
    }

    /// # Errors
    /// [`Error::Usage`] for a camera with a lens or parallel rays.
    pub(super) fn check_camera(camera: &Camera) -> Result<()> {
        let what = match camera {
            Camera { orthographic: 1.., .. } => "nothing can be carried between views of an orthographic camera",
            Camera { lens_radius, .. } if *lens_radius > 0.0 => {
                "samples through a lens show many points: nothing can be carried; render with lens_radius 0"
            }
            _ => return Ok(()),
        };
        Err(Error::Usage(what.into()))
    }

    /// # Errors
    /// [`Error::Usage`] for a film of too many pixels.
    pub(super) fn check_room(gpu: &Gpu, pixels: u32) -> Result<()> {
        let words = gpu.info().max_storage_range / size_of::<u32>() as u64;
        let most = words.min(MOST_PIXELS.min(most_of_one_tile(gpu)).into());
        if u64::from(pixels) > most {
            return Err(Error::Usage(format!(
                "a film of {pixels} pixels is too large to reproject on this device: choose at most {most} pixels"
            )));
        }
        Ok(())
    }

    /// For the films of these settings. `stack` is [`crate::scene::Scene::stack`].
    ///
    /// # Errors
    /// [`Error::Usage`] for a setting out of range and for a film that is too large, [`Error::Device`].
    pub(super) fn new(
        gpu: &Gpu,
        effects: Effects,
        stack: u32,
        of_frame: &Settings,
        settings: Reproject,
        moves: Moves,
    ) -> Result<Self> {
        entry::check(&settings.entries())?;
        let pixels = of_frame.pixels() as u32;
        Self::check_room(gpu, pixels)?;
        let thread = gpu.tuning().thread();
        let room = |on: bool| if on { pixels as usize } else { 1 };
        let remember = || Kernel::new(gpu, &shaders::remember::Constants { effects, thread });
        let way = || Way::new(gpu, effects, settings.reproject);
        let probes = || (moves == Moves::Scene).then(|| Probes::new(gpu, effects, stack, of_frame.size())).transpose();
        let (probes, (remember, way)) = both(probes, || both(remember, way))?;
        Ok(Self {
            remember,
            way,
            records: Buffer::new(gpu, "history", room(true), Location::Device)?,
            light: Buffer::new(gpu, "history of light", room(effects.split_light), Location::Device)?,
            offered: Buffer::from_slice(gpu, "offered samples", &vec![0; pixels as usize])?,
            carried: Buffer::from_slice(gpu, "carried samples", &vec![0; pixels as usize])?,
            previous: Buffer::from_slice(gpu, "previous camera", &[Camera::default()])?,
            numbers: Numbers::new(gpu)?,
            probes,
            no_change: Buffer::from_slice(gpu, "no changes of light", &[])?,
            changed: AtomicBool::new(false),
            sky: false,
            last: Mutex::new(None),
            settings,
            spp: of_frame.spp,
        })
    }

    /// Gets ready for a change of more than the camera, after a frame of these constants and this first sample.
    pub(super) fn note(
        &mut self,
        rec: &mut Recorder,
        scene: &Scene,
        change: &Change,
        c: &PathConstants,
        first_sample: u32,
    ) -> Result<()> {
        self.changed.store(true, Relaxed);
        let Some(probes) = &mut self.probes else { return Ok(()) };
        self.numbers.note(rec, change)?;
        self.sky = change.changes_sky(scene);
        let relit = change.lights.then(|| Relit::of(&change.lights_before, scene)).flatten();
        probes.note(rec, relit.as_ref(), c, first_sample)
    }

    /// Whether more than the camera has changed since the last frame.
    pub(super) fn has_changed(&self) -> bool {
        self.changed.load(Relaxed)
    }

    /// Whether every pixel of the last frame was seen from one point: samples through a lens show many.
    pub(super) fn is_of_points(&self) -> bool {
        self.last().is_some_and(|camera| Self::check_camera(&camera).is_ok())
    }

    /// Whether a frame from `camera` can begin with samples of the last: where nothing has changed, with all of any camera. Where only the
    /// camera is followed, a change of anything else ends them.
    pub(super) fn leads_to(&self, camera: &Camera) -> bool {
        let still = !self.has_changed() && self.last() == Some(*camera);
        let is_followed = self.probes.is_some() || !self.has_changed();
        still || is_followed && self.is_of_points() && Self::check_camera(camera).is_ok()
    }

    fn last(&self) -> Option<Camera> {
        *self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that nothing of the last frame may be carried, nor its scene be looked at.
    pub(super) fn forget(&self) {
        self.settle(None);
    }

    /// Notes that a frame has begun with what there is now, seen by this camera.
    pub(super) fn settle(&self, camera: Option<Camera>) {
        self.changed.store(false, Relaxed);
        *self.last.lock().unwrap_or_else(PoisonError::into_inner) = camera;
    }

    /// How light had changed in each cell of 4x4 pixels of the last frame at the last [`Step::Reproject`](super::Step::Reproject) that followed a
    /// change of more than the camera; one unused element where nothing else moves.
    pub fn light_change(&self) -> &Buffer<LightChange> {
        self.probes.as_ref().map_or(&self.no_change, Probes::found)
    }

    /// What its kernels are told of pixels from `first_pixel` on.
    pub(super) fn push(&self, constants: &PathConstants, first_pixel: u32, pixels: u32) -> ReprojectPush {
        // Those of an earlier change have been renumbered by then.
        let [instances, triangles] = if self.has_changed() { self.numbers.anew() } else { [0; 2] };
        let s = &self.settings;
        ReprojectPush {
            size: constants.size,
            first_pixel,
            pixels,
            view: s.reproject_error,
            noise: s.reproject_light,
            aliasing: s.reproject_aliasing,
            max_samples: s.reproject_samples,
            max_age: s.reproject_age,
            spp: self.spp,
            moved: self.has_changed().into(),
            sky: (self.has_changed() && self.sky).into(),
            instances,
            triangles,
            ..Default::default()
        }
    }
}
