//! The statistics of a pixel's samples, and how those of two disjoint sets of samples are combined.
use crate::layout::{PixelLight, PixelStats, vec3};
use crate::math::srgb::luminance;
use crate::shaders::accumulate::{MIN_ALBEDO, ONE_SURFACE};
use crate::shaders::shared::sample_marks::{ALL_ASTRAY, ALL_PASSED_OVER, SOME_BARE};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The statistics of one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Mean and squared deviations of the radiance, and the number of samples.
    pub stats: PixelStats,
    /// Direct and indirect light; zero if they are not kept separately.
    pub light: PixelLight,
}

impl Pixel {
    /// The light that needs a filter, before the reflectance that it has been multiplied by: radiance less direct light, over
    /// albedo. 0 where there is none, and below 0 where samples by chance bring less than direct light.
    pub fn indirect(&self) -> vec3 {
        let (Pixel { stats, light }, known) = (self, |v: f32| if v.is_finite() { v } else { 0.0 });
        std::array::from_fn(|c| known((stats.mean[c] - light.direct[c]) / light.albedo[c]))
    }
}

/// Samples that are wrong: NaN or infinite, which count as black, or of paths that llvmpipe ended before their time
/// (`glsl/shared/loop_limit.glsl`), which count as far as they came.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BrokenSamples {
    /// Number of such samples.
    pub count: u64,
    /// Column and row of the first pixel, row by row, that has such a sample.
    pub pixel: [u32; 2],
    /// The lowest index of such a sample in that pixel.
    pub sample: u32,
    /// The seed of the render that it belongs to.
    pub seed: u32,
}

impl BrokenSamples {
    /// Combines the records of two disjoint sets of samples.
    pub fn join(a: Option<Self>, b: Option<Self>) -> Option<Self> {
        let (Some(x), Some(y)) = (a, b) else { return a.or(b) };
        let place = |s: &Self| (s.pixel[1], s.pixel[0], s.sample, s.seed);
        let first = if place(&y) < place(&x) { y } else { x };
        Some(Self { count: x.count.saturating_add(y.count), ..first })
    }
}

/// Upper limit of sums of squares, as in `glsl/film/accumulate.comp`.
const WIDEST: f64 = 1e35;

/// Combines the statistics of two disjoint sets of samples (Chan, Golub and LeVeque 1979): with d the difference of the
/// means, the mean moves by d n_b / n and M2 grows by d^2 n_a n_b / n. The result is computed in double precision and
/// rounded once, so means and M2 are within a relative 2^-24 of exact arithmetic.
///
/// # Panics
/// When they have 2^32 samples or more in total.
pub fn join(a: &Pixel, b: &Pixel) -> Pixel {
    let (na, nb) = (f64::from(a.stats.count), f64::from(b.stats.count));
    let n = na + nb;
    if n == 0.0 {
        return *a;
    }
    let (a, b) = (&with_key_light(a, b), &with_key_light(b, a));
    let mean = |x: vec3, y: vec3| -> vec3 {
        std::array::from_fn(|i| (f64::from(x[i]) + (f64::from(y[i]) - f64::from(x[i])) * nb / n) as f32)
    };
    let squares = |[x, y]: [f32; 2], d: f64| (f64::from(x) + f64::from(y) + d * d * na * nb / n).min(WIDEST) as f32;
    let m2 = std::array::from_fn(|i| {
        let d = f64::from(b.stats.mean[i]) - f64::from(a.stats.mean[i]);
        squares([a.stats.m2[i], b.stats.m2[i]], d)
    });
    let other = |p: &Pixel| f64::from(luminance(Vec3::from(p.stats.mean) - Vec3::from(p.light.direct)));
    let off = other(b) - other(a);
    Pixel {
        stats: PixelStats {
            mean: mean(a.stats.mean, b.stats.mean),
            count: a.stats.count.checked_add(b.stats.count).expect("fewer than 2^32 samples"),
            m2,
            remainder: 0,
            ..Default::default()
        },
        light: PixelLight {
            direct: mean(a.light.direct, b.light.direct),
            indirect_m2: squares([a.light.indirect_m2, b.light.indirect_m2], off),
            albedo: joined_albedo(a, b, mean(a.light.albedo, b.light.albedo)),
            remainder: [ALL_ASTRAY, ALL_PASSED_OVER]
                .into_iter()
                .filter(|mark| is_all(a, *mark) && is_all(b, *mark))
                .fold((a.light.remainder | b.light.remainder) & SOME_BARE, |marks, mark| marks | mark),
            ..Default::default()
        },
    }
}

/// Whether all samples of a pixel have a mark of `glsl/shared/sample_marks.glsl`.
fn is_all(p: &Pixel, mark: u32) -> bool {
    p.stats.count == 0 || p.light.remainder & mark != 0
}

/// A part whose samples all passed over the key light, with the direct light of the other one, as `glsl/film/accumulate.comp` has it.
fn with_key_light(part: &Pixel, other: &Pixel) -> Pixel {
    let mut part = *part;
    let largest = |p: &Pixel| p.light.albedo.into_iter().fold(0.0, f32::max);
    let whole = (part.light.remainder | other.light.remainder) & SOME_BARE == 0;
    let one_surface = whole && largest(other) > ONE_SURFACE * largest(&part);
    if one_surface && is_all(&part, ALL_PASSED_OVER) && !is_all(other, ALL_PASSED_OVER) {
        let light = &mut part.light;
        light.direct =
            std::array::from_fn(|c| if light.albedo[c] > MIN_ALBEDO { other.light.direct[c] } else { light.direct[c] });
    }
    part
}

/// Samples that all went ways that few take give way to others, but where these reflect nothing: as `glsl/film/accumulate.comp` has it.
fn joined_albedo(a: &Pixel, b: &Pixel, mean: vec3) -> vec3 {
    let usual = match [a, b].map(|part| is_all(part, ALL_ASTRAY)) {
        [true, false] => b,
        [false, true] => a,
        _ => return mean,
    };
    std::array::from_fn(|c| if usual.light.albedo[c] > MIN_ALBEDO { usual.light.albedo[c] } else { mean[c] })
}

/// Index of the pixel's next sample; 0 is the first of the render. It equals the count where all samples in the mean belong to
/// this render; from those that were carried over from earlier frames, `glsl/shared/next_sample.glsl` and
/// [`crate::render::Renderer::broken_samples`] take off their number.
pub fn next_sample(s: &PixelStats) -> u32 {
    s.count
}

/// Squared standard error of a pixel's mean: m2 / (n (n - 1)), or 0 for fewer than two samples, which give no estimate.
pub fn variance_of_mean(s: &PixelStats) -> vec3 {
    let n = s.count as f32;
    s.m2.map(|m2| if s.count > 1 { m2 / (n * (n - 1.0)) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Pixel {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let m2 = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        let stats = PixelStats {
            mean: [mean as f32; 3],
            count: n as u32,
            m2: [m2 as f32; 3],
            remainder: 0,
            ..Default::default()
        };
        let light = PixelLight { albedo: stats.mean, indirect_m2: m2 as f32, ..PixelLight::default() };
        Pixel { stats, light }
    }

    #[test]
    fn two_parts_are_the_whole() {
        // 1, 3, 5, 7: mean 4, M2 20, however they are parted; nothing joined to them changes nothing.
        for (a, b) in [(&[1.0][..], &[3.0, 5.0, 7.0][..]), (&[1.0, 3.0], &[5.0, 7.0]), (&[5.0, 1.0, 3.0], &[7.0])] {
            let Pixel { stats: whole, light } = join(&of(a), &of(b));
            assert_eq!((whole.count, whole.mean, whole.m2), (4, [4.0; 3], [20.0; 3]));
            assert!(light.albedo == [4.0; 3] && (light.indirect_m2 - 20.0).abs() < 1e-4, "{light:?}");
        }
        // A part that saw nothing of what glass shows, its albedo white, gives way where the other reflects something.
        let with = |albedo: vec3, remainder: u32| {
            let mut part = of(&[1.0, 3.0]);
            (part.light.albedo, part.light.remainder) = (albedo, remainder);
            part
        };
        let (astray, usual) = (with([1.0; 3], ALL_ASTRAY), with([0.25, 0.0, 0.5], 0));
        let light = |a: &Pixel, b: &Pixel| (join(a, b).light.albedo, join(a, b).light.remainder);
        assert_eq!([light(&astray, &usual), light(&usual, &astray)], [([0.25, 0.5, 0.5], 0); 2]);
        assert_eq!((light(&astray, &astray), join(&astray, &Pixel::default())), (([1.0; 3], ALL_ASTRAY), astray));
        // A part that saw nothing of the key light, whose direct light is 0, counts as if it had seen what the other did, so that the
        // rest of its light, of mean 2 and none of which is direct, is of mean 0.5; that of the other is 2.5.
        let lit = |direct: f32, remainder: u32, values: &[f64]| {
            let mut part = of(values);
            (part.light.direct, part.light.albedo, part.light.remainder) = ([direct; 3], [0.5, 0.5, 0.0], remainder);
            part
        };
        let (unlit, usual) = (lit(0.0, ALL_PASSED_OVER, &[1.0, 3.0]), lit(1.5, 0, &[3.0, 5.0]));
        let light = |a: &Pixel, b: &Pixel| (join(a, b).light.direct, join(a, b).light.remainder);
        assert_eq!([light(&unlit, &usual), light(&usual, &unlit)], [([1.5, 1.5, 0.75], 0); 2], "blue keeps all light");
        assert_eq!(light(&unlit, &unlit), ([0.0; 3], ALL_PASSED_OVER));
        // Where the other part shows a lamp, too, what it sends is not counted for both.
        let bare = lit(1.5, SOME_BARE, &[3.0, 5.0]);
        assert_eq!([light(&unlit, &bare), light(&bare, &usual)], [([0.75; 3], SOME_BARE), ([1.5; 3], SOME_BARE)]);
        let merged = lit(0.5, ALL_PASSED_OVER | SOME_BARE, &[3.0, 5.0]);
        assert_eq!(light(&merged, &usual), ([1.0; 3], SOME_BARE), "as reprojection merges them");
        let some = of(&[1.0, 2.0]);
        assert_eq!((join(&some, &Pixel::default()), join(&Pixel::default(), &some)), (some, some));
        assert_eq!(join(&Pixel::default(), &Pixel::default()), Pixel::default());
    }

    #[test]
    fn broken_samples_add_up_and_the_first_is_kept() {
        let of = |count, pixel, sample, seed| Some(BrokenSamples { count, pixel, sample, seed });
        let (a, b) = (of(2, [9, 1], 3, 0), of(5, [1, 2], 0, 1));
        assert_eq!([BrokenSamples::join(a, b), BrokenSamples::join(b, a)], [of(7, [9, 1], 3, 0); 2]);
        let all = of(u64::MAX, [9, 1], 3, 0);
        assert_eq!(BrokenSamples::join(all, b), all, "counts come from files");
        assert_eq!(
            [BrokenSamples::join(a, None), BrokenSamples::join(None, b), BrokenSamples::join(None, None)],
            [a, b, None]
        );
    }

    #[test]
    fn squares_of_records_far_apart_stay_finite() {
        let far = |mean: f32| Pixel {
            stats: PixelStats { mean: [mean; 3], count: 1, ..PixelStats::default() },
            light: PixelLight::default(),
        };
        let whole = join(&far(0.0), &far(1e38));
        assert_eq!((whole.stats.m2, whole.light.indirect_m2), ([1e35; 3], 1e35));
    }

    #[test]
    fn the_error_of_a_mean_needs_two_samples() {
        assert_eq!(variance_of_mean(&of(&[1.0, 2.0, 3.0, 6.0]).stats), [14.0 / 12.0; 3]);
        assert_eq!(variance_of_mean(&of(&[1.0]).stats), [0.0; 3]);
    }
}
