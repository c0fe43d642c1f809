//! What is kept from frame to frame: the samples of each pixel, and the points of the scene that they are of.
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Kernel, Location};
use crate::layout::{Camera, Effects, History as Record, HistoryLight, PathConstants, ReprojectPush};
use crate::settings::{FROM_0, entry, settings};
use crate::shaders;
use crate::shaders::shared::history::{MOST_CARRIED, *};
use crate::shaders::shared::traverse;
use serde::Serialize;

settings! {
    /// Which samples of a frame are carried to the next.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct Reproject {
        /// The settings of [`Reproject`] that are given; the others are `None`.
        ReprojectOverrides {
            /// Largest error by the changed view that carried samples may have, in units of radiance.
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
/// direct and indirect light are kept apart.
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
    settings: Reproject,
    spp: u32,
}

impl History {
    /// Bytes of a pixel, the point of its first hit included.
    pub fn bytes_per_pixel(split_light: bool) -> usize {
        let light = if split_light { size_of::<HistoryLight>() } else { 0 };
        size_of::<Record>() + 2 * size_of::<u32>() + size_of::<crate::layout::SurfacePoint>() + light
    }

    /// For a film of `pixels` pixels, which get `spp` samples a frame. `stack` is [`crate::scene::Scene::stack`].
    ///
    /// # Errors
    /// [`Error::Usage`] for a setting out of range and for a film that is too large, [`Error::Device`].
    pub(super) fn new(
        gpu: &Gpu,
        effects: Effects,
        stack: u32,
        pixels: u32,
        spp: u32,
        settings: Reproject,
    ) -> Result<Self> {
        entry::check(&settings.entries())?;
        let most = u64::from(MOST_PIXELS).min(gpu.info().max_storage_range / size_of::<u32>() as u64);
        if u64::from(pixels) > most {
            return Err(Error::Usage(format!(
                "a film of {pixels} pixels is too large to reproject on this device: choose at most {most} pixels"
            )));
        }
        let (thread, traverse) = (gpu.tuning().thread(), traverse::Constants { stack });
        let room = |on: bool| if on { pixels as usize } else { 1 };
        Ok(Self {
            remember: Kernel::new(gpu, &shaders::remember::Constants { effects, thread, traverse })?,
            project: Kernel::new(gpu, &shaders::project::Constants { effects, thread, traverse })?,
            carry: Kernel::new(gpu, &shaders::carry::Constants { effects, thread, traverse })?,
            records: Buffer::new(gpu, "history", room(true), Location::Device)?,
            light: Buffer::new(gpu, "history of light", room(effects.split_light), Location::Device)?,
            offered: Buffer::from_slice(gpu, "offered samples", &vec![0; pixels as usize])?,
            carried: Buffer::from_slice(gpu, "carried samples", &vec![0; pixels as usize])?,
            previous: Buffer::from_slice(gpu, "previous camera", &[Camera::default()])?,
            settings,
            spp,
        })
    }

    /// What its kernels are told of pixels from `first_pixel` on.
    pub(super) fn push(&self, constants: &PathConstants, first_pixel: u32, pixels: u32) -> ReprojectPush {
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
            moved: 0,
            ..Default::default()
        }
    }
}

/// How many samples of a pixel are carried, by its word in [`History::carried`].
pub fn carried_samples(word: u32) -> u32 {
    word & MOST_CARRIED
}

/// What became of the pixels at the start of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Carriage {
    /// Pixels of the new frame that begin with samples of the last.
    pub carried: u64,
    /// Pixels of the new frame that nobody offered any.
    pub new: u64,
    /// Pixels of the new frame at edges, which took none.
    pub new_edges: u64,
    /// Samples that the new frame begins with.
    pub samples: u64,
    /// Pixels of the last frame whose samples another pixel's were preferred to, or that lie at an edge of the new frame.
    pub lost: u64,
    /// Pixels of the last frame that show no surface.
    pub sky: u64,
    /// Those with a smooth or refractive surface.
    pub specular: u64,
    /// Those at an edge.
    pub edge: u64,
    /// Those whose samples have moved too many times.
    pub old: u64,
    /// Those whose point is outside the new film.
    pub outside: u64,
    /// Those whose point is hidden in the new frame.
    pub hidden: u64,
    /// Those that would look different from the new view.
    pub view: u64,
}

impl Carriage {
    /// Counts the words of both frames.
    pub fn of(offered: &[u32], carried: &[u32]) -> Self {
        let mut sum = Self::default();
        for &word in carried {
            match (carried_samples(word), word >> 16) {
                (0, DROPPED_EDGE) => sum.new_edges += 1,
                (0, _) => sum.new += 1,
                (n, _) => (sum.carried, sum.samples) = (sum.carried + 1, sum.samples + u64::from(n)),
            }
        }
        let offers = offered.iter().filter(|&&word| carried_samples(word) > 0).count() as u64;
        sum.lost = offers - sum.carried.min(offers);
        for &word in offered.iter().filter(|&&word| carried_samples(word) == 0) {
            let reason = match word >> 16 {
                DROPPED_SKY => &mut sum.sky,
                DROPPED_SPECULAR => &mut sum.specular,
                DROPPED_EDGE => &mut sum.edge,
                DROPPED_OLD => &mut sum.old,
                DROPPED_OUTSIDE => &mut sum.outside,
                DROPPED_HIDDEN => &mut sum.hidden,
                DROPPED_VIEW => &mut sum.view,
                _ => continue,
            };
            *reason += 1;
        }
        sum
    }
}
