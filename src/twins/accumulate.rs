//! Twin of `glsl/film/accumulate.comp`: Welford's running mean and variance (1962), in order of sample index.
use crate::layout::{BrokenTally, FoldPush, PixelLight, PixelStats, vec3, vec4};
use crate::math::hash::{pcg, unit_interval};
use crate::math::srgb::luminance;
use crate::shaders;
use crate::shaders::accumulate::{MAX_DEVIATION, MAX_M2, MAX_ROUNDED_SAMPLES, MIN_ALBEDO, ONE_SURFACE};
use crate::shaders::shared::sample_marks::{ALL_ASTRAY, ALL_PASSED_OVER, ASTRAY, PASSED_OVER, SOME_BARE};
use crate::statistics::next_sample;
use glam::{Vec3, Vec4};

/// Bits of a mean's remainder, for each channel, of all light.
const BITS: u32 = shaders::accumulate::BITS as u32;
/// Of direct light, and of albedo.
const DIRECT_BITS: u32 = shaders::accumulate::DIRECT_BITS as u32;
const ALBEDO_BITS: u32 = shaders::accumulate::ALBEDO_BITS as u32;

/// What a sample brings besides its radiance.
struct Split {
    /// Light that needs no filter.
    direct: Vec3,
    albedo: Vec3,
}

/// Parts the light of sample number `count`. w of `noted` holds its marks: see the kernel, which sets no [`SOME_BARE`] where no light
/// can be a key light.
fn split(l: &mut PixelLight, direct: Vec3, radiance: Vec3, noted: Vec4, count: u32) -> Split {
    let marks = noted.w as u32;
    let albedo = albedo_along(l, noted.truncate(), marks & ASTRAY != 0, count);
    let unreflected = albedo.cmple(Vec3::splat(MIN_ALBEDO));
    let (direct, before) = (Vec3::select(unreflected, radiance, direct), Vec3::from(l.direct));
    let passed_over = marks & PASSED_OVER != 0;
    let all_before = count == 1 || l.remainder & ALL_PASSED_OVER != 0;
    l.remainder |= if unreflected.all() { SOME_BARE } else { 0 };
    let alike = Vec3::from(l.albedo).max_element() > ONE_SURFACE * albedo.max_element();
    let one_surface = count > 1 && alike && l.remainder & SOME_BARE == 0;
    l.remainder = (l.remainder & !ALL_PASSED_OVER) | if passed_over && all_before { ALL_PASSED_OVER } else { 0 };
    match one_surface && passed_over != all_before {
        true if passed_over => return Split { direct: Vec3::select(unreflected, direct, before), albedo },
        true => l.direct = Vec3::select(unreflected, before, direct).into(),
        false => {}
    }
    Split { direct, albedo }
}

/// Adds a batch to the statistics of all pixels. `samples`: sample k of pixel i at `k * push.pixels + i`, one vec4, or
/// with `split_light` three (direct, indirect, albedo); without it `light` does not change. Returns how many samples were not
/// finite, which a negative w of the first vec4 marks, and the first of them.
pub fn fold(
    push: &FoldPush,
    split_light: bool,
    samples: &[vec4],
    stats: &mut [PixelStats],
    light: &mut [PixelLight],
) -> BrokenTally {
    let mut broken = BrokenTally::default();
    for i in 0..push.pixels as usize {
        let pixel = push.first_pixel as usize + i;
        for k in 0..push.samples as usize {
            let at = k * push.pixels as usize + i;
            let record = if split_light { 3 * at } else { at };
            if samples[record][3] < 0.0 {
                report(&mut broken, push.tile + pixel as u32, next_sample(&stats[pixel]));
            }
            if split_light {
                let [direct, indirect] = [0, 1].map(|j| Vec4::from(samples[record + j]).truncate());
                let (s, l, radiance) = (&mut stats[pixel], &mut light[pixel], direct + indirect);
                let split = split(l, direct, radiance, samples[record + 2].into(), s.count + 1);
                let (added, before) = (luminance(radiance - split.direct), other(s, l));
                fold_radiance(s, radiance);
                fold_light(l, &split, s.count);
                let squares = cut_product(added - before, added - other(s, l));
                l.indirect_m2 = (l.indirect_m2 + squares).clamp(0.0, MAX_M2);
            } else {
                fold_radiance(&mut stats[pixel], Vec4::from(samples[record]).truncate());
            }
        }
    }
    broken
}

/// Pixels come in order, and so do the samples of each.
fn report(broken: &mut BrokenTally, pixel: u32, sample: u32) {
    if broken.count == 0 {
        (broken.lowest, broken.pixel, broken.index) = (!pixel, !pixel, sample);
    }
    broken.count += 1;
}

/// 2^-bits of the last place of `mean`.
fn unit(mean: f32, bits: u32) -> f32 {
    let power = f32::from_bits(mean.to_bits() & 0x7f80_0000);
    (power * f32::EPSILON / (1u32 << bits) as f32).max(1e-37)
}

/// A word of remainders, and the number of samples of the mean.
struct Kept<'a> {
    word: &'a mut u32,
    count: u32,
}

/// Moves one channel of a mean by a step. The remainder holds what rounding has taken off, `bits` from bit `at` on; it is rounded
/// up or down at random.
fn move_channel(mean: f32, by: f32, remainder: &mut Kept, at: u32, bits: u32) -> f32 {
    let kept = ((*remainder.word << (32 - at - bits)) as i32) >> (32 - bits);
    let added = kept as f32 * unit(mean, bits) + by;
    let moved = mean + added;
    let lost = added - (moved - mean);
    let end = (1 << (bits - 1)) as f32;
    let up = unit_interval(pcg(remainder.count));
    let rounded = (lost / unit(moved, bits) + up).floor();
    // A remainder of half the last place or more moves the mean to the next number: cutting it off would bias the mean.
    let (moved, rounded) = match rounded >= end {
        true => (moved + unit(moved, bits) * (2.0 * end), -end),
        false => (moved, rounded),
    };
    let kept = rounded.clamp(-end, end - 1.0) as i32;
    let mask = ((1 << bits) - 1) << at;
    *remainder.word = (*remainder.word & !mask) | (((kept as u32) << at) & mask);
    moved
}

fn move_mean(mean: vec3, by: Vec3, mut remainder: Kept, at: u32, bits: u32) -> Vec3 {
    let by = by.to_array();
    [0, 1, 2].map(|c| move_channel(mean[c], by[c], &mut remainder, at + c as u32 * bits, bits)).into()
}

fn cut_product(a: f32, b: f32) -> f32 {
    a.clamp(-MAX_DEVIATION, MAX_DEVIATION) * b.clamp(-MAX_DEVIATION, MAX_DEVIATION)
}

fn fold_radiance(s: &mut PixelStats, radiance: Vec3) {
    s.count += 1;
    let off = radiance - Vec3::from(s.mean);
    let by = off * (1.0 / s.count as f32);
    let mean = match s.count <= MAX_ROUNDED_SAMPLES {
        true => Vec3::from(s.mean) + by,
        false => move_mean(s.mean, by, Kept { word: &mut s.remainder, count: s.count }, 0, BITS),
    };
    s.mean = mean.into();
    let moved = radiance - mean;
    s.m2 = std::array::from_fn(|c| (s.m2[c] + cut_product(off[c], moved[c])).min(MAX_M2));
}

/// Luminance of the mean of all light that is not kept.
fn other(s: &PixelStats, l: &PixelLight) -> f32 {
    luminance(Vec3::from(s.mean) - Vec3::from(l.direct))
}

/// The albedo of sample number `count`.
fn albedo_along(l: &mut PixelLight, seen: Vec3, astray: bool, count: u32) -> Vec3 {
    if count > 1 && astray {
        return l.albedo.into();
    }
    if count > 1 && l.remainder & ALL_ASTRAY != 0 {
        let white = Vec3::from(l.albedo);
        l.albedo = Vec3::select(seen.cmple(Vec3::splat(MIN_ALBEDO)), white, seen).into();
    }
    l.remainder = (l.remainder & !ALL_ASTRAY) | if astray { ALL_ASTRAY } else { 0 };
    seen
}

fn fold_light(l: &mut PixelLight, s: &Split, count: u32) {
    let share = 1.0 / count as f32;
    let (direct, albedo) = (Vec3::from(l.direct), Vec3::from(l.albedo));
    let [by, albedo_by] = [(s.direct - direct) * share, (s.albedo - albedo) * share];
    let [direct, albedo] = match count <= MAX_ROUNDED_SAMPLES {
        true => [direct + by, albedo + albedo_by],
        false => {
            let word = &mut l.remainder;
            let direct = move_mean(l.direct, by, Kept { word, count }, 0, DIRECT_BITS);
            [direct, move_mean(l.albedo, albedo_by, Kept { word, count }, 3 * DIRECT_BITS, ALBEDO_BITS)]
        }
    };
    (l.direct, l.albedo) = (direct.into(), albedo.into());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_batches_solve_the_worked_example() {
        // 1, 2 then 3, 6: mean 3, squared deviations 4 + 1 + 0 + 9 = 14.
        let mut stats = [PixelStats::default()];
        let batch = FoldPush { pixels: 1, samples: 2, ..FoldPush::default() };
        fold(&batch, false, &[[1.0; 4], [2.0; 4]], &mut stats, &mut []);
        fold(&batch, false, &[[3.0; 4], [6.0; 4]], &mut stats, &mut []);
        assert_eq!((stats[0].count, stats[0].mean[1], stats[0].m2[2], stats[0].remainder), (4, 3.0, 14.0, 0));
    }

    #[test]
    fn light_without_albedo_stays_direct() {
        let s = split(&mut PixelLight::default(), Vec3::ONE, Vec3::splat(3.0), glam::vec4(0.5, 0.0, 1.0, 0.0), 1);
        assert_eq!(s.direct, glam::vec3(1.0, 3.0, 1.0));
    }

    #[test]
    fn ways_that_few_samples_take_do_not_count() {
        let stray = |albedo: f32| [[0.0; 4], [1.0; 4], [albedo, albedo, albedo, 1.0]];
        let usual = |albedo: f32| [[0.0; 4], [1.0; 4], [albedo, albedo, albedo, 0.0]];
        for (samples, albedo, alone) in [
            (vec![stray(0.9), stray(1.0)], 0.9, true),
            (vec![stray(0.9), stray(1.0), usual(0.25), stray(1.0)], 0.25, false),
            (vec![usual(0.25), usual(0.75), stray(1.0)], 0.5, false),
        ] {
            let (mut stats, mut light) = ([PixelStats::default()], [PixelLight::default()]);
            for sample in &samples {
                fold(&FoldPush { pixels: 1, samples: 1, ..FoldPush::default() }, true, sample, &mut stats, &mut light);
            }
            assert_eq!((light[0].albedo, light[0].remainder != 0), ([albedo; 3], alone), "{samples:?}");
        }
        // Sky beside what a way that few take has brought: 1 of other light, over an albedo of 1, in one of two samples.
        let (mut stats, mut light) = ([PixelStats::default()], [PixelLight::default()]);
        let samples = [stray(1.0), [[4.0; 4], [0.0; 4], [0.0; 4]]].concat();
        fold(&FoldPush { pixels: 1, samples: 2, ..FoldPush::default() }, true, &samples, &mut stats, &mut light);
        let PixelLight { direct, albedo, .. } = light[0];
        assert_eq!((stats[0].mean, direct, albedo), ([2.5; 3], [2.0; 3], [0.5; 3]), "nothing is lost");
    }

    #[test]
    fn samples_that_pass_over_the_key_light_count_as_the_others() {
        // Choices of a light that brings 3 half of the time: 3 of it are direct, and 3 more in place of what is not chosen; the other light
        // brings 1, 2 where it is chosen. All light is 4 on average, direct light 3 without noise, the rest 1 +- 2 or 1.
        let (key, other) = ([[3.0; 4], [3.0; 4], [0.5, 0.5, 0.5, 0.0]], [[0.0; 4], [2.0; 4], [0.5, 0.5, 0.5, 2.0]]);
        let folded = |samples: &[[vec4; 3]]| {
            let (mut stats, mut light) = ([PixelStats::default()], [PixelLight::default()]);
            for sample in samples {
                fold(&FoldPush { pixels: 1, samples: 1, ..FoldPush::default() }, true, sample, &mut stats, &mut light);
            }
            (stats[0].mean[0], light[0].direct[0], light[0].indirect_m2, light[0].remainder)
        };
        // The rest of the four: 3, -1, -1, 3, whose squared deviations from 1 are 4 each, in any order.
        for order in
            [[key, other, other, key], [other, other, key, key], [key, key, other, other], [other, key, key, other]]
        {
            let (mean, direct, m2, remainder) = folded(&order);
            assert_eq!((mean, direct, remainder), (4.0, 3.0, 0));
            assert!((m2 - 16.0).abs() < 1e-4, "{m2}");
        }
        let (mean, direct, m2, remainder) = folded(&[other, other]);
        assert_eq!((mean, direct, remainder), (2.0, 0.0, ALL_PASSED_OVER));
        assert!(m2.abs() < 1e-6, "{m2}");
        // Of a pixel that shows the sky beside the surface, samples bring what they bring: the sky is not counted for others.
        let sky = [[8.0; 4], [0.0; 4], [0.0; 4]];
        let (early, late) = ([sky, other, other, other], [key, key, key, key, key, sky, other, other]);
        for order in [&early[..], &[other, sky, other, other], &[other, sky, key, other], &late] {
            let kept = order.iter().map(|sample| sample[0][0]).sum::<f32>() / order.len() as f32;
            let (_, direct, _, remainder) = folded(order);
            assert!((direct - kept).abs() < 1e-6, "{direct}, expected {kept}: {order:?}");
            assert_eq!(remainder, SOME_BARE, "{order:?}");
        }
        // A channel without albedo keeps all light there is.
        let dark = |mut sample: [vec4; 3]| {
            sample[2][0] = 0.0;
            sample
        };
        assert_eq!(folded(&[dark(other), dark(key)]).1, 4.0);
    }

    #[test]
    fn squares_are_those_of_the_light_that_is_not_kept() {
        // Direct light 8 and 0; 1, 3 besides: mean 2, squared deviations 1 + 1. Albedo .25 and .75.
        let sample = |direct: f32, other: f32, albedo: f32| [[direct; 4], [other; 4], [albedo; 4]];
        let samples = [sample(8.0, 1.0, 0.25), sample(0.0, 3.0, 0.75)].concat();
        let (mut stats, mut light) = ([PixelStats::default()], [PixelLight::default()]);
        fold(&FoldPush { pixels: 1, samples: 2, ..FoldPush::default() }, true, &samples, &mut stats, &mut light);
        let PixelLight { direct, indirect_m2, albedo, .. } = light[0];
        assert_eq!((stats[0].mean, direct, albedo), ([6.0; 3], [4.0; 3], [0.5; 3]));
        assert!((indirect_m2 - 2.0).abs() < 1e-5, "{indirect_m2}");
    }
}
