//! Filtered frames: what a renderer leaves in its buffers goes through a filter in the same command buffer. Kernels:
//! `glsl/film/demodulate.comp` and `glsl/film/remodulate.comp`. Twin: [`composition`](crate::denoise::composition).
use crate::denoise::composition::Demodulation;
use crate::denoise::filter::{self, Filter, FilterSettings, Planes, Row};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Kernel, Location, PixelFormat, Recorder};
use crate::layout::{PixelLight, PixelStats, SplitPush, vec4};
use crate::render::{OutputView, Renderer};
use crate::shaders::{demodulate, remodulate};

/// A filter over the films of one renderer. Everything is created in [`Denoiser::new`], nothing later.
pub struct Denoiser {
    split: Kernel<demodulate::Bind<'static>>,
    filter: Box<dyn Filter>,
    join: Kernel<remodulate::Bind<'static>>,
    stats: Buffer<PixelStats>,
    light: Buffer<PixelLight>,
    planes: Planes,
    factor: Buffer<vec4>,
    sharp: Buffer<vec4>,
    picture: Buffer<vec4>,
}

impl Denoiser {
    /// Compiles a row of [`FILTERS`](crate::denoise::filter::FILTERS) for the films of `renderer`, which was made with
    /// [`Outputs::guides`](crate::render::Outputs::guides), and for [`Demodulation::Light`] with
    /// [`Outputs::split_light`](crate::render::Outputs::split_light). Distances in the settings
    /// are in units of `extent`: give the diagonal of [`Scene::bounds`](crate::scene::Scene::bounds), or of what is seen;
    /// `sigma_rt` is in units of `intensity`: give the radiance of what is white in your frames.
    ///
    /// # Errors
    /// [`Error::Usage`] for settings out of range and for a renderer without what the filter needs, [`Error::Device`] when
    /// the film is too large for the device's bindings.
    pub fn new(
        gpu: &Gpu,
        renderer: &Renderer,
        row: &Row,
        settings: &FilterSettings,
        demodulation: Demodulation,
    ) -> Result<Self> {
        settings.validate()?;
        check(renderer, demodulation)?;
        let (film, size) = (&renderer.film().tiles[0], [renderer.settings().width, renderer.settings().height]);
        filter::check_size(gpu, size, filter::GUIDE_TEXELS)?;
        let pixels = film.pixels as usize;
        let plane = |name| Buffer::new(gpu, name, pixels, Location::Device);
        let planes = Planes {
            size,
            radiance: plane("radiance")?,
            guide: film.guide.clone(),
            variance: Some(Buffer::new(gpu, "variance", pixels, Location::Device)?),
            output: plane("filtered")?,
        };
        Ok(Self {
            split: Kernel::new(
                gpu,
                &demodulate::Constants { demodulation: demodulation as u32, ..Default::default() },
            )?,
            filter: row.compile(gpu, settings, size)?,
            join: Kernel::new(gpu, &remodulate::Constants::default())?,
            stats: film.stats.clone(),
            light: film.light.clone(),
            planes,
            factor: plane("factor")?,
            sharp: plane("sharp")?,
            picture: plane("picture")?,
        })
    }

    /// stats\[P\], light\[P\], guide\[P\] -> picture\[P\]: to be recorded behind the renderer's steps. The renderer's own
    /// radiance stays as it is.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn record(&self, rec: &mut Recorder) -> Result<()> {
        let (push, planes) = (SplitPush { size: self.planes.size, ..Default::default() }, &self.planes);
        let bind = demodulate::Bind {
            stats: &self.stats,
            light: &self.light,
            guide: &planes.guide,
            radiance: &planes.radiance,
            variance: planes.variance.as_ref().expect("made with one"),
            factor: &self.factor,
            sharp: &self.sharp,
        };
        rec.dispatch_threads(&self.split, bind, &push, planes.pixels())?;
        self.filter.record(rec, planes)?;
        let bind = remodulate::Bind {
            filtered: &planes.output,
            factor: &self.factor,
            sharp: &self.sharp,
            picture: &self.picture,
        };
        rec.dispatch_threads(&self.join, bind, &push, planes.pixels())
    }

    /// Filtered linear radiance (Rec. 709), 4 floats a pixel, the last of them 1.
    pub fn radiance(&self) -> OutputView {
        OutputView {
            buffer: self.picture.raw(),
            offset: 0,
            stride: size_of::<vec4>() as u32,
            format: PixelFormat::R32G32B32A32Sfloat,
            pixels: self.planes.pixels(),
        }
    }

    /// The same, for reading back.
    pub fn picture(&self) -> &Buffer<vec4> {
        &self.picture
    }
}

/// Whether the renderer leaves what is needed.
fn check(renderer: &Renderer, demodulation: Demodulation) -> Result<()> {
    let (outputs, allocate) = (renderer.outputs(), &renderer.settings().allocate);
    let apart = demodulation != Demodulation::Light;
    let lacks = [
        (outputs.guides, "its guides: make the renderer with Outputs::guides"),
        (apart || outputs.split_light, "direct light apart: make the renderer with Outputs::split_light"),
        (
            apart || allocate.is_even() || allocate.min_spp > 0,
            "direct light where a pixel has no sample: set min_spp to 1 or more, or demodulate albedo alone",
        ),
        (renderer.film().tiles.len() == 1, "a film in one piece: choose a smaller one"),
    ];
    match lacks.iter().find(|(there, _)| !there) {
        Some((_, what)) => Err(Error::Usage(format!("a frame cannot be filtered without {what}"))),
        None => Ok(()),
    }
}
