//! Per pixel, the blend of candidates with the least estimated error: it spares the user the sweep. Kernels:
//! `glsl/auto*.comp`.
use super::edge::{Rates, edge_weight};
use super::estimate::{self, Estimate, contrast};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, FilterSettings, Planes, Row, guided, svgf};
use crate::error::Result;
use crate::gpu::layout::{AutoPush, AutoSmoothPush, Effects, PackPush, vec4};
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::reference::sampler::pcg;
use crate::shaders::{auto, auto_error, auto_leverage, auto_probe, auto_smooth};
use crate::stage::groups;
use glam::{Vec3, Vec3Swizzles, Vec4, Vec4Swizzles};

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "auto",
    about: "per pixel the best blend of none, guided by large and small windows, and svgf, by estimated error",
    make: |gpu, settings, size| Ok(Box::new(Auto::new(gpu, settings, size)?)),
    reference,
};

/// Levels of smoothing of what is estimated, a footprint of 61 pixels. Even: see `Auto::smooth`.
const SMOOTHING: u32 = 4;
/// Samples whose own variance is trusted.
const ENOUGH: f32 = 4.0;
/// Leverage: beyond it, too little is left to judge by.
const MOST: f32 = 0.9;
/// Of what the leverage of a pixel of one sample is above that of the pixels around it: see `glsl/auto_error.comp`.
const OWN: f32 = 0.8;
/// How much the errors of one surface count for another, to the power of the level: neighbours fully, far pixels hardly. Where
/// surfaces are small, as in grass, others are all there is to learn from, and few pixels seem to prove filters that keep much.
const ACROSS: f32 = 0.4;
/// Of luminance and its differences, so that their products are finite.
const LIMIT: f32 = 1e9;
/// Stands for an error that no candidate may be chosen with.
const WORST: f32 = 1e24;
/// Rounds of trades.
const ROUNDS: u32 = 8;
/// Of every square, added: weights that the estimates cannot tell apart become alike.
const RIDGE: f32 = 0.01;

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
        (guided::ROW, windows(s.radius.div_ceil(6).max(2), 5e-5)),
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
    leverage: Kernel<auto_leverage::Bind<'static>>,
    error: Kernel<auto_error::Bind<'static>>,
    smooth: Kernel<auto_smooth::Bind<'static>>,
    blend: Kernel<auto::Bind<'static>>,
    candidates: Vec<Candidate>,
    probed: Buffer<vec4>,
    leverages: Buffer<vec4>,
    /// Leverages, smoothed.
    surroundings: Buffer<vec4>,
    squares: Buffer<vec4>,
    products: Buffer<vec4>,
    /// Between two levels of smoothing.
    between: Buffer<vec4>,
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
            leverage: Kernel::new(gpu, &effects, &[])?,
            error: Kernel::new(gpu, &effects, &[])?,
            smooth: Kernel::new(gpu, &effects, &Rates::of_surfaces(&alike(settings)).constants())?,
            blend: Kernel::new(gpu, &effects, &[])?,
            candidates: candidates(settings).into_iter().map(candidate).collect::<Result<_>>()?,
            probed: plane("probed")?,
            leverages: plane("leverages")?,
            surroundings: plane("smoothed leverages")?,
            squares: plane("squared errors")?,
            products: plane("products of errors")?,
            between: plane("between levels")?,
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

    /// One plane\[P\] -> another, or the same; `across` surfaces, or within alike ones.
    fn smooth(&self, rec: &mut Recorder, planes: &Planes, [from, to]: [&Buffer<vec4>; 2], across: bool) -> Result<()> {
        let [width, height] = planes.size;
        let rates = Rates::of_surfaces(&alike(&self.settings)).as_array();
        (0..SMOOTHING).try_for_each(|level| {
            let (estimates, smoothed) = match level {
                0 => (from, &self.between),
                level if level % 2 == 0 => (to, &self.between),
                _ => (&self.between, to),
            };
            let bind = auto_smooth::Bind { estimates, colour: &self.pack.colour, place: &self.pack.place, smoothed };
            let push = AutoSmoothPush { size: planes.size, spacing: 1 << level, rates, least: least(level, across) };
            rec.dispatch(&self.smooth, bind, &push, [width.div_ceil(32), height, 1])
        })
    }
}

impl Filter for Auto {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let count = planes.pixels();
        let (colour, estimate) = (&self.pack.colour, &self.estimate.plane);
        let Self { leverages, surroundings, squares, products, .. } = self;
        self.pack.record(rec, planes)?;
        self.estimate.record(rec, planes, &self.pack, &self.settings)?;
        self.record_candidates(rec, planes, &planes.radiance, 0)?;
        let push = AutoPush { count, floor: floor(&self.settings) };
        let bind = auto_probe::Bind { colour, around: &self.candidates[0].results[0], probed: &self.probed };
        rec.dispatch(&self.probe, bind, &push, groups(count, 64))?;
        self.record_candidates(rec, planes, &self.probed, 1)?;
        let [[filtered_1, probed_1], [filtered_2, probed_2], [filtered_3, probed_3]] =
            [0, 1, 2].map(|i| self.candidates[i].results.each_ref());
        let bind = auto_leverage::Bind { filtered_1, probed_1, filtered_2, probed_2, filtered_3, probed_3, leverages };
        rec.dispatch(&self.leverage, bind, &push, groups(count, 64))?;
        self.smooth(rec, planes, [leverages, surroundings], false)?;
        let bind = auto_error::Bind {
            estimate,
            colour,
            filtered_1,
            filtered_2,
            filtered_3,
            leverages,
            surroundings,
            squares,
            products,
        };
        rec.dispatch(&self.error, bind, &push, groups(count, 64))?;
        for plane in [squares, products] {
            self.smooth(rec, planes, [plane, plane], true)?;
        }
        let filtered = &planes.output;
        let bind = auto::Bind { squares, products, colour, filtered_1, filtered_2, filtered_3, filtered };
        rec.dispatch(&self.blend, bind, &PackPush { count }, groups(count, 64))
    }
}

/// Weight of what is not alike.
fn least(level: u32, across: bool) -> f32 {
    if across { ACROSS.powi(level as i32) } else { 0.0 }
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
    let grown = |i: usize| {
        let of = |k: usize| contrast(colour(&probed[k][i]), colour(&results[k][i])) / added[i];
        Vec4::new(of(0), of(1), of(2), 0.0).clamp(Vec4::splat(-1.0), Vec4::ONE)
    };
    let leverages: Vec<Vec4> = (0..image.len()).map(grown).collect();
    let rates = Rates::of_surfaces(&alike(settings));
    let size = [input.width, input.height].map(i64::from);
    let smoothed = |plane: Vec<Vec4>, across: bool| {
        let level =
            |plane: Vec<Vec4>, level: u32| smooth(&plane, &image, size, 1i64 << level, &rates, least(level, across));
        (0..SMOOTHING).fold(plane, level)
    };
    let surroundings = smoothed(leverages.clone(), false);
    let scaled = |a: Vec3, b: Vec3| (contrast(a, b) / floor).clamp(-LIMIT, LIMIT);
    let missed = |i: usize| {
        let (own, around) = (leverages[i].xyz(), surroundings[i].xyz());
        let trust = OWN / image[i].count.max(1.0).sqrt();
        let leverage = (around + trust * (own - around).max(Vec3::ZERO)).clamp(Vec3::ZERO, Vec3::splat(MOST));
        Vec3::from_array([0, 1, 2].map(|k| scaled(colour(&results[k][i]), image[i].colour))) / (1.0 - leverage)
    };
    let weight = |i: usize| {
        let level = scaled(results.iter().map(|r| colour(&r[i])).sum::<Vec3>() / 3.0, Vec3::ZERO);
        (level * level + 1.0).powf(-0.65)
    };
    let square = |i: usize| {
        let unfiltered = 2.0 * (noise[i].sqrt() / floor).min(LIMIT).powi(2);
        let missed = missed(i);
        let square = weight(i) * (missed * missed).extend(unfiltered).wxyz();
        if image[i].count < ENOUGH { Vec4::new(WORST, square.y, square.z, WORST) } else { square }
    };
    let product = |i: usize| weight(i) * (missed(i).xxy() * missed(i).yzz()).extend(0.0);
    let squares = smoothed((0..image.len()).map(square).collect(), true);
    let products = smoothed((0..image.len()).map(product).collect(), true);
    let blended = |i: usize| blend(&image[i], squares[i], products[i], results.each_ref().map(|r| r[i].into()));
    (0..image.len()).map(blended).collect()
}

/// As `glsl/shared/probe.glsl`.
fn probe(pixel: usize, around: Vec3, least: f32) -> f32 {
    let size = 0.02 * (contrast(around, Vec3::ZERO).abs() + least);
    if pcg(pixel as u32) >> 31 == 0 { size } else { -size }
}

fn smooth(
    estimates: &[Vec4],
    image: &[Packed],
    [width, height]: [i64; 2],
    spacing: i64,
    rates: &Rates,
    least: f32,
) -> Vec<Vec4> {
    const B3: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
    let pixel = |at: i64| {
        let (mut sum, mut total) = (Vec4::ZERO, 0.0);
        for (i, j) in (-2..=2i64).flat_map(|j| (-2..=2i64).map(move |i| (i, j))) {
            let u = (at % width + i * spacing).clamp(0, width - 1);
            let v = (at / width + j * spacing).clamp(0, height - 1);
            let (p, q) = (&image[at as usize], &image[(v * width + u) as usize]);
            let w = B3[i.unsigned_abs() as usize] * B3[j.unsigned_abs() as usize];
            let w = if q.count > 0.0 { w * edge_weight(q, rates.exponent(p, q)).max(least) } else { 0.0 };
            sum += w * estimates[(v * width + u) as usize];
            total += w;
        }
        if total > 0.0 { sum / total } else { Vec4::ZERO }
    };
    (0..width * height).map(pixel).collect()
}

fn blend(p: &Packed, squares: Vec4, products: Vec4, filtered: [Vec4; 3]) -> vec4 {
    let [a, b, d] = filtered;
    let usable = Vec4::new(p.count, a.w, b.w, d.w).cmpgt(Vec4::ZERO);
    let squares = Vec4::select(usable, squares, Vec4::splat(WORST));
    let w = least_square(squares, products, usable.into());
    let base = if p.count > 0.0 { p.colour } else { a.xyz() };
    let off = w.y * (a.xyz() - base) + w.z * (b.xyz() - base) + w.w * (d.xyz() - base);
    let count = if p.count > 0.0 { p.count } else { 1.0 };
    if usable.any() { (base + off).extend(count).into() } else { [0.0; 4] }
}

/// Weights of at least 0, together 1, whose blend has the least mean square; those that are not usable get none.
fn least_square(squares: Vec4, products: Vec4, usable: [bool; 4]) -> Vec4 {
    let (noise, own, p) = (0.5 * squares.x, squares * (1.0 + RIDGE), products);
    let missed = [
        Vec4::new(own.x, noise, noise, noise),
        Vec4::new(noise, own.y, p.x, p.y),
        Vec4::new(noise, p.x, own.z, p.z),
        Vec4::new(noise, p.y, p.z, own.w),
    ];
    let mut w = Vec4::AXES[squares.min_position()];
    for _ in 0..ROUNDS {
        for (j, k) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let bend = missed[j][j] + missed[k][k] - 2.0 * missed[j][k];
            let gain = missed[k].dot(w) - missed[j].dot(w);
            if bend > 0.0 && usable[j] && usable[k] {
                let moved = (gain / bend).clamp(-w[j], w[k]);
                w[j] += moved;
                w[k] -= moved;
            }
        }
    }
    w
}

#[cfg(test)]
mod tests {
    use super::{RIDGE, WORST, least_square};
    use glam::Vec4;

    #[test]
    fn independent_errors_share_weight_by_their_inverses() {
        // Noise 1: what misses a left-out pixel has it in its square and in every product; the image itself has error 1.
        // Filters of error 1, 1/2 and 1/4, on top of which comes the ridge.
        let squares = Vec4::new(2.0, 2.0, 1.5, 1.25);
        let inverse = 1.0 / (squares - 1.0 + RIDGE * squares);
        let found = least_square(squares, Vec4::ONE, [true; 4]);
        assert!(found.abs_diff_eq(inverse / inverse.element_sum(), 1e-3), "{found}");
        assert!((found.element_sum() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_only_adds_error_gets_next_to_none() {
        // The second misses by what the first does and something of its own; the third cannot be used, nor the image.
        let squares = Vec4::new(WORST, 1.5, 2.5, WORST);
        let products = Vec4::new(1.5, 0.0, 0.0, 0.0);
        let found = least_square(squares, products, [false, true, true, false]);
        // The ridge of .01 * 1.5 over what the squares differ by, 1.04 with ridges.
        assert!(found.abs_diff_eq(Vec4::Y + 0.015 / 1.04 * (Vec4::Z - Vec4::Y), 1e-5), "{found}");
        // Weights are not below 0: the second alone would be subtracted from.
        let products = Vec4::new(2.0, 0.0, 0.0, 0.0);
        assert_eq!(least_square(squares, products, [false, true, true, false]), Vec4::Y);
        // The same twice: the ridge makes them alike.
        let twice =
            least_square(Vec4::new(WORST, 2.0, 2.0, WORST), Vec4::new(2.0, 0.0, 0.0, 0.0), [false, true, true, false]);
        assert!(twice.abs_diff_eq(Vec4::new(0.0, 0.5, 0.5, 0.0), 1e-5), "{twice}");
    }
}
