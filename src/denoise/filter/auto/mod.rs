//! Per pixel, the blend of candidates with the least estimated error: it spares the user the sweep. Kernels:
//! `glsl/auto/*.comp`.
mod reference;
mod residual;
mod smoothing;

pub use reference::estimated;
use smoothing::Smoothing;

use super::atrous_taps::threads;
use super::edge::{EdgeSettings, Rates};
use super::guided::{self, Channels, GuidedSums, Packed, Windows};
use super::noise_estimate::Estimate;
use super::pack::Pack;
use super::svgf::Levels;
use super::{Filter, FilterSettings, Planes, Row};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{AutoPush, PixelLight, vec2, vec3, vec4};
use crate::shaders::shared::{own_variance, sampled_albedo};
use crate::shaders::{auto, auto_error, auto_inputs, auto_leverage, auto_residual};
use crate::threads::{both, each};

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "auto",
    about: "per pixel the best blend of none, guided by wide, middle and narrow windows, and svgf, by estimated error",
    // The packs', three windows', what four candidates make, two estimates, two for levels of svgf, errors and smoothed ones, three
    // of what is dim or probed, leverages and their surroundings; leverages of narrow windows, surfaces of cells, expected errors.
    bytes: super::pack::BYTES + 32 + 3 * (guided::ROW.bytes - 32) + (4 + 2 + 2 + 3 + 3 + 3 + 2) * 16 + 4 + 4 + 12,
    weighs_noise: true,
    make: |gpu, settings, size| Ok(Box::new(Auto::new(gpu, settings, size)?)),
    reference: reference::reference,
};

/// The filters beside none, found by searching thirteen noisy images of six scenes for what leaves `auto` nearest to the best
/// filter of each. At their defaults: windows of 65 pixels and normals alone, in which a few bright samples are spread; windows
/// of 33 and of 9 pixels, both held more tightly than alone, depth above all; and 3 levels of `svgf`, which light and positions
/// hold more tightly and normals hardly.
fn candidates(s: &FilterSettings) -> [FilterSettings; 4] {
    let windows = |radius: u32, eps: vec4| {
        s.with(|s| {
            s.footprint.radius = radius;
            s.guided.eps = eps;
            s.guided.sums = GuidedSums::Blocks;
        })
    };
    let [x, y, z, w] = s.guided.eps;
    let tight = |depth: f32| [0.1 * x, 0.1 * y, 0.1 * z, depth * w];
    let (sigma_l, sigma_n, sigma_x) = (0.75 * s.svgf.sigma_l, 4.0 * s.edge.sigma_n, 0.6 * s.edge.sigma_x);
    [
        windows((4 * s.footprint.radius).div_ceil(3), [x, y, z, UNUSED]),
        windows((2 * s.footprint.radius).div_ceil(3), tight(5e-3)),
        // Fewer than 5 x 5 pixels do not determine a model of four channels: little of a pixel is left to judge it by.
        windows(s.footprint.radius.div_ceil(6).max(2), tight(5e-5)),
        s.with(|s| {
            s.footprint.levels = s.footprint.levels.min(3);
            s.svgf.sigma_l = sigma_l;
            s.edge.sigma_n = sigma_n;
            s.edge.sigma_x = sigma_x;
        }),
    ]
}

/// What all windows are guided by. Light that was not divided by the albedo follows it as well.
fn guide_of_windows(settings: &FilterSettings) -> Channels {
    Channels::new(settings.guided.channels, settings.edge.extent).with_albedo()
}

/// Pixels of the narrow window over those of the wide and of the middle one.
fn shares(s: &FilterSettings) -> vec2 {
    let [wide, middle, narrow, _] = candidates(s).map(|s| (2 * s.footprint.radius + 1) as f32);
    [wide, middle].map(|edge| (narrow / edge).powi(2))
}

/// Eps of a channel that no model shall have a slope along: the same guide serves all windows.
const UNUSED: f32 = 1e30;

/// What counts as one surface to the estimates of errors.
fn alike(s: &EdgeSettings) -> EdgeSettings {
    EdgeSettings { sigma_n: 2.5 * s.sigma_n, sigma_x: 1.2 * s.sigma_x, ..*s }
}

/// Luminance below which errors count as absolute: a tenth of what is usual, not a share of the brightest. Beside lamps that are
/// seen in a gloss, all else would count as dark (Veach's plates at 2 samples: FLIP .098 instead of .076).
fn floor(settings: &FilterSettings) -> f32 {
    (0.1 * settings.edge.usual).clamp(1e-30, 1e24)
}

struct Auto {
    pack: Pack,
    estimate: Estimate,
    inputs: Kernel<auto_inputs::Bind<'static>>,
    leverage: Kernel<auto_leverage::Bind<'static>>,
    error: Kernel<auto_error::Bind<'static>>,
    smoothing: Smoothing,
    /// Without and with a variance to read, each without and with the albedo of samples.
    blend: [Kernel<auto::Bind<'static>>; 4],
    no_variance: Buffer<vec3>,
    no_light: Buffer<PixelLight>,
    residual: Kernel<auto_residual::Bind<'static>>,
    /// What all windows read of the image.
    windows_pack: Packed,
    /// Wide, middle and narrow.
    windows: [Windows; 3],
    svgf: Levels,
    svgf_estimate: Estimate,
    /// What those four make of the image; narrow windows get the dim one.
    results: [Buffer<vec4>; 4],
    /// The image as the narrow windows get it, ordered as in `windows_pack`.
    dim: Buffer<vec4>,
    /// What the wide windows make of that.
    wide_dim: Buffer<vec4>,
    /// What svgf makes of the probe.
    svgf_probed: Buffer<vec4>,
    /// Squares and products of what is missed: see `glsl/auto/auto_error.comp`. The first holds the probe before, the blend after.
    planes: [Buffer<vec4>; 3],
    /// The same, smoothed.
    smoothed: [Buffer<vec4>; 3],
    /// What neighbours tell of noise, and leverages: see `glsl/auto/auto_leverage.comp`.
    leverages: Buffer<vec4>,
    /// The same, smoothed.
    surroundings: Buffer<vec4>,
    /// See [`Filter::expected`].
    expected: Buffer<vec3>,
    settings: FilterSettings,
}

impl Auto {
    fn new(gpu: &Gpu, settings: &FilterSettings, size: [u32; 2]) -> Result<Self> {
        let pack = Pack::new(gpu, size)?;
        let pixels = pack.colour.len();
        let plane = |name| Buffer::new(gpu, name, pixels, Location::Device);
        let [wide, middle, narrow, of_svgf] = candidates(settings);
        let windows_pack = Packed::new(gpu, guide_of_windows(settings), size)?;
        let surfaces = Rates::of_surfaces(&settings.edge).constants();
        let local_size_x = gpu.tuning().filter_workgroup;
        let windows =
            |(s, leverages): (&FilterSettings, _)| Windows::new(gpu, s.footprint.radius, s.guided.eps, leverages, size);
        let windows = || each([(&wide, false), (&middle, false), (&narrow, true)], windows);
        let smoothing = || Smoothing::new(gpu, &settings.edge, size);
        let levels = || Levels::new(gpu, &of_svgf.edge, &of_svgf.svgf, of_svgf.footprint.levels, size, true);
        let estimate = |(edge, cautious)| Estimate::new(gpu, edge, cautious, size);
        let estimates = || each([(&settings.edge, true), (&of_svgf.edge, false)], estimate);
        let blend = |[measured, has_light]: [bool; 2]| {
            let own_variance = own_variance::Constants { measured };
            let sampled_albedo = sampled_albedo::Constants { has_light };
            Kernel::new(gpu, &auto::Constants { own_variance, sampled_albedo, ..Default::default() })
        };
        let blends = || each([[false, false], [false, true], [true, false], [true, true]], blend);
        let residual = || Kernel::new(gpu, &auto_residual::Constants { edge: surfaces, local_size_x });
        let ((windows, smoothing), ((svgf, [estimate, svgf_estimate]), (blend, residual))) =
            both(|| both(windows, smoothing), || both(|| both(levels, estimates), || both(blends, residual)))?;
        Ok(Self {
            inputs: Kernel::new(gpu, &Default::default())?,
            leverage: Kernel::new(gpu, &auto_leverage::Constants { edge: surfaces, ..Default::default() })?,
            error: Kernel::new(gpu, &Default::default())?,
            no_variance: Buffer::from_slice(gpu, "no variance", &[])?,
            no_light: Buffer::new(gpu, "no light", 1, Location::Device)?,
            results: [plane("wide")?, plane("middle")?, plane("narrow")?, plane("svgf")?],
            dim: Buffer::new(gpu, "dim", windows_pack.colour.len(), Location::Device)?,
            wide_dim: plane("wide, dim")?,
            svgf_probed: plane("svgf, probed")?,
            planes: [plane("probe, squared errors, blend")?, plane("products of errors")?, plane("other errors")?],
            smoothed: [plane("smoothed errors")?, plane("smoothed products")?, plane("smoothed others")?],
            windows_pack,
            leverages: plane("leverages")?,
            surroundings: plane("smoothed leverages")?,
            expected: Buffer::new(gpu, "expected errors", pixels, Location::Device)?,
            settings: *settings,
            pack,
            windows,
            smoothing,
            svgf,
            estimate,
            svgf_estimate,
            blend,
            residual,
        })
    }

    /// For an image of this size.
    fn push(&self, size: [u32; 2]) -> AutoPush {
        AutoPush {
            size,
            floor: floor(&self.settings),
            rates: Rates::of_surfaces(&self.settings.edge).as_array(),
            shares: shares(&self.settings),
            ..Default::default()
        }
    }

    /// What every candidate makes of the image, and how much of it each keeps.
    fn record_candidates(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let ([wide, middle, narrow], size, count) = (&self.windows, planes.size, planes.pixels());
        let push = self.push(size);
        let [of_wide, of_middle, of_narrow, of_svgf] = &self.results;
        let Packed { colour, channels, .. } = &self.windows_pack;
        let (estimate, probe) = (&self.svgf_estimate.plane, &self.planes[0]);
        self.windows_pack.record(rec, planes)?;
        wide.record(rec, size, [colour, channels], of_wide)?;
        self.svgf_estimate.record(rec, planes, &self.pack)?;
        let bind =
            auto_inputs::Bind { colour: &self.pack.colour, wide: of_wide, estimate, dim: &self.dim, probed: probe };
        rec.dispatch_threads(&self.inputs, bind, &push, count)?;
        wide.record(rec, size, [&self.dim, channels], &self.wide_dim)?;
        middle.record(rec, size, [colour, channels], of_middle)?;
        narrow.record(rec, size, [&self.dim, channels], of_narrow)?;
        self.svgf.record(rec, size, &self.pack, &[[estimate, of_svgf], [probe, &self.svgf_probed]])?;
        let bind = auto_leverage::Bind {
            wide: of_wide,
            svgf: of_svgf,
            narrow: &narrow.leverages,
            probed: &self.svgf_probed,
            packed_pixels: self.pack.bind(),
            estimate: &self.estimate.plane,
            leverages: &self.leverages,
        };
        rec.dispatch_threads(&self.leverage, bind, &push, count)
    }

    fn record_errors(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let [wide, mid, narrow, svgf] = &self.results;
        let [squares, products, others] = &self.planes;
        let bind = auto_error::Bind {
            estimate: &self.estimate.plane,
            colour: &self.pack.colour,
            wide,
            mid,
            narrow,
            wide_dim: &self.wide_dim,
            svgf,
            leverages: &self.leverages,
            surroundings: &self.surroundings,
            squares,
            products,
            others,
        };
        rec.dispatch_threads(&self.error, bind, &self.push(planes.size), planes.pixels())
    }

    /// The blend lies where what it is made by has come from.
    fn blended(&self) -> &Buffer<vec4> {
        &self.planes[0]
    }

    /// The blend, and what it has lost -> output\[P\]
    fn record_residual(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let bind = auto_residual::Bind {
            packed_pixels: self.pack.bind(),
            estimate: &self.estimate.plane,
            others: &self.smoothed[2],
            blend: self.blended(),
            guide: &planes.guide,
            filtered: &planes.output,
        };
        rec.dispatch(&self.residual, bind, &self.push(planes.size), self.residual.groups(threads(planes.size, 1)))
    }
}

impl Filter for Auto {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        self.estimate.record(rec, planes, &self.pack)?;
        self.record_candidates(rec, planes)?;
        let (smoothing, errors, smoothed) = (&self.smoothing, self.planes.each_ref(), self.smoothed.each_ref());
        smoothing.record_cells(rec, &self.pack, planes.size)?;
        let of_leverages = [&self.leverages, smoothed[0], &self.surroundings].map(|plane| [plane; 3]);
        smoothing.record(rec, &self.pack, planes.size, of_leverages, false)?;
        self.record_errors(rec, planes)?;
        smoothing.record(rec, &self.pack, planes.size, [errors, errors, smoothed], true)?;
        let [squares, products, others] = smoothed;
        let [wide, mid, narrow, svgf] = &self.results;
        let bind = auto::Bind {
            squares,
            products,
            others,
            colour: &self.pack.colour,
            place: &self.pack.place,
            wide,
            mid,
            narrow,
            wide_dim: &self.wide_dim,
            svgf,
            variance: planes.variance.as_ref().unwrap_or(&self.no_variance),
            surroundings: &self.surroundings,
            leverages: &self.leverages,
            blend: self.blended(),
            expected: &self.expected,
            estimate: &self.estimate.plane,
            guide: &planes.guide,
            sampled_albedo: sampled_albedo::Bind { light: planes.light.as_ref().unwrap_or(&self.no_light) },
        };
        let blend = &self.blend[2 * usize::from(planes.variance.is_some()) + usize::from(planes.light.is_some())];
        rec.dispatch_threads(blend, bind, &self.push(planes.size), planes.pixels())?;
        self.record_residual(rec, planes)
    }

    fn expected(&self) -> Option<&Buffer<vec3>> {
        Some(&self.expected)
    }
}
