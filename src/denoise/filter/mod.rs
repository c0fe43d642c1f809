//! Reconstructing the light between the samples. A filter is a row of [`FILTERS`]: a Rust file that records its kernels
//! and has their CPU twin, and GLSL files of the same names.
mod as_light;
mod atrous;
mod atrous_taps;
mod auto;
mod bilateral;
mod edge;
pub mod firefly;
mod footprint;
mod guided;
mod input;
mod method;
mod noise_estimate;
mod none;
pub(super) mod oidn;
mod pack;
pub(super) mod pixel;
mod readers;
mod scales;
mod settings;
mod svgf;
mod wavelet;

pub use atrous::{AtrousForm, AtrousOverrides, AtrousSettings};
#[doc(hidden)]
pub use auto::estimated;
pub use edge::{EdgeOverrides, EdgeSettings};
pub use footprint::{FootprintOverrides, FootprintSettings};
pub use guided::{GuidedOverrides, GuidedSettings, GuidedSums};
pub use input::FilterInput;
pub use method::Method;
pub(crate) use method::missing_light;
pub use oidn::{OidnOverrides, OidnQuality, OidnSettings};
pub use readers::readers;
pub use scales::Scales;
pub use settings::{FilterOverrides, FilterSettings};
pub use svgf::{SvgfOverrides, SvgfSettings};
pub use wavelet::{WaveletBasis, WaveletOverrides, WaveletSettings};

use crate::error::{Error, Result};
use crate::gpu::{Buffer, FrameResources, Gpu, Location, PassTime, Recorder};
use crate::layout::{Guide, PixelLight, vec3, vec4};

/// Every filter of our own, in the order of `--help`; the twin and stability tests run each row.
pub const FILTERS: &[&Row] =
    &[&none::ROW, &atrous::ROW, &bilateral::ROW, &guided::ROW, &wavelet::ROW, &svgf::ROW, &auto::ROW];

/// Compiles a filter's kernels and makes its own buffers, for images of (width, height) that [`check_size`] has seen.
type Make = fn(&Gpu, &FilterSettings, [u32; 2]) -> Result<Box<dyn Filter>>;

/// One filter.
pub struct Row {
    /// What a user types.
    pub name: &'static str,
    /// One line of help.
    pub about: &'static str,
    /// Bytes of device memory a pixel that its own buffers take, beside the [`Planes`].
    pub(crate) bytes: u64,
    /// Whether it changes light by no more than its noise. Others would spread sunlight and sky beyond what the lens blurs of them.
    pub(crate) weighs_noise: bool,
    /// On a device: see [`Row::compile`].
    pub(crate) make: Make,
    /// The same on the host, in plain Rust.
    pub reference: fn(&FilterInput, &FilterSettings) -> Vec<vec4>,
}

impl Row {
    /// Compiles the filter's kernels and makes its own buffers, for images of (width, height).
    ///
    /// # Errors
    /// [`Error::Usage`] for settings out of range and images without a pixel, [`Error::Device`] when the images are too
    /// large.
    pub fn compile(&self, gpu: &Gpu, settings: &FilterSettings, size: [u32; 2]) -> Result<Box<dyn Filter>> {
        settings.validate()?;
        if size.contains(&0) {
            return Err(Error::Usage(format!("an image of {} x {} has no pixel to filter", size[0], size[1])));
        }
        check_size(gpu, size)?;
        Ok(Box::new(Fitted { filter: (self.make)(gpu, settings, size)?, size }))
    }
}

/// A filter that takes images of its own size alone.
struct Fitted {
    filter: Box<dyn Filter>,
    size: [u32; 2],
}

impl Filter for Fitted {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let pixels = self.size[0] as usize * self.size[1] as usize;
        let variance = planes.variance.as_ref().map_or(pixels, Buffer::len);
        let lengths = [planes.radiance.len(), planes.guide.len(), variance, planes.output.len()];
        if planes.size != self.size || lengths.iter().any(|&length| length != pixels) {
            let (size, own) = (planes.size, self.size);
            return Err(Error::Usage(format!(
                "planes of {size:?} with {lengths:?} pixels (radiance, guide, variance, output): the filter was made for \
                 {own:?}"
            )));
        }
        if planes.radiance.raw().handle == planes.output.raw().handle {
            let what =
                "radiance and output are one buffer: filters read neighbours, give the output a buffer of its own";
            return Err(Error::Usage(what.to_owned()));
        }
        self.filter.record(rec, planes)
    }

    fn expected(&self) -> Option<&Buffer<vec3>> {
        self.filter.expected()
    }
}

/// A filter on a device, for one size and one set of settings.
pub trait Filter: Send + Sync {
    /// radiance\[P\], guide\[P\], variance\[P\] -> output\[P\]
    ///
    /// # Errors
    /// [`Error::Usage`] for planes of another size, and for an output that is the radiance; [`Error::Device`] when the image is too large
    /// for the device.
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()>;

    /// Where the filter estimates its own error, what its last run left there: of each pixel the mean squared error of what came
    /// out over its square, and the share of the variance of its samples that is noise.
    fn expected(&self) -> Option<&Buffer<vec3>> {
        None
    }
}

/// The images a filter reads and the one it writes, row-major. What they hold is said at [`FilterInput`].
pub struct Planes {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// rgb, and the samples behind it.
    pub radiance: Buffer<vec4>,
    /// Centre-ray hits.
    pub guide: Buffer<Guide>,
    /// Holds the mean albedo of the samples of every pixel that has any.
    pub light: Option<Buffer<PixelLight>>,
    /// Variance of each pixel's mean, where it is known.
    pub variance: Option<Buffer<vec3>>,
    /// rgb, and the samples behind it: 1 where a pixel was in-painted, 0 where nothing reached it. A buffer of its own.
    pub output: Buffer<vec4>,
}

impl Planes {
    /// Copies `input` to the device.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when it does not fit.
    pub fn new(gpu: &Gpu, input: &FilterInput) -> Result<Self> {
        let variance = input.variance.as_ref();
        Ok(Self {
            size: input.size(),
            radiance: Buffer::from_slice(gpu, "radiance", &input.radiance)?,
            guide: Buffer::from_slice(gpu, "guide", &input.guide)?,
            light: None,
            variance: variance.map(|v| Buffer::from_slice(gpu, "variance", v)).transpose()?,
            output: Buffer::new(gpu, "filtered", input.radiance.len(), Location::Device)?,
        })
    }

    /// Pixels.
    pub fn pixels(&self) -> u32 {
        self.size[0].saturating_mul(self.size[1])
    }
}

/// The row of this name.
pub fn find(name: &str) -> Option<&'static Row> {
    FILTERS.iter().copied().find(|row| row.name == name)
}

/// Texels of a pixel's guide, the widest plane that is read.
const GUIDE_TEXELS: u64 = (size_of::<Guide>() / 16) as u64;
const _: () = assert!(size_of::<Guide>().is_multiple_of(16), "kernels read guides in texels of 16 bytes");

/// Refuses images whose planes a binding cannot hold, and edges along which threads would walk longer than a software device lets them
/// (`glsl/shared/loop_limit.glsl`).
///
/// # Errors
/// [`Error::Device`].
pub fn check_size(gpu: &Gpu, [width, height]: [u32; 2]) -> Result<()> {
    let info = gpu.info();
    let most = (info.max_storage_range / size_of::<vec4>() as u64).min(info.max_texel_elements / GUIDE_TEXELS);
    let longest = gpu.tuning().longest_edge.min(most);
    // `guided` pads its rows.
    let padded = u64::from(width).next_multiple_of(8) * u64::from(height);
    match padded <= most && u64::from(width.max(height)) <= longest {
        true => Ok(()),
        false => Err(Error::Device(format!(
            "an image of {width} x {height} is too large to filter on this device: choose at most {most} pixels, with the \
             width counted up to a multiple of 8, and {longest} along an edge"
        ))),
    }
}

/// Filters one image: uploads it, runs `row` on it and reads the result; also what each pass took.
///
/// # Errors
/// [`crate::error::Error::Usage`] when the settings or the planes' sizes are wrong, [`crate::error::Error::Device`] when
/// the image is too large or the device fails.
pub fn run(gpu: &Gpu, row: &Row, input: &FilterInput, settings: &FilterSettings) -> Result<(Vec<vec4>, Vec<PassTime>)> {
    settings.validate()?;
    input.validate()?;
    check_size(gpu, input.size())?; // before anything is uploaded
    let planes = Planes::new(gpu, input)?;
    let filter = row.compile(gpu, settings, planes.size)?;
    let times = gpu.run(&mut FrameResources::new(gpu)?, |rec| filter.record(rec, &planes))?;
    Ok((planes.output.read()?, times))
}
