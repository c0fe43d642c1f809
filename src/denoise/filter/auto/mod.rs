//! Per pixel, the blend of candidates with the least estimated error: it spares the user the sweep. Kernels:
//! `glsl/auto*.comp`.
mod reference;
mod residual;

pub use reference::estimated;

use super::atrous_taps::threads;
use super::edge::{EdgeSettings, Rates};
use super::noise_estimate::Estimate;
use super::pack::Pack;
use super::{Filter, FilterSettings, Planes, Row, guided, svgf};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{
    AutoBlendPush, AutoErrorPush, AutoLeveragePush, AutoPush, AutoResidualPush, AutoSmoothPush, vec2, vec3, vec4,
};
use crate::shaders::{auto, auto_error, auto_inputs, auto_leverage, auto_residual, auto_smooth};

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "auto",
    about: "per pixel the best blend of none, guided by wide, middle and narrow windows, and svgf, by estimated error",
    // The pack's, those of four candidates twice, of the estimate, three inputs, the dim one, leverages and their surroundings,
    // expected errors.
    bytes: super::pack::BYTES + (4 * 2 + 1 + 3 + 1 + 2) * 16 + 12 + 3 * guided::ROW.bytes + svgf::ROW.bytes,
    make: |gpu, settings, size| Ok(Box::new(Auto::new(gpu, settings, size)?)),
    reference: reference::reference,
};

/// Levels of smoothing of what is estimated, a footprint of 61 pixels. Even: see `Auto::record_smoothing`.
const SMOOTHING: u32 = 4;
/// How much the errors of one surface count for another, to the power of the level: neighbours fully, far pixels hardly. Where
/// surfaces are small, as in grass, others are all there is to learn from, and few pixels seem to prove filters that keep much.
const ACROSS: f32 = 0.4;

/// The filters beside none, found by searching thirteen noisy images of six scenes for what leaves `auto` nearest to the best
/// filter of each. At their defaults: windows of 65 pixels and normals alone, in which a few bright samples are spread; windows
/// of 33 and of 9 pixels, both held more tightly than alone, depth above all; and 3 levels of `svgf`, which light and positions
/// hold more tightly and normals hardly.
fn candidates(s: &FilterSettings) -> [(Row, FilterSettings); 4] {
    let windows = |radius: u32, depth: f32| {
        let [x, y, z, w] = s.guided.eps;
        s.with(|s| {
            s.footprint.radius = radius;
            s.guided.eps = [0.1 * x, 0.1 * y, 0.1 * z, depth * w];
        })
    };
    let (sigma_l, sigma_n, sigma_x) = (0.75 * s.svgf.sigma_l, 4.0 * s.edge.sigma_n, 0.6 * s.edge.sigma_x);
    [
        (
            guided::ROW,
            s.with(|s| {
                s.footprint.radius = (4 * s.footprint.radius).div_ceil(3);
                s.guided.channels = s.guided.channels.min(3);
            }),
        ),
        (guided::ROW, windows((2 * s.footprint.radius).div_ceil(3), 5e-3)),
        // Fewer than 5 x 5 pixels do not determine a model of four channels: little of a pixel is left to judge it by.
        (guided::ROW, windows(s.footprint.radius.div_ceil(6).max(2), 5e-5)),
        (
            svgf::ROW,
            s.with(|s| {
                s.footprint.levels = s.footprint.levels.min(3);
                s.svgf.sigma_l = sigma_l;
                s.edge.sigma_n = sigma_n;
                s.edge.sigma_x = sigma_x;
            }),
        ),
    ]
}

/// Pixels of the narrow window over those of the wide and of the middle one.
fn shares(s: &FilterSettings) -> vec2 {
    let [wide, middle, narrow, _] = candidates(s).map(|(_, s)| (2 * s.footprint.radius + 1) as f32);
    [wide, middle].map(|edge| (narrow / edge).powi(2))
}

/// What counts as one surface to the estimates of errors.
fn alike(s: &EdgeSettings) -> EdgeSettings {
    EdgeSettings { sigma_n: 2.5 * s.sigma_n, sigma_x: 1.2 * s.sigma_x, ..*s }
}

/// Weight of what is not alike.
fn least(level: u32, across: bool) -> f32 {
    if across { ACROSS.powi(level as i32) } else { 0.0 }
}

/// Luminance below which errors count as absolute: a tenth of what is usual, not a share of the brightest. Beside lamps that are
/// seen in a gloss, all else would count as dark (Veach's plates at 2 samples: FLIP .098 instead of .076).
fn floor(settings: &FilterSettings) -> f32 {
    (0.1 * settings.edge.usual).clamp(1e-30, 1e24)
}

/// A filter, and what it makes of its image and of a probe.
struct Candidate {
    filter: Box<dyn Filter>,
    result: Buffer<vec4>,
    kept: Buffer<vec4>,
}

impl Candidate {
    fn record(
        &self,
        rec: &mut Recorder,
        planes: &Planes,
        radiance: &Buffer<vec4>,
        output: &Buffer<vec4>,
    ) -> Result<()> {
        let (radiance, guide, variance) = (radiance.clone(), planes.guide.clone(), planes.variance.clone());
        let (size, output) = (planes.size, output.clone());
        self.filter.record(rec, &Planes { size, radiance, guide, light: None, variance, output })
    }
}

struct Auto {
    pack: Pack,
    estimate: Estimate,
    inputs: Kernel<auto_inputs::Bind<'static>>,
    leverage: Kernel<auto_leverage::Bind<'static>>,
    error: Kernel<auto_error::Bind<'static>>,
    /// Of leverages, and of errors.
    smooth: [Kernel<auto_smooth::Bind<'static>>; 2],
    /// Without and with a variance to read.
    blend: [Kernel<auto::Bind<'static>>; 2],
    nothing: Buffer<vec3>,
    residual: Kernel<auto_residual::Bind<'static>>,
    /// Wide, middle and narrow windows, svgf.
    candidates: [Candidate; 4],
    /// What candidates are run on besides the image: see `glsl/auto/auto_inputs.comp`. Then squares and products of what is missed:
    /// see `glsl/auto/auto_error.comp`.
    planes: [Buffer<vec4>; 3],
    /// What the wide window makes of what the narrow one gets.
    wide_dim: Buffer<vec4>,
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
        let candidate = |(row, settings): (Row, FilterSettings)| {
            let filter = (row.make)(gpu, &settings, size)?;
            Ok(Candidate { filter, result: plane("candidate")?, kept: plane("probed candidate")? })
        };
        let [wide, middle, narrow, svgf] = candidates(settings).map(candidate);
        let smooth = |three| {
            let edge = Rates::of_surfaces(&alike(&settings.edge)).constants();
            Kernel::new(gpu, &auto_smooth::Constants { edge, three })
        };
        let surfaces = Rates::of_surfaces(&settings.edge).constants();
        let blend = |measured| Kernel::new(gpu, &auto::Constants { measured, ..Default::default() });
        Ok(Self {
            estimate: Estimate::new(gpu, &settings.edge, true, size)?,
            inputs: Kernel::new(gpu, &Default::default())?,
            leverage: Kernel::new(gpu, &auto_leverage::Constants { edge: surfaces, ..Default::default() })?,
            error: Kernel::new(gpu, &Default::default())?,
            smooth: [smooth(false)?, smooth(true)?],
            blend: [blend(false)?, blend(true)?],
            nothing: Buffer::from_slice(gpu, "no variance", &[])?,
            residual: Kernel::new(gpu, &auto_residual::Constants { edge: surfaces })?,
            candidates: [wide?, middle?, narrow?, svgf?],
            planes: [
                plane("dim, squared errors")?,
                plane("signs, products of errors")?,
                plane("probed, other errors")?,
            ],
            wide_dim: plane("wide, dim")?,
            leverages: plane("leverages")?,
            surroundings: plane("smoothed leverages")?,
            expected: Buffer::new(gpu, "expected errors", pixels, Location::Device)?,
            settings: *settings,
            pack,
        })
    }

    /// What every candidate makes of the image, and how much of it each keeps.
    fn record_candidates(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let [wide, middle, narrow, svgf] = &self.candidates;
        let ([dim, signs, probed], count) = (&self.planes, planes.pixels());
        wide.record(rec, planes, &planes.radiance, &wide.result)?;
        let push = AutoPush { count, floor: floor(&self.settings), ..Default::default() };
        let bind = auto_inputs::Bind { colour: &self.pack.colour, wide: &wide.result, dim, signs, probed };
        rec.dispatch_threads(&self.inputs, bind, &push, count)?;
        wide.record(rec, planes, dim, &self.wide_dim)?;
        middle.record(rec, planes, &planes.radiance, &middle.result)?;
        narrow.record(rec, planes, dim, &narrow.result)?;
        svgf.record(rec, planes, &planes.radiance, &svgf.result)?;
        narrow.record(rec, planes, signs, &narrow.kept)?;
        svgf.record(rec, planes, probed, &svgf.kept)?;
        let bind = auto_leverage::Bind {
            wide: &wide.result,
            svgf: &svgf.result,
            narrow_kept: &narrow.kept,
            svgf_kept: &svgf.kept,
            colour: &self.pack.colour,
            place: &self.pack.place,
            estimate: &self.estimate.plane,
            leverages: &self.leverages,
        };
        let push = AutoLeveragePush {
            count,
            floor: floor(&self.settings),
            size: planes.size,
            rates: Rates::of_surfaces(&self.settings.edge).as_array(),
            ..Default::default()
        };
        rec.dispatch_threads(&self.leverage, bind, &push, count)
    }

    fn record_errors(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let [wide, mid, narrow, svgf] = self.candidates.each_ref().map(|c| &c.result);
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
        let count = planes.pixels();
        let (size, shares) = (planes.size, shares(&self.settings));
        let push = AutoErrorPush { count, floor: floor(&self.settings), size, shares, ..Default::default() };
        rec.dispatch_threads(&self.error, bind, &push, count)
    }

    /// Planes\[P\] -> others, or the same, which lie in `between` after every other level; `across` surfaces, or within alike
    /// ones. One plane comes thrice.
    fn record_smoothing<'a>(
        &'a self,
        rec: &mut Recorder,
        planes: &Planes,
        [from, to]: [[&'a Buffer<vec4>; 3]; 2],
        across: bool,
    ) -> Result<()> {
        let rates = Rates::of_surfaces(&alike(&self.settings.edge)).as_array();
        // What the candidates made of the probes is not needed any more.
        let between = [0, 1, 2].map(|k| &self.candidates[k].kept);
        let smooth = &self.smooth[usize::from(across)];
        (0..SMOOTHING).try_for_each(|level| {
            let ([first, second, third], [first_smoothed, second_smoothed, third_smoothed]) = match level {
                0 => (from, between),
                level if level % 2 == 0 => (to, between),
                _ => (between, to),
            };
            let (colour, place) = (&self.pack.colour, &self.pack.place);
            let bind = auto_smooth::Bind {
                colour,
                place,
                first,
                second,
                third,
                first_smoothed,
                second_smoothed,
                third_smoothed,
            };
            let (spacing, least) = (1 << level, least(level, across));
            let push = AutoSmoothPush { size: planes.size, spacing, rates, least, ..Default::default() };
            rec.dispatch(smooth, bind, &push, smooth.groups(threads(planes.size, spacing)))
        })
    }

    /// The blend lies where errors were smoothed.
    fn blended(&self) -> &Buffer<vec4> {
        &self.candidates[0].kept
    }

    /// The blend, and what it has lost -> output\[P\]
    fn record_residual(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let bind = auto_residual::Bind {
            colour: &self.pack.colour,
            place: &self.pack.place,
            estimate: &self.estimate.plane,
            others: &self.planes[2],
            blend: self.blended(),
            filtered: &planes.output,
        };
        let rates = Rates::of_surfaces(&self.settings.edge).as_array();
        let (size, floor) = (planes.size, floor(&self.settings));
        let push = AutoResidualPush { size, floor, rates, ..Default::default() };
        rec.dispatch(&self.residual, bind, &push, self.residual.groups(threads(planes.size, 1)))
    }
}

impl Filter for Auto {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        self.estimate.record(rec, planes, &self.pack)?;
        self.record_candidates(rec, planes)?;
        self.record_smoothing(rec, planes, [[&self.leverages; 3], [&self.surroundings; 3]], false)?;
        self.record_errors(rec, planes)?;
        self.record_smoothing(rec, planes, [self.planes.each_ref(); 2], true)?;
        let [squares, products, others] = &self.planes;
        let [wide, mid, narrow, svgf] = self.candidates.each_ref().map(|c| &c.result);
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
            variance: planes.variance.as_ref().unwrap_or(&self.nothing),
            surroundings: &self.surroundings,
            leverages: &self.leverages,
            blend: self.blended(),
            expected: &self.expected,
        };
        let count = planes.pixels();
        let blend = &self.blend[usize::from(planes.variance.is_some())];
        let push = AutoBlendPush { count, shares: shares(&self.settings), ..Default::default() };
        rec.dispatch_threads(blend, bind, &push, count)?;
        self.record_residual(rec, planes)
    }

    fn expected(&self) -> Option<&Buffer<vec3>> {
        Some(&self.expected)
    }
}
