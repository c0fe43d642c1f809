//! The policy `both`. It starts from geometry and moves to the noise of the samples as this becomes known, less what a
//! filter of indirect light will remove. Noise is estimated over similar neighbours, from the variance of their samples
//! and from the differences between their means. Kernels: `glsl/allocate/likeness.comp`, `glsl/allocate/both.comp`.
use super::geometry::Geometry;
use super::variance::{moments, noise, window};
use super::{HostInputs, Inputs, Placing, Policy, PolicyPass, geometry};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{Guide, NONE, PixelLight, PixelStats, PriorityPush, vec3};
use crate::math::portable::{exp_negative, squared_distance};
use crate::math::srgb::luminance;
use crate::settings::settings;
use crate::shaders::both::{MAX_DEVIATION, MAX_TINT, MIN_LEFT};
use crate::shaders::likeness::ALBEDO_SCALE;
use crate::shaders::shared::likeness_bits::{GATHERED_UNIT, MIN_KINSHIP, SEVENTHS};
use crate::shaders::{both, likeness};
use glam::Vec3;
use serde::Serialize;

/// The entry of this policy in [`super::POLICIES`].
pub const ROW: Policy = Policy {
    name: "both",
    about: "noise that the samples show, less what a geometry-aware filter will remove; geometry until samples tell",
    guides: true,
    split_light: true,
    placing: Placing::Learning,
    make: |gpu, pixels| Ok(Box::new(Both::new(gpu, pixels)?)),
    reference,
};

settings! {
    /// How the render will be used after sampling.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct BothSettings {
        /// The settings of [`BothSettings`] that are given; the others are `None`.
        BothOverrides {
            /// Share of the variance that a filter will remove where neighbours are alike; 0 is none, as with a noise threshold.
            filtered: f32 = 0.5, 0.0..=1.0;
        }
    }
}

struct Both {
    geometry: Geometry,
    kinship: Kernel<likeness::Bind<'static>>,
    join: Kernel<both::Bind<'static>>,
    /// One word per pixel: first the importance, then importance and [`kinship`] in packed form. It is a buffer of its own so
    /// that the priorities of a resumed render are kept.
    words: Buffer<f32>,
}

impl Both {
    fn new(gpu: &Gpu, pixels: u32) -> Result<Self> {
        let thread = gpu.tuning().thread();
        Ok(Self {
            geometry: Geometry::new(gpu)?,
            kinship: Kernel::new(gpu, &thread.into())?,
            join: Kernel::new(gpu, &thread.into())?,
            words: Buffer::new(gpu, "likeness", pixels as usize, Location::Device)?,
        })
    }
}

impl PolicyPass for Both {
    fn prepare(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        if push.filtered > 0.0 {
            self.geometry.record(rec, &Inputs { priority: &self.words, ..*b }, push)?;
        }
        let bind = likeness::Bind { guides: b.guide, words: &self.words };
        rec.dispatch_threads(&self.kinship, bind, push, push.size[0] * push.size[1])
    }

    fn record(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        let bind = both::Bind { stats: b.stats, words: &self.words, priority: b.priority, light: b.light };
        let rows = push.stride * push.size[1].div_ceil(push.stride * both::ROWS as u32);
        rec.dispatch_threads(&self.join, bind, push, push.size[0] * rows)
    }
}

/// How much the noise of a neighbour tells about that of a pixel, 0 to 1.
fn kinship(a: &Guide, b: &Guide, push: &PriorityPush) -> f32 {
    let apart = |of: fn(&Guide) -> vec3| squared_distance(of(a), of(b));
    let x = apart(|g| g.normal) * push.normal_scale + apart(|g| g.albedo) * ALBEDO_SCALE;
    let alike = (a.material == NONE) == (b.material == NONE);
    let sevenths = if alike { (exp_negative(x) * SEVENTHS + 0.5).floor() } else { 0.0 };
    (sevenths / SEVENTHS).max(MIN_KINSHIP)
}

/// Squared deviations of indirect light, as the mean over the channels, derived from those of its luminance.
fn indirect_squares(stats: &PixelStats, light: &PixelLight) -> f32 {
    let indirect = (Vec3::from(stats.mean) - Vec3::from(light.direct)).abs();
    let level = luminance(indirect);
    let tint = indirect / level;
    let tint = if level > 0.0 { tint.min(Vec3::splat(MAX_TINT)) } else { Vec3::ZERO };
    (light.indirect_m2 * tint.length_squared() / 3.0).min(moments(stats)[0])
}

/// Returns the moments (see [`moments`]) of the pixels around one, weighted by kinship, and the share of their squared
/// deviations that is due to indirect light.
fn surroundings(inputs: &HostInputs, pixel: usize) -> ([f32; 4], f32) {
    let HostInputs { guide, stats, light, push, .. } = inputs;
    let mut around = [0.0; 4];
    let (mut offsets, mut kin_of_all) = (Vec3::ZERO, 0.0);
    let (mut squares, mut weights, mut freedom, mut indirect) = (0.0, 0.0, 0.0, 0.0);
    for j in window(push, pixel).filter(|&j| stats[j].count > 0) {
        let (kin, m) = (kinship(&guide[pixel], &guide[j], push), moments(&stats[j]));
        let offset = Vec3::from(stats[j].mean) - Vec3::from(stats[pixel].mean);
        let offset = offset.clamp(Vec3::splat(-MAX_DEVIATION), Vec3::splat(MAX_DEVIATION));
        around = std::array::from_fn(|k| around[k] + kin * m[k]);
        indirect += kin * indirect_squares(&stats[j], &light[j]);
        offsets += kin * offset;
        kin_of_all += kin;
        squares += kin * offset.length_squared();
        weights += kin * kin;
        freedom += kin / m[3];
    }
    let share = if around[0] > 0.0 { indirect / around[0] } else { 1.0 };
    let left = 1.0 - weights / (kin_of_all * kin_of_all);
    if kin_of_all > 0.0 && left > MIN_LEFT {
        around[0] += (squares - offsets.length_squared() / kin_of_all).max(0.0) / 3.0;
        around[1] += freedom * left;
    }
    (around, share)
}

fn reference(inputs: &HostInputs) -> Vec<f32> {
    let HostInputs { stats, push, .. } = inputs;
    let of = |(i, q): (usize, f32)| {
        let gathered = ((1.0 - q) * GATHERED_UNIT + 0.5).floor() / GATHERED_UNIT;
        let (around, indirect) = surroundings(inputs, i);
        noise(push, moments(&stats[i]), around) * (1.0 - push.filtered * gathered * indirect).max(0.0).sqrt()
    };
    geometry::reference(inputs).into_iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_removes_the_noise_of_indirect_light_alone() {
        // One pixel: gathered is 1, so that a filter of share 0.5 leaves half of the variance of indirect light. Radiance 3 of
        // which 1 is direct, or a key light's 5; of the squared deviations 8, indirect light has 4.
        let push = PriorityPush {
            size: [1, 1],
            window: 2,
            luminance_floor: -1.0,
            limit: 99,
            stride: 1,
            ..PriorityPush::default()
        };
        let of = |direct: f32, indirect_m2: f32, filtered: f32| {
            let light =
                [PixelLight { direct: [direct; 3], albedo: [0.5; 3], indirect_m2, remainder: 0, ..Default::default() }];
            let (guide, stats) = ([Guide::default()], [pixel(3.0, 2, 8.0)]);
            let push = PriorityPush { filtered, ..push };
            let [noise] = reference(&HostInputs { guide: &guide, stats: &stats, light: &light, priority: &[], push })
                .try_into()
                .unwrap();
            noise * noise
        };
        for direct in [1.0, 5.0] {
            let whole = of(direct, 4.0, 0.0);
            let shares = [0.0, 4.0, 8.0, 99.0].map(|m2: f32| of(direct, m2, 0.5) / whole);
            let close = shares.iter().zip([1.0, 0.75, 0.5, 0.5]).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(close, "{direct}: {shares:?}");
        }
    }

    /// Noise of two pixels in one row whose albedos differ by `albedo`.
    fn pair(stats: [PixelStats; 2], albedo: f32) -> [f32; 2] {
        let push = PriorityPush {
            size: [2, 1],
            window: 2,
            luminance_floor: 0.0,
            limit: 99,
            stride: 1,
            ..PriorityPush::default()
        };
        let guide = [0.0, albedo].map(|albedo| Guide { albedo: [albedo; 3], ..Guide::default() });
        let light = [PixelLight::default(); 2];
        reference(&HostInputs { guide: &guide, stats: &stats, light: &light, priority: &[], push }).try_into().unwrap()
    }

    fn assert_close(found: [f32; 2], expected: [f32; 2]) {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} {expected:?}");
    }

    fn pixel(mean: f32, count: u32, m2: f32) -> PixelStats {
        PixelStats { mean: [mean; 3], count, m2: [m2; 3], remainder: 0, ..Default::default() }
    }

    #[test]
    fn noise_is_that_of_neighbours_that_look_alike() {
        // Of 2 samples each, m2 = 8 and 0, the same mean: one degree of freedom each, and half of one, as each mean counts half
        // and one of both says nothing. The variance around, 8 / 2.5, is worth 32 samples beside the pixel's own.
        let stats = [pixel(1.0, 2, 8.0), pixel(1.0, 2, 0.0)];
        let expected = |own: f32, around: f32| ((own + 32.0 * around) / 33.0).sqrt();
        assert_close(pair(stats, 0.0), [expected(8.0, 8.0 / 2.5), expected(0.0, 8.0 / 2.5)]);
        // Of other albedo, the other pixel counts a fifth: of the means' freedom 1.2 / 2 * (1 - 1.04 / 1.44) = 1/6 is left.
        let freedom = 1.2 + 1.0 / 6.0;
        assert_close(pair(stats, 9.0), [expected(8.0, 8.0 / freedom), expected(0.0, 1.6 / freedom)]);
    }

    #[test]
    fn after_one_sample_each_the_means_tell_of_noise() {
        // Samples 1 and 3: m2 about their mean is 2, of one degree of freedom; the luminance around is 2. Nothing else is
        // known: 32 * 2 / 32.
        assert_close(pair([pixel(1.0, 1, 0.0), pixel(3.0, 1, 0.0)], 0.0), [2.0_f32.sqrt() / 2.0; 2]);
        assert_eq!(pair([pixel(1.0, 1, 0.0), PixelStats::default()], 0.0), [1.0; 2], "one sample alone says nothing");
    }
}
