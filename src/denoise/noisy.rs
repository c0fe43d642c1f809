//! A noisy image on the device, and what is known of its surfaces.
use super::{Demodulation, windows};
use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::layout::{Guide, PixelLight, PixelStats};
use crate::render::Renderer;
use crate::shaders::shared::noisy;

/// What the planes of a [`Noisy`] image hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Holds {
    /// [`PixelStats::count`] holds the bits of a float, and [`PixelStats::m2`] the variance of the mean.
    pub of_file: bool,
    /// [`Guide::albedo`] is known.
    pub albedo: bool,
    /// Direct and indirect light are kept apart.
    pub light: bool,
    /// The variance of the colour is known.
    pub variance: bool,
    /// The variance of indirect light is known.
    pub indirect_variance: bool,
    /// Direct light holds none of lamps and sky.
    pub sharp_direct: bool,
    /// It is known how far a lens blurs what each pixel shows.
    pub blur: bool,
    /// Distance along both axes between pixels whose indirect light is known: see
    /// [`Settings::indirect_stride`](crate::render::settings::Settings::indirect_stride).
    pub indirect_stride: u32,
}

impl Holds {
    /// What a renderer leaves.
    pub fn film(split_light: bool, sharp_direct: bool, blur: bool, indirect_stride: u32) -> Self {
        Self {
            of_file: false,
            albedo: true,
            light: split_light,
            variance: true,
            indirect_variance: split_light,
            sharp_direct,
            blur,
            indirect_stride,
        }
    }

    /// What is best kept away from a filter: direct light of the key light, whose shadows are sharp and no
    /// guide shows them. Other lights leave noise in direct light: where it holds any of theirs, it is filtered with all the rest.
    pub fn usual_demodulation(&self) -> Demodulation {
        self.demodulation(if self.sharp_direct { Demodulation::Light } else { Demodulation::Albedo })
    }

    /// What of `wanted` the planes allow. Pixels without indirect light have some of their light alone, which does not count as all.
    pub fn demodulation(&self, wanted: Demodulation) -> Demodulation {
        match wanted {
            _ if !self.albedo => Demodulation::Off,
            _ if self.light && self.indirect_stride > 1 => Demodulation::Light,
            Demodulation::Light if !self.light => Demodulation::Albedo,
            wanted => wanted,
        }
    }

    /// For kernels that read the planes.
    pub(super) fn constants(&self) -> noisy::Constants {
        noisy::Constants { of_file: self.of_file, has_light: self.light }
    }

    /// Whether the variance of what is filtered is known.
    pub fn variance_of_filtered(&self, demodulation: Demodulation) -> bool {
        self.variance || (demodulation == Demodulation::Light && self.indirect_variance)
    }
}

/// A noisy image: radiance with its samples and what is known of the surfaces behind it, row-major. It is the film of a
/// renderer, where it lies ([`Noisy::of_film`]), or comes from a file ([`super::file::Layers::upload`]).
pub struct Noisy {
    /// Width and height in pixels.
    pub size: [u32; 2],
    pub(super) stats: Buffer<PixelStats>,
    /// One element where direct and indirect light are not kept apart.
    pub(super) light: Buffer<PixelLight>,
    pub(super) guide: Buffer<Guide>,
    /// One element where no lens blurs anything.
    pub(super) blur: Buffer<f32>,
    pub(super) holds: Holds,
}

impl Noisy {
    /// The film of `renderer`, which was made with [`Outputs::guides`](crate::render::Outputs::guides). Nothing is copied: it is
    /// what the renderer's steps leave there, and outlives the renderer.
    ///
    /// # Errors
    /// [`Error::Usage`] for a renderer without guides, and for a film in more than one piece.
    pub fn of_film(renderer: &Renderer) -> Result<Self> {
        let (outputs, settings, tiles) = (renderer.outputs(), renderer.settings(), &renderer.film().tiles);
        let lacks = [
            (outputs.guides, "its guides: make the renderer with Outputs::guides"),
            (outputs.split_light || settings.indirect_stride == 1, "direct light apart: set Outputs::split_light"),
            (tiles.len() == 1, "a film in one piece: choose a smaller one"),
        ];
        if let Some((_, what)) = lacks.iter().find(|(there, _)| !there) {
            return Err(Error::Usage(format!("a frame cannot be filtered without {what}")));
        }
        Ok(Self {
            size: settings.size(),
            stats: tiles[0].stats.clone(),
            light: tiles[0].light.clone(),
            blur: tiles[0].blur.clone(),
            guide: if tiles[0].has_seen() { &tiles[0].seen } else { &tiles[0].guide }.clone(),
            holds: Holds::film(
                outputs.split_light,
                renderer.sharp_direct(),
                tiles[0].has_blur(),
                settings.indirect_stride,
            ),
        })
    }

    /// What the kernels bind that take it apart.
    pub(super) fn bind(&self) -> noisy::Bind<'_> {
        noisy::Bind { stats: &self.stats, light: &self.light, guide: &self.guide }
    }

    /// What the planes hold.
    pub fn holds(&self) -> Holds {
        self.holds
    }

    /// Whether direct light, which is kept apart, is missing or no number somewhere: such pixels take it from the others.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn lacks_direct_light(&self) -> Result<bool> {
        for window in windows(self.stats.len()) {
            let (stats, light) = (self.stats.read_range(window.clone())?, self.light.read_range(window)?);
            // A count of zero is 0 as a float, too.
            let unlit = |(s, l): (&PixelStats, &PixelLight)| s.count == 0 || !l.direct.iter().all(|v| v.is_finite());
            if stats.iter().zip(&light).any(unlit) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
