//! `auto` on the host: the twin of `glsl/auto/*.comp`.
use super::residual::given_back;
use super::smoothing::Cells;
use super::{candidates, floor, guide_of_windows, shares};
use crate::denoise::filter::edge::{Rates, edge_weight};
use crate::denoise::filter::noise_estimate::{self, ENOUGH, contrast, own_variance};
use crate::denoise::filter::pack::Packed;
use crate::denoise::filter::{FilterInput, FilterSettings, guided, svgf};
use crate::layout::{vec3, vec4};
use crate::math::hash::pcg;
use crate::math::srgb::luminance;
use crate::shaders::auto::{ENOUGH_FOR_SVGF, ENOUGH_TO_TELL_ONE, LEAST_NOISE, OF_ONE_SAMPLE, RIDGE, ROUNDS};
use crate::shaders::auto_error::{FEW, LIMIT, MOST, OWN, REACH};
use crate::shaders::shared::candidates::{BRIGHT, LEAST_SHARE, NOISE, OPTIMISM, TRUST};
use crate::shaders::shared::dominated::DOMINATED;
use glam::{Vec3, Vec4, Vec4Swizzles};
use std::array::from_fn;

/// What is blended: none, windows (wide, middle, narrow), svgf.
const BLENDED: usize = 5;

/// Of what left-out pixels are missed by: mean squares, and mean products of two.
type Errors = [[f32; BLENDED]; BLENDED];

/// What the candidates make of an image, and how much each keeps of its pixels.
struct Results {
    wide: Vec<Vec4>,
    middle: Vec<Vec4>,
    narrow: Vec<Vec4>,
    wide_dim: Vec<Vec4>,
    svgf: Vec<Vec4>,
    leverages: Vec<Vec4>,
}

impl Results {
    fn new(input: &FilterInput, image: &[Packed], settings: &FilterSettings) -> Self {
        let (rows, guide) = (candidates(settings), guide_of_windows(settings));
        let run = |k: usize, radiance: Vec<vec4>| -> Vec<Vec4> {
            let FilterSettings { guided, footprint, .. } = &rows[k];
            let output = guided::fits(&input.with_radiance(radiance), guided, footprint.radius, guide);
            output.into_iter().map(Vec4::from).collect()
        };
        let pixels = |colour: &dyn Fn(usize) -> Vec3| -> Vec<vec4> {
            (0..image.len()).map(|i| colour(i).extend(image[i].count).into()).collect()
        };
        let [wide, middle] = [0, 1].map(|k| run(k, input.radiance.clone()));
        let dim = |i: usize| dimmed(image[i].colour, wide[i].xyz());
        let [wide_dim, narrow] = [0, 2].map(|k| run(k, pixels(&dim)));
        let added = |i: usize| probe(i, wide[i].xyz(), floor(settings));
        let of_narrow =
            guided::leverages(&input.with_radiance(pixels(&dim)), &rows[2].guided, rows[2].footprint.radius, guide);
        // The probe does not change what is known of noise.
        let noise = noise_estimate::reference(input, image, &rows[3].edge, false);
        let (size, s) = (input.size(), &rows[3]);
        let svgf = |added: &dyn Fn(usize) -> f32| -> Vec<Vec4> {
            let pixel = |i: usize| (Packed { colour: image[i].colour + added(i), ..image[i] }, noise[i]);
            let output = svgf::filtered(
                size,
                (0..image.len()).map(pixel).collect(),
                &s.edge,
                &s.svgf,
                s.footprint.levels,
                false,
            );
            output.into_iter().map(Vec4::from).collect()
        };
        let (svgf, probed) = (svgf(&|_| 0.0), svgf(&added));
        let [of_wide, of_middle] = shares(settings);
        let leverage = |i: usize| {
            let own = of_narrow[i].clamp(-1.0, 1.0);
            let grown = contrast(probed[i].xyz(), svgf[i].xyz()) / added(i);
            Vec4::new(of_wide * own, of_middle * own, own, grown.clamp(-1.0, 1.0))
        };
        let leverages = (0..image.len()).map(leverage).collect();
        Self { wide, middle, narrow, wide_dim, svgf, leverages }
    }

    /// Wide, middle and narrow windows, svgf; the wide one of what the narrow one gets.
    fn at(&self, i: usize) -> ([Vec3; 4], Vec3) {
        let filtered = [&self.wide, &self.middle, &self.narrow, &self.svgf].map(|plane| plane[i].xyz());
        (filtered, self.wide_dim[i].xyz())
    }

    /// As they are blended.
    fn blended(&self, i: usize) -> [Vec3; 4] {
        let ([wide, middle, narrow, svgf], wide_dim) = self.at(i);
        let as_light = |fitted: Vec3| fitted.max(wide.min(Vec3::ZERO));
        [wide, as_light(middle), as_light(narrow + (wide - wide_dim)), svgf]
    }

    /// By what the four miss a pixel that they are made without: what they miss it by over what they do not keep of it.
    fn missed(&self, i: usize, pixel: &Packed, around: Vec4, scaled: &impl Fn(Vec3, Vec3) -> f32) -> Vec4 {
        let trust = OWN / pixel.count.max(1.0).sqrt();
        let kept = around + trust * (self.leverages[i] - around).max(Vec4::ZERO);
        let left = 1.0 - kept.clamp(Vec4::ZERO, Vec4::splat(MOST));
        let ([wide, middle, narrow, svgf], wide_dim) = self.at(i);
        let (colour, dim) = (pixel.colour, dimmed(pixel.colour, wide));
        let whole = [(wide, colour), (middle, colour), (narrow, dim), (svgf, colour)];
        let mut missed = Vec4::from_array(whole.map(|(filtered, pixel)| scaled(filtered, pixel))) / left;
        missed.z += scaled(wide - wide_dim, colour - dim) / left.x;
        missed
    }

    fn usable(&self, i: usize) -> [bool; 4] {
        [&self.wide, &self.middle, &self.narrow, &self.svgf].map(|plane| plane[i].w > 0.0)
    }
}

/// The twin.
pub fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    estimated(input, settings).0
}

/// Also what [`Filter::expected`](super::super::Filter::expected) holds.
pub fn estimated(input: &FilterInput, settings: &FilterSettings) -> (Vec<vec4>, Vec<vec3>) {
    let (image, floor) = (Packed::reference(input), floor(settings));
    let noise = noise_estimate::reference(input, &image, &settings.edge, true);
    let results = Results::new(input, &image, settings);
    let cells = Cells::new(&image, input.size(), &settings.edge);
    let smoothed = |plane: Vec<Vec4>, across: bool| cells.smoothed(&plane, across);
    let size = input.size().map(i64::from);
    let surroundings = smoothed(results.leverages.clone(), false);
    let surfaces = Rates::of_surfaces(&settings.edge);
    let differ = |i: usize| differences(&image, &noise, size, i, &surfaces, floor, results.wide[i].xyz());
    let shares_of_noise: Vec<f32> =
        smoothed((0..image.len()).map(differ).collect(), false).into_iter().map(share_of_noise).collect();
    let scaled = |a: Vec3, b: Vec3| (contrast(a, b) / floor).clamp(-LIMIT, LIMIT);
    // Squares of the filters; their products; the rest of those, the square of none, and the light itself.
    let errors = |i: usize| {
        let m = results.missed(i, &image[i], surroundings[i], &scaled);
        let ([a, b, c, d], most) = (results.blended(i), (image[i].count / FEW).max(1.0));
        let light = scaled((a + b + c + most * d) / (3.0 + most), Vec3::ZERO).powi(2) + 1.0;
        let uncertain = light + NOISE * variance_around(&noise, size, i as i64, floor);
        let weight = if image[i].count > 0.0 { uncertain.recip() } else { 0.0 };
        let unfiltered = 2.0 * shares_of_noise[i] * squared_deviation(noise[i], floor);
        let others = weight * Vec4::new(m.y * m.w, m.z * m.w, unfiltered, light);
        [weight * m * m, weight * m.xxxy() * m.yzwz(), others]
    };
    let planes: [Vec<Vec4>; 3] = from_fn(|k| (0..image.len()).map(|i| errors(i)[k]).collect());
    let planes = planes.map(|plane| smoothed(plane, true));
    let found_around = |i: usize| planes.each_ref().map(|plane| plane[i]);
    let weights = |i: usize| {
        let (enough, [a, b, c, d]) = (image[i].count >= ENOUGH, results.usable(i));
        let usable = [enough, a, b, c, image[i].count >= ENOUGH_FOR_SVGF && d];
        (usable, least_square(&matrix(found_around(i)), usable))
    };
    let weights: Vec<_> = (0..image.len()).map(weights).collect();
    let blended = |i: usize| {
        let (usable, filtered) = (weights[i].0, results.blended(i));
        let all = Vec4::from(blend(&image[i], weights[i], filtered));
        let own = own_variance(input, i, image[i].count).filter(|_| usable[4] && image[i].count >= ENOUGH_TO_TELL_ONE);
        own.map_or(all, |variance| less_of_one_sample(&image[i], variance, all, filtered[3]))
    };
    let blend: Vec<Vec4> = (0..image.len()).map(blended).collect();
    let expected = |i: usize| {
        expected(found_around(i), &weights[i].1, [results.leverages[i], surroundings[i]], shares_of_noise[i])
    };
    let expected = (0..image.len()).map(expected).collect();
    let prior = |i: usize| {
        let level = contrast(blend[i].xyz(), Vec3::ZERO).abs().max(floor);
        0.5 * planes[2][i].z / planes[2][i].w.max(1e-20) * level * level * image[i].count
    };
    (given_back(input, &image, &noise, &blend, &surfaces, prior), expected)
}

fn squared_deviation(variance: f32, floor: f32) -> f32 {
    (variance.max(0.0).sqrt() / floor).min(LIMIT).powi(2)
}

/// Squared second differences of luminance along both axes, what variances tell of them, over squared light.
fn differences(
    image: &[Packed],
    noise: &[f32],
    [width, height]: [i64; 2],
    at: usize,
    rates: &Rates,
    floor: f32,
    around: Vec3,
) -> Vec4 {
    let (x, y) = (at as i64 % width, at as i64 / width);
    let light = (contrast(around, Vec3::ZERO).abs() / floor).min(LIMIT);
    let mut sum = Vec4::ZERO;
    for (step, inside) in [(1, x > 0 && x + 1 < width), (width, y > 0 && y + 1 < height)] {
        if !inside || image[at].count == 0.0 {
            continue;
        }
        let [before, after] = [at as i64 - step, at as i64 + step].map(|j| j as usize);
        let w = [before, after].map(|j| edge_weight(&image[j], rates.exponent(&image[at], &image[j])));
        let bend: f32 = [before, after].map(|j| contrast(image[at].colour, image[j].colour)).iter().sum();
        let [here, before, after] = [at, before, after].map(|j| noise[j].max(0.0));
        let found = (0.5 * bend.abs() / floor).min(LIMIT);
        let told = ((here + 0.25 * (before + after)).sqrt() / floor).min(LIMIT);
        sum += w[0] * w[1] * Vec4::new(found * found, told * told, 0.0, 0.0);
    }
    sum / (light * light + 1.0)
}

/// As `glsl/shared/candidates.glsl`.
fn share_of_noise(found: Vec4) -> f32 {
    if found.y > 0.0 { (TRUST * found.x / found.y).clamp(LEAST_SHARE, 1.0) } else { 1.0 }
}

fn variance_around(noise: &[f32], [width, height]: [i64; 2], at: i64, floor: f32) -> f32 {
    const REACH: i64 = self::REACH as i64;
    let (mut sum, mut total) = (0.0, 0.0);
    for (i, j) in (-REACH..=REACH).flat_map(|j| (-REACH..=REACH).map(move |i| (i, j))) {
        let (u, v) = ((at % width + i).clamp(0, width - 1), (at / width + j).clamp(0, height - 1));
        let variance = noise[(v * width + u) as usize];
        let tent = ((REACH + 1 - i.abs()) * (REACH + 1 - j.abs())) as f32;
        let w = if variance < 0.0 { 0.0 } else { tent };
        sum += w * squared_deviation(variance, floor);
        total += w;
    }
    if total > 0.0 { sum / total } else { 0.0 }
}

/// As `glsl/shared/candidates.glsl`.
fn dimmed(colour: Vec3, around: Vec3) -> Vec3 {
    let (bright, most) = (luminance(colour), BRIGHT * luminance(around).max(0.0));
    if bright > most { colour * (most / bright) } else { colour }
}

/// As `glsl/shared/perturbation.glsl`.
fn probe(pixel: usize, around: Vec3, least: f32) -> f32 {
    let random_sign = 1.0 - 2.0 * (pcg(pixel as u32) >> 31) as f32;
    random_sign * 0.02 * (contrast(around, Vec3::ZERO).abs() + least)
}

/// An independent copy of the pixel misses it by both copies' noise, and has the pixel's in common with what a filter misses.
fn matrix([squares, products, others]: [Vec4; 3]) -> Errors {
    let told = 0.5 * others.z;
    let noise = told.min(squares.min_element()).max(LEAST_NOISE * told);
    let unseen = OPTIMISM * (NOISE * noise).min(1.0).powi(2) * noise;
    let (squares, products) = (squares + 2.0 * unseen * Vec4::W, products + unseen * Vec4::Z);
    let others = others + unseen * (Vec4::X + Vec4::Y);
    [
        [2.0 * noise, noise, noise, noise, noise + unseen],
        [noise, squares.x, products.x, products.y, products.z],
        [noise, products.x, squares.y, products.w, others.x],
        [noise, products.y, products.w, squares.z, others.y],
        [noise + unseen, products.z, others.x, others.y, squares.w],
    ]
}

/// The blend's mean squared error over its squared luminance, the share of the samples' variance that is noise, its leverage.
fn expected(relative: [Vec4; 3], w: &[f32; BLENDED], [own, around]: [Vec4; 2], share: f32) -> vec3 {
    let (missed, told) = (matrix(relative), 0.5 * relative[2].z);
    let noise = missed[0][1];
    let products = (0..BLENDED).flat_map(|j| (0..BLENDED).map(move |k| (j, k)));
    let square: f32 = products.map(|(j, k)| w[j] * w[k] * missed[j][k]).sum();
    let kept = |leverages: Vec4| (w[0] + Vec4::from_slice(&w[1..]).dot(leverages)).clamp(0.0, 1.0);
    let error = (square - noise).max(kept(around) * noise);
    [error, if told > 0.0 { noise / told * share } else { 1.0 }, kept(own.max(around).clamp(Vec4::ZERO, Vec4::ONE))]
}

fn blend(p: &Packed, (usable, w): ([bool; BLENDED], [f32; BLENDED]), filtered: [Vec3; 4]) -> vec4 {
    let known = p.count > 0.0;
    let adrift = usable[1] && !known && p.normal == Vec3::ZERO;
    let w = if adrift { [0.0, 1.0, 0.0, 0.0, 0.0] } else { w };
    let base = if known { p.colour } else { filtered[0] };
    let off: Vec3 = w[1..].iter().zip(filtered).map(|(w, filtered)| w * (filtered - base)).sum();
    let count = if known { p.count } else { 1.0 };
    if usable.contains(&true) { (base + off).extend(count).into() } else { [0.0; 4] }
}

/// Cuts what one sample has brought and svgf does not find around it.
fn less_of_one_sample(p: &Packed, variance: f32, blend: Vec4, svgf: Vec3) -> Vec4 {
    let (bright, most) = (luminance(blend.xyz()), OF_ONE_SAMPLE * luminance(svgf).max(0.0));
    let own = luminance(p.colour);
    let dominated = variance.sqrt() > DOMINATED * own.abs();
    if dominated && bright > most && own >= bright { (blend.xyz() * (most / bright)).extend(blend.w) } else { blend }
}

/// Weights of at least 0, together 1, whose blend has the least mean square; those that are not usable get none.
fn least_square(errors: &Errors, usable: [bool; BLENDED]) -> [f32; BLENDED] {
    let square = |k: &usize| errors[*k][*k];
    let best = (0..BLENDED).filter(|k| usable[*k]).min_by(|a, b| square(a).total_cmp(&square(b))).unwrap_or(1);
    let mut missed = *errors;
    (0..BLENDED).for_each(|k| missed[k][k] *= 1.0 + RIDGE);
    let mut w: [f32; BLENDED] = from_fn(|k| if k == best { 1.0 } else { 0.0 });
    // Half of what the blend's mean square grows by with each weight.
    let mut growth: [f32; BLENDED] = from_fn(|m| missed[m][best]);
    for _ in 0..ROUNDS {
        for (j, k) in (0..BLENDED).flat_map(|j| (j + 1..BLENDED).map(move |k| (j, k))) {
            let bend = missed[j][j] + missed[k][k] - 2.0 * missed[j][k];
            let gain = growth[k] - growth[j];
            if bend > 0.0 && usable[j] && usable[k] {
                let moved = (gain / bend).clamp(-w[j], w[k]);
                w[j] += moved;
                w[k] -= moved;
                (0..BLENDED).for_each(|m| growth[m] += moved * (missed[m][j] - missed[m][k]));
            }
        }
    }
    w
}

#[cfg(test)]
mod tests {
    use super::{Errors, RIDGE, least_square};

    #[test]
    fn independent_errors_share_weight_by_their_inverses() {
        // Noise 1: what misses a left-out pixel has it in its square and in every product; the image itself has error 1.
        // Filters of error 1, 1/2, 1/4 and 1/8, on top of which comes the ridge.
        let squares = [2.0, 2.0, 1.5, 1.25, 1.125];
        let mut errors: Errors = [[1.0; 5]; 5];
        (0..5).for_each(|k| errors[k][k] = squares[k]);
        let inverse = squares.map(|square| 1.0 / (square - 1.0 + RIDGE * square));
        let (found, all) = (least_square(&errors, [true; 5]), inverse.iter().sum::<f32>());
        assert!(found.iter().zip(inverse).all(|(w, inverse)| (w - inverse / all).abs() < 2e-3), "{found:?}");
        assert!((found.iter().sum::<f32>() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_only_adds_error_gets_next_to_none() {
        // The second misses by what the first does and something of its own; none of the others can be used.
        let two = |squares: [f32; 2], product: f32| {
            let mut errors: Errors = [[0.0; 5]; 5];
            (errors[1][1], errors[2][2]) = (squares[0], squares[1]);
            (errors[1][2], errors[2][1]) = (product, product);
            least_square(&errors, [false, true, true, false, false])
        };
        let found = two([1.5, 2.5], 1.5);
        // The ridge of .01 * 1.5 over what the squares differ by, 1.04 with ridges.
        let off = [0.0, 1.0 - 0.015 / 1.04, 0.015 / 1.04, 0.0, 0.0];
        assert!(found.iter().zip(off).all(|(w, right)| (w - right).abs() < 1e-5), "{found:?}");
        // Weights are not below 0: the second alone would be subtracted from.
        assert_eq!(two([1.5, 2.5], 2.0), [0.0, 1.0, 0.0, 0.0, 0.0]);
        // The same twice: the ridge makes them alike.
        let twice = two([2.0, 2.0], 2.0);
        assert!(twice.iter().zip([0.0, 0.5, 0.5, 0.0, 0.0]).all(|(w, right)| (w - right).abs() < 1e-5), "{twice:?}");
    }
}
