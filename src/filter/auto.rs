//! Per pixel, the candidate with the least estimated error, blended: it spares the user the sweep. Kernels:
//! `glsl/auto*.comp`.
use super::edge::{Rates, edge_weight};
use super::estimate::{self, Estimate, contrast};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, FilterSettings, Planes, Row, guided, svgf};
use crate::error::Result;
use crate::gpu::layout::{AutoPush, AutoSmoothPush, Effects, PackPush, vec4};
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::reference::sampler::pcg;
use crate::shaders::{auto, auto_error, auto_probe, auto_smooth};
use crate::stage::groups;
use glam::{Vec3, Vec4, Vec4Swizzles};

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "auto",
    about: "per pixel the best of none, guided by large and small windows, and svgf, by estimated error",
    make: |gpu, settings, size| Ok(Box::new(Auto::new(gpu, settings, size)?)),
    reference,
};

/// Levels of smoothing of the error estimates: a footprint of 61 pixels.
const SMOOTHING: u32 = 4;
/// Samples whose own variance is trusted.
const ENOUGH: f32 = 4.0;
/// Of a pixel that a filter keeps: beyond it, too little is left to judge by.
const MOST: f32 = 0.9;
/// Of luminance and its differences, so that their squares are finite.
const LIMIT: f32 = 1e9;
/// Stands for an error that no candidate may be chosen with.
const WORST: f32 = 1e24;

/// The filters beside none, found by searching six noisy images of three scenes and three of the Cornell box for what leaves
/// `auto` nearest to the best filter of each. At their defaults: windows of 33 and of 9 pixels, both held more tightly than
/// alone, depth above all; and 3 levels of `svgf`, which light and positions hold more tightly and normals hardly.
fn candidates(s: &FilterSettings) -> [(Row, FilterSettings); 3] {
    let windows = |radius: u32, depth: f32| {
        let [x, y, z, w] = s.eps;
        FilterSettings { radius, eps: [0.1 * x, 0.1 * y, 0.1 * z, depth * w], ..*s }
    };
    let (sigma_l, sigma_n, sigma_x) = (0.75 * s.sigma_l, 4.0 * s.sigma_n, 0.6 * s.sigma_x);
    [
        (guided::ROW, windows((2 * s.radius).div_ceil(3), 5e-3)),
        // Fewer than 5 x 5 pixels do not determine a model of four channels: little of a pixel is left to judge it by.
        (guided::ROW, windows(s.radius.div_ceil(6).max(2), 1.5e-4)),
        (svgf::ROW, FilterSettings { levels: s.levels.min(3), sigma_l, sigma_n, sigma_x, ..*s }),
    ]
}

/// What counts as one surface to the estimates of errors.
fn alike(s: &FilterSettings) -> FilterSettings {
    FilterSettings { sigma_n: 2.5 * s.sigma_n, sigma_x: 1.2 * s.sigma_x, ..*s }
}

/// A filter, and what it makes of the image and of the probed image.
struct Candidate {
    filter: Box<dyn Filter>,
    results: [Buffer<vec4>; 2],
}

struct Auto {
    pack: Pack,
    estimate: Estimate,
    probe: Kernel<auto_probe::Bind<'static>>,
    error: Kernel<auto_error::Bind<'static>>,
    smooth: Kernel<auto_smooth::Bind<'static>>,
    blend: Kernel<auto::Bind<'static>>,
    candidates: Vec<Candidate>,
    probed: Buffer<vec4>,
    errors: [Buffer<vec4>; 2],
    settings: FilterSettings,
}

impl Auto {
    fn new(gpu: &Gpu, settings: &FilterSettings, size: [u32; 2]) -> Result<Self> {
        let pack = Pack::new(gpu, size)?;
        let plane = |name| Buffer::new(gpu, name, pack.colour.len(), Location::Device);
        let candidate = |(row, settings): (Row, FilterSettings)| {
            let filter = (row.make)(gpu, &settings, size)?;
            Ok(Candidate { filter, results: [plane("candidate")?, plane("probed candidate")?] })
        };
        let effects = Effects::default();
        Ok(Self {
            estimate: Estimate::new(gpu, settings, size)?,
            probe: Kernel::new(gpu, &effects, &[])?,
            error: Kernel::new(gpu, &effects, &[])?,
            smooth: Kernel::new(gpu, &effects, &Rates::of_surfaces(&alike(settings)).constants())?,
            blend: Kernel::new(gpu, &effects, &[])?,
            candidates: candidates(settings).into_iter().map(candidate).collect::<Result<_>>()?,
            probed: plane("probed")?,
            errors: [plane("errors")?, plane("smoothed errors")?],
            settings: *settings,
            pack,
        })
    }

    /// radiance\[P\] -> what every candidate makes of it, or of the probed image
    fn record_candidates(
        &self,
        rec: &mut Recorder,
        planes: &Planes,
        radiance: &Buffer<vec4>,
        which: usize,
    ) -> Result<()> {
        self.candidates.iter().try_for_each(|Candidate { filter, results }| {
            let (radiance, output) = (radiance.clone(), results[which].clone());
            let (guide, variance) = (planes.guide.clone(), planes.variance.clone());
            filter.record(rec, &Planes { size: planes.size, radiance, guide, variance, output })
        })
    }
}

impl Filter for Auto {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let ([width, height], count) = (planes.size, planes.pixels());
        let (colour, estimate) = (&self.pack.colour, &self.estimate.plane);
        self.pack.record(rec, planes)?;
        self.estimate.record(rec, planes, &self.pack, &self.settings)?;
        self.record_candidates(rec, planes, &planes.radiance, 0)?;
        let push = AutoPush { count, floor: floor(&self.settings) };
        let bind = auto_probe::Bind { colour, around: &self.candidates[0].results[0], probed: &self.probed };
        rec.dispatch(&self.probe, bind, &push, groups(count, 64))?;
        self.record_candidates(rec, planes, &self.probed, 1)?;
        let [[filtered_1, probed_1], [filtered_2, probed_2], [filtered_3, probed_3]] =
            [0, 1, 2].map(|i| self.candidates[i].results.each_ref());
        let [errors, smoothed] = self.errors.each_ref();
        let bind = auto_error::Bind {
            estimate,
            colour,
            filtered_1,
            probed_1,
            filtered_2,
            probed_2,
            filtered_3,
            probed_3,
            errors,
        };
        rec.dispatch(&self.error, bind, &push, groups(count, 64))?;
        let (mut from, mut to) = (errors, smoothed);
        for level in 0..SMOOTHING {
            let rates = Rates::of_surfaces(&alike(&self.settings)).as_array();
            let push = AutoSmoothPush { size: planes.size, spacing: 1 << level, rates };
            let bind = auto_smooth::Bind { errors: from, colour, place: &self.pack.place, smoothed: to };
            rec.dispatch(&self.smooth, bind, &push, [width.div_ceil(32), height, 1])?;
            (from, to) = (to, from);
        }
        let bind = auto::Bind { errors: from, colour, filtered_1, filtered_2, filtered_3, filtered: &planes.output };
        rec.dispatch(&self.blend, bind, &PackPush { count }, groups(count, 64))
    }
}

/// Luminance below which errors count as absolute: a thousandth of the image's intensity.
fn floor(settings: &FilterSettings) -> f32 {
    (1e-3 * settings.intensity).clamp(1e-30, 1e24)
}

fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let (image, floor) = (Packed::reference(input), floor(settings));
    let noise = estimate::reference(input, &image, settings);
    let run = |input: &FilterInput| candidates(settings).map(|(row, s)| (row.reference)(input, &s));
    let results = run(input);
    let colour = |c: &vec4| Vec4::from(*c).xyz();
    let added: Vec<f32> = results[0].iter().enumerate().map(|(i, c)| probe(i, colour(c), floor)).collect();
    let probed = |(p, added): (&Packed, &f32)| (p.colour + *added).extend(p.count).into();
    let probed = FilterInput { radiance: image.iter().zip(&added).map(probed).collect(), ..input.clone() };
    let probed = run(&probed);
    let scaled = |a: Vec3, b: Vec3| (contrast(a, b) / floor).clamp(-LIMIT, LIMIT);
    let errors = |i: usize| {
        let missed = |k: usize| {
            let filtered = colour(&results[k][i]);
            let kept = (contrast(colour(&probed[k][i]), filtered) / added[i]).clamp(0.0, MOST);
            (scaled(filtered, image[i].colour) / (1.0 - kept)).powi(2)
        };
        let level = scaled(results.iter().map(|r| colour(&r[i])).sum::<Vec3>() / 3.0, Vec3::ZERO);
        let unfiltered = 2.0 * (noise[i].sqrt() / floor).min(LIMIT).powi(2);
        let relative = Vec4::new(unfiltered, missed(0), missed(1), missed(2)) / (level * level + 1.0).sqrt();
        if image[i].count < ENOUGH { Vec4::new(WORST, relative.y, relative.z, WORST) } else { relative }
    };
    let mut smoothed: Vec<Vec4> = (0..image.len()).map(errors).collect();
    let rates = Rates::of_surfaces(&alike(settings));
    for level in 0..SMOOTHING {
        smoothed = smooth(&smoothed, &image, [input.width, input.height].map(i64::from), 1 << level, &rates);
    }
    let blended = |i: usize| blend(&image[i], smoothed[i], results.each_ref().map(|r| r[i].into()));
    (0..image.len()).map(blended).collect()
}

/// As `glsl/shared/probe.glsl`.
fn probe(pixel: usize, around: Vec3, least: f32) -> f32 {
    let size = 0.02 * (contrast(around, Vec3::ZERO).abs() + least);
    if pcg(pixel as u32) >> 31 == 0 { size } else { -size }
}

fn smooth(errors: &[Vec4], image: &[Packed], [width, height]: [i64; 2], spacing: i64, rates: &Rates) -> Vec<Vec4> {
    const B3: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
    let pixel = |at: i64| {
        let (mut sum, mut total) = (Vec4::ZERO, 0.0);
        for (i, j) in (-2..=2i64).flat_map(|j| (-2..=2i64).map(move |i| (i, j))) {
            let u = (at % width + i * spacing).clamp(0, width - 1);
            let v = (at / width + j * spacing).clamp(0, height - 1);
            let (p, q) = (&image[at as usize], &image[(v * width + u) as usize]);
            let w = B3[i.unsigned_abs() as usize] * B3[j.unsigned_abs() as usize];
            let w = w * edge_weight(q, rates.exponent(p, q));
            sum += w * errors[(v * width + u) as usize];
            total += w;
        }
        if total > 0.0 { sum / total } else { Vec4::ZERO }
    };
    (0..width * height).map(pixel).collect()
}

fn blend(p: &Packed, errors: Vec4, filtered: [Vec4; 3]) -> vec4 {
    let [a, b, d] = filtered;
    let usable = Vec4::new(p.count, a.w, b.w, d.w).cmpgt(Vec4::ZERO);
    let e = Vec4::select(usable, errors, Vec4::splat(WORST));
    let slack = 0.035 * e.min_element() + 1e-6;
    let w = slack / (e - e.min_element() + slack);
    let w = Vec4::select(usable, w * w * w, Vec4::ZERO);
    let base = if p.count > 0.0 { p.colour } else { a.xyz() };
    let off = w.y * (a.xyz() - base) + w.z * (b.xyz() - base) + w.w * (d.xyz() - base);
    let (count, total) = (if p.count > 0.0 { p.count } else { 1.0 }, w.element_sum());
    if total > 0.0 { (base + off / total).extend(count).into() } else { [0.0; 4] }
}
