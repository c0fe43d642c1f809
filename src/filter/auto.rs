//! Per pixel, the candidate with the least estimated error, blended: it spares the user the sweep. Kernels:
//! `glsl/auto*.comp`.
use super::estimate::{self, Estimate, contrast};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, FilterSettings, Planes, Row, atrous, guided, svgf};
use crate::error::Result;
use crate::gpu::layout::{AutoErrorPush, AutoSmoothPush, Effects, PackPush, vec4};
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::reference::sampler::pcg;
use crate::shaders::{auto, auto_error, auto_probe, auto_smooth};
use crate::stage::groups;
use glam::{Vec3, Vec4, Vec4Swizzles};

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "auto",
    about: "per pixel the best of none, À-Trous, variance-steered À-Trous and guided, by estimated error",
    make: |gpu, settings, size| Ok(Box::new(Auto::new(gpu, settings, size)?)),
    reference,
};

/// Levels of smoothing of the error estimates: a footprint of 29 pixels.
const SMOOTHING: u32 = 3;
/// Largest relative error, and what stands for none.
const WORST: f32 = 1e6;
const UNKNOWN: f32 = 2.0 * WORST;

/// The filters beside none. EAW goes without the radiance weight, which noise would steer, and like the guided filter
/// over a smaller footprint than alone: where that is too small, the third reaches further.
fn candidates(s: &FilterSettings) -> [(Row, FilterSettings); 3] {
    let fine = FilterSettings { levels: s.levels.min(3), sigma_rt: f32::INFINITY, ..*s };
    let local = FilterSettings { radius: s.radius.div_ceil(2), eps: s.eps.map(|eps| 0.1 * eps), ..*s };
    let wide = FilterSettings { sigma_l: 2.0 * s.sigma_l, ..*s };
    [(atrous::ROW, fine), (guided::ROW, local), (svgf::ROW, wide)]
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
            smooth: Kernel::new(gpu, &effects, &[])?,
            blend: Kernel::new(gpu, &effects, &[])?,
            candidates: candidates(settings).into_iter().map(candidate).collect::<Result<_>>()?,
            probed: plane("probed")?,
            errors: [plane("errors")?, plane("smoothed errors")?],
            settings: *settings,
            pack,
        })
    }

    fn record_candidates(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        for Candidate { filter, results: [filtered, probed] } in &self.candidates {
            for (radiance, output) in [(&planes.radiance, filtered), (&self.probed, probed)] {
                let (radiance, output) = (radiance.clone(), output.clone());
                let (guide, variance) = (planes.guide.clone(), planes.variance.clone());
                filter.record(rec, &Planes { size: planes.size, radiance, guide, variance, output })?;
            }
        }
        Ok(())
    }
}

impl Filter for Auto {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let ([width, height], count) = (planes.size, planes.pixels());
        let (colour, estimate) = (&self.pack.colour, &self.estimate.plane);
        self.pack.record(rec, planes)?;
        self.estimate.record(rec, planes, &self.pack, &self.settings)?;
        let bind = auto_probe::Bind { estimate, colour, probed: &self.probed };
        rec.dispatch(&self.probe, bind, &PackPush { count }, groups(count, 64))?;
        self.record_candidates(rec, planes)?;
        let [[filtered_1, probed_1], [filtered_2, probed_2], [filtered_3, probed_3]] =
            [0, 1, 2].map(|i| self.candidates[i].results.each_ref());
        let [errors, smoothed] = self.errors.each_ref();
        let bind =
            auto_error::Bind { estimate, filtered_1, probed_1, filtered_2, probed_2, filtered_3, probed_3, errors };
        let push = AutoErrorPush { count, floor: floor(&self.settings) };
        rec.dispatch(&self.error, bind, &push, groups(count, 64))?;
        let (mut from, mut to) = (errors, smoothed);
        for level in 0..SMOOTHING {
            let push = AutoSmoothPush { size: planes.size, spacing: 1 << level };
            let bind = auto_smooth::Bind { errors: from, smoothed: to };
            rec.dispatch(&self.smooth, bind, &push, [width.div_ceil(32), height, 1])?;
            (from, to) = (to, from);
        }
        let bind = auto::Bind { errors: from, colour, filtered_1, filtered_2, filtered_3, filtered: &planes.output };
        rec.dispatch(&self.blend, bind, &PackPush { count }, groups(count, 64))
    }
}

/// Squared luminance below which errors count as absolute: a thousandth of the image's intensity.
fn floor(settings: &FilterSettings) -> f32 {
    (1e-3 * settings.intensity).powi(2).clamp(1e-36, 1e36)
}

fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let image = Packed::reference(input);
    let noise = estimate::reference(input, &image, settings);
    let added: Vec<f32> = (0..image.len()).map(|i| probe(i, &image[i], noise[i])).collect();
    let probed = |(p, added): (&Packed, &f32)| (p.colour + *added).extend(p.count).into();
    let probed = FilterInput { radiance: image.iter().zip(&added).map(probed).collect(), ..input.clone() };
    let results = candidates(settings).map(|(row, s)| [input, &probed].map(|input| (row.reference)(input, &s)));
    let colour = |c: &vec4| Vec4::from(*c).xyz();
    let errors = |i: usize| {
        let level = contrast(results.iter().map(|r| colour(&r[0][i])).sum::<Vec3>() / 3.0, Vec3::ZERO);
        let risk = |[filtered, probed]: &[Vec<vec4>; 2]| {
            let off = contrast(colour(&filtered[i]), image[i].colour);
            let kept = (contrast(colour(&probed[i]), colour(&filtered[i])) / added[i]).clamp(0.0, 1.0);
            off * off + noise[i] * (2.0 * kept - 1.0)
        };
        let risks = Vec4::new(noise[i], risk(&results[0]), risk(&results[1]), risk(&results[2]));
        let relative = risks / (level * level + floor(settings));
        let known = noise[i] >= 0.0;
        if known { relative.clamp(Vec4::splat(-WORST), Vec4::splat(WORST)) } else { Vec4::splat(UNKNOWN) }
    };
    let mut smoothed: Vec<Vec4> = (0..image.len()).map(errors).collect();
    for level in 0..SMOOTHING {
        smoothed = smooth(&smoothed, [i64::from(input.width), i64::from(input.height)], 1 << level);
    }
    let blended = |i: usize| blend(&image[i], smoothed[i], results.each_ref().map(|r| r[0][i].into()));
    (0..image.len()).map(blended).collect()
}

/// As `glsl/shared/probe.glsl`.
fn probe(pixel: usize, p: &Packed, noise: f32) -> f32 {
    let size = 0.1 * noise.max(0.0).sqrt() + 1e-3 * contrast(p.colour, Vec3::ZERO).abs() + 1e-20;
    if pcg(pixel as u32) >> 31 == 0 { size } else { -size }
}

fn smooth(errors: &[Vec4], [width, height]: [i64; 2], spacing: i64) -> Vec<Vec4> {
    const B3: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
    let pixel = |at: i64| {
        let (mut sum, mut total) = (Vec4::ZERO, 0.0);
        for (i, j) in (-2..=2i64).flat_map(|j| (-2..=2i64).map(move |i| (i, j))) {
            let u = (at % width + i * spacing).clamp(0, width - 1);
            let v = (at / width + j * spacing).clamp(0, height - 1);
            let e = errors[(v * width + u) as usize];
            let w = if e.x < UNKNOWN { B3[i.unsigned_abs() as usize] * B3[j.unsigned_abs() as usize] } else { 0.0 };
            sum += w * e;
            total += w;
        }
        if total > 0.0 { sum / total } else { Vec4::splat(UNKNOWN) }
    };
    (0..width * height).map(pixel).collect()
}

fn blend(p: &Packed, errors: Vec4, filtered: [Vec4; 3]) -> vec4 {
    let e = errors.max(Vec4::ZERO);
    let w = (e + 0.005 * e.x + 1e-6).recip();
    let w = w * w * w;
    let base = if p.count > 0.0 { p.colour } else { filtered[0].xyz() };
    let mut total = if p.count > 0.0 { w.x } else { 0.0 };
    let mut off = Vec3::ZERO;
    for (f, w) in filtered.iter().zip([w.y, w.z, w.w]).filter(|(f, _)| f.w > 0.0) {
        total += w;
        off += w * (f.xyz() - base);
    }
    let count = if p.count > 0.0 { p.count } else { 1.0 };
    if total > 0.0 { (base + off / total).extend(count).into() } else { [0.0; 4] }
}
