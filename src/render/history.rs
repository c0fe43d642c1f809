//! What is kept from frame to frame: the samples of each pixel, and the points of the scene that they are of.
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Kernel, Location};
use crate::layout::{
    AliasEntry, Camera, Effects, History as Record, HistoryLight, Light, LightChange, PathConstants, Probe,
    ReprojectPush, SurfacePoint,
};
use crate::math::hash::pcg;
use crate::render::buffers::{DeviceScene, most_of_one_tile};
use crate::scene::{Change, Relit};
use crate::settings::{FROM_0, entry, settings};
use crate::shaders;
use crate::shaders::shared::cell::CELL;
use crate::shaders::shared::history::ERROR_PARTS;
use crate::shaders::shared::{deal, scene, traverse};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

settings! {
    /// Which samples of a frame are carried to the next.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct Reproject {
        /// The settings of [`Reproject`] that are given; the others are `None`.
        ReprojectOverrides {
            /// Largest error by changed view and changed light that carried samples may have, in units of radiance.
            reproject_error: f32 = 1.0 / 256.0, FROM_0;
            /// Largest distance of the hits around a pixel from its surface's plane, in widths of the pixel there.
            reproject_aliasing: f32 = 0.5, FROM_0;
            /// Samples that a pixel carries to the next frame at most.
            reproject_samples: u32 = 256, 1..=65535;
            /// Frames that samples are carried through at most.
            reproject_age: u32 = 64, 0..=255;
        }
    }
}

/// Pixels that a key has room for, see `glsl/reproject/project.comp`.
const MOST_PIXELS: u32 = 1 << shaders::project::PIXEL_BITS;

/// The kernels and buffers of reprojection. `P` pixels; 64 bytes each, with [`crate::render::FilmTile::points`], and 28 more where
/// direct and indirect light are kept apart. Where more changes than the camera, 5 more for the cells of the film in which light is
/// probed, 4x4 pixels each.
pub struct History {
    /// Writes what pixels hand on.
    pub(super) remember: Kernel<shaders::remember::Bind<'static>>,
    /// Finds where it goes to.
    pub(super) project: Kernel<shaders::project::Bind<'static>>,
    /// Starts the new pixels with it.
    pub(super) carry: Kernel<shaders::carry::Bind<'static>>,
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
    /// Finds how light has changed.
    pub(super) probe: Kernel<shaders::probe::Bind<'static>>,
    /// Sums it over neighbouring cells.
    pub(super) light_change: Kernel<shaders::light_change::Bind<'static>>,
    /// Cells across and down.
    pub(super) cells: [u32; 2],
    /// A path of each cell.
    pub(super) probes: Buffer<Probe>,
    /// How light has changed in each cell: two, of which the levels read and write one each.
    pub(super) changes: [Buffer<LightChange>; 2],
    /// Where lights have changed: those before and those now, as probes choose them, and the table that chooses.
    pub(super) lights: [Buffer<Light>; 2],
    pub(super) light_table: Buffer<AliasEntry>,
    /// By their numbers in the last frame, those of instances and triangles in this one; unused unless `numbered` says so.
    pub(super) instance_now: Buffer<u32>,
    pub(super) triangle_now: Buffer<u32>,
    /// What the paths of probes are told in place of the frame's constants; none where lights are as they were.
    relit: Option<PathConstants>,
    probe_seed: u32,
    /// Whether instances and triangles are numbered anew.
    numbered: [bool; 2],
    /// Whether more than the camera has changed since the last frame.
    changed: AtomicBool,
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
    /// [`Error::Usage`] for a film of too many pixels.
    pub(super) fn check_room(gpu: &Gpu, pixels: u32) -> Result<()> {
        let info = gpu.info();
        let words = info.max_storage_range / size_of::<u32>() as u64;
        let most = words.min(MOST_PIXELS.min(most_of_one_tile(info)).into());
        match u64::from(pixels) > most {
            true => Err(Error::Usage(format!(
                "a film of {pixels} pixels is too large to reproject on this device: choose at most {most} pixels"
            ))),
            false => Ok(()),
        }
    }

    /// For a film of `size` pixels, which get `spp` samples a frame. `stack` is [`crate::scene::Scene::stack`].
    ///
    /// # Errors
    /// [`Error::Usage`] for a setting out of range and for a film that is too large, [`Error::Device`].
    pub(super) fn new(
        gpu: &Gpu,
        effects: Effects,
        stack: u32,
        size: [u32; 2],
        spp: u32,
        settings: Reproject,
    ) -> Result<Self> {
        entry::check(&settings.entries())?;
        let (pixels, cells) = (size[0] * size[1], size.map(|n| n.div_ceil(CELL)));
        Self::check_room(gpu, pixels)?;
        let (thread, traverse) = (gpu.tuning().thread(), traverse::Constants { stack });
        let room = |on: bool| if on { pixels as usize } else { 1 };
        let none = |name: &str| Buffer::from_slice(gpu, name, &[]);
        Ok(Self {
            remember: Kernel::new(gpu, &shaders::remember::Constants { effects, thread, traverse })?,
            project: Kernel::new(gpu, &shaders::project::Constants { effects, thread, traverse })?,
            carry: Kernel::new(gpu, &shaders::carry::Constants { effects, thread, traverse })?,
            records: Buffer::new(gpu, "history", room(true), Location::Device)?,
            light: Buffer::new(gpu, "history of light", room(effects.split_light), Location::Device)?,
            offered: Buffer::from_slice(gpu, "offered samples", &vec![0; pixels as usize])?,
            carried: Buffer::from_slice(gpu, "carried samples", &vec![0; pixels as usize])?,
            previous: Buffer::from_slice(gpu, "previous camera", &[Camera::default()])?,
            probe: Kernel::new(
                gpu,
                &shaders::probe::Constants { effects, thread, traverse, deal: deal::Constants::default() },
            )?,
            light_change: Kernel::new(gpu, &thread.into())?,
            cells,
            probes: Buffer::new(gpu, "probes", 1, Location::Device)?,
            changes: [none("changes of light")?, none("changes of light")?],
            lights: [Buffer::from_slice(gpu, "lights", &[])?, Buffer::from_slice(gpu, "lights", &[])?],
            light_table: Buffer::from_slice(gpu, "light_table", &[])?,
            relit: None,
            instance_now: Buffer::from_slice(gpu, "instances now", &[])?,
            triangle_now: Buffer::from_slice(gpu, "triangles now", &[])?,
            probe_seed: 0,
            numbered: [false; 2],
            changed: AtomicBool::new(false),
            settings,
            spp,
        })
    }

    /// Makes room for what changes besides the camera, once.
    pub(super) fn follow(&mut self, gpu: &Gpu) -> Result<()> {
        let cells = (self.cells[0] * self.cells[1]) as usize;
        if self.probes.len() < cells {
            let changes = || Buffer::new(gpu, "changes of light", cells, Location::Device);
            self.changes = [changes()?, changes()?];
            self.probes = Buffer::new(gpu, "probes", cells, Location::Device)?;
        }
        Ok(())
    }

    /// Notes that more than the camera changes, after a frame of these constants and this first sample.
    pub(super) fn note(&mut self, change: &Change, relit: Option<&Relit>, c: &PathConstants, first_sample: u32) {
        self.numbered = [&change.instance_now, &change.triangle_now].map(|now| !now.is_empty());
        self.probe_seed = pcg(pcg(!c.seed).wrapping_add(first_sample));
        self.relit = relit.map(|relit| PathConstants {
            light_count: relit.table.len() as u32,
            environment: relit.environment,
            triangle_pdf_scale: c.triangle_pdf_scale * relit.pdf_scale,
            ..PathConstants::default()
        });
        self.changed.store(true, Relaxed);
    }

    /// What the paths of probes are told, before the scene changes as after it.
    pub(super) fn probe_constants(&self, frame: &PathConstants) -> PathConstants {
        let own = PathConstants { seed: self.probe_seed, ..*frame };
        self.relit.map_or(own, |relit| PathConstants {
            light_count: relit.light_count,
            environment: relit.environment,
            triangle_pdf_scale: relit.triangle_pdf_scale,
            ..own
        })
    }

    /// What they bind of a scene.
    pub(super) fn probe_scene<'a>(&'a self, scene: &'a DeviceScene, after: bool) -> scene::Bind<'a> {
        match self.relit {
            None => scene.bind(),
            Some(_) => {
                scene::Bind { lights: &self.lights[usize::from(after)], light_table: &self.light_table, ..scene.bind() }
            }
        }
    }

    /// Whether more than the camera has changed since the last frame.
    pub(super) fn has_changed(&self) -> bool {
        self.changed.load(Relaxed)
    }

    /// Notes that a frame has begun with what there is now.
    pub(super) fn settle(&self) {
        self.changed.store(false, Relaxed);
    }

    /// How light had changed in each cell of 4x4 pixels of the last frame at the last [`Step::Reproject`](super::Step::Reproject) that followed a
    /// change of more than the camera.
    pub fn light_change(&self) -> &Buffer<LightChange> {
        &self.changes[1]
    }

    /// The error that one part of a pixel's word stands for.
    pub(super) fn error_part(&self) -> f32 {
        self.settings.reproject_error.max(1e-30) / ERROR_PARTS as f32
    }

    /// What its kernels are told of pixels from `first_pixel` on.
    pub(super) fn push(&self, constants: &PathConstants, first_pixel: u32, pixels: u32) -> ReprojectPush {
        let [instances, triangles] = self.numbered.map(u32::from);
        let Reproject { reproject_error, reproject_aliasing, reproject_samples, reproject_age } = self.settings;
        ReprojectPush {
            size: constants.size,
            first_pixel,
            pixels,
            max_error: reproject_error,
            aliasing: reproject_aliasing,
            max_samples: reproject_samples,
            max_age: reproject_age,
            spp: self.spp,
            moved: self.has_changed().into(),
            instances,
            triangles,
            ..Default::default()
        }
    }
}
