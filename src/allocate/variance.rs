//! The policy `variance` (RAS, but with the noise estimated anew in every round). Kernel: `glsl/allocate/variance.comp`.
use super::{HostInputs, Inputs, Placing, Policy, PolicyPass};
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::{PixelStats, PriorityPush};
use crate::math::srgb::luminance;
use crate::settings::{FINITE, settings};
use crate::shaders::shared::pixel_noise::{MAX_LUMINANCE, PRIOR_SAMPLES};
use crate::shaders::variance::Bind;
use serde::Serialize;

/// The entry of this policy in [`super::POLICIES`].
pub const ROW: Policy = Policy {
    name: "variance",
    about: "more where samples differ, relative to their luminance, estimated anew every round (RAS)",
    guides: false,
    split_light: false,
    placing: Placing::Learning,
    make: |gpu, _| Ok(Box::new(Variance(Kernel::new(gpu, &gpu.tuning().thread().into())?))),
    reference,
};

settings! {
    /// How noise is measured, in this policy and in [`both`](super::both) and [`threshold`](super::threshold).
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct VarianceSettings {
        /// The settings of [`VarianceSettings`] that are given; the others are `None`.
        VarianceOverrides {
            /// Luminance added before noise is compared with it; negative: noise counts by itself, below 1e-6 as none, above 4095 as 4095.
            luminance_floor: f32 = 0.05, FINITE;
        }
    }
}

struct Variance(Kernel<Bind<'static>>);

impl PolicyPass for Variance {
    fn record(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        rec.dispatch_threads(&self.0, Bind { stats: b.stats, priority: b.priority }, push, push.size[0] * push.size[1])
    }
}

/// Returns the sum of squared deviations (mean over channels), the degrees of freedom, the luminance times the number of
/// samples, and that number.
pub(super) fn moments(s: &PixelStats) -> [f32; 4] {
    if s.count == 0 {
        return [0.0; 4];
    }
    let n = s.count as f32;
    [(s.m2[0] + s.m2[1] + s.m2[2]) / 3.0, n - 1.0, luminance(s.mean).min(MAX_LUMINANCE) * n, n]
}

/// One pixel and the eight around it, a stride apart, that lie on the film, row by row.
pub(super) fn window(push: &PriorityPush, pixel: usize) -> impl Iterator<Item = usize> {
    let [width, height, stride] = [push.size[0], push.size[1], push.stride].map(|n| n as usize);
    let [x, y] = [pixel % width, pixel / width];
    let beside = move |at: usize, end: usize| {
        (0..3).filter_map(move |k| (at + k * stride).checked_sub(stride)).filter(move |&at| at < end)
    };
    beside(y, height).flat_map(move |y| beside(x, width).map(move |x| y * width + x))
}

/// Twin of the function in `glsl/shared/pixel_noise.glsl`.
pub(super) fn noise(push: &PriorityPush, own: [f32; 4], around: [f32; 4]) -> f32 {
    if around[1] == 0.0 {
        return 1.0;
    }
    let variance = (own[0] + PRIOR_SAMPLES * around[0] / around[1]) / (own[1] + PRIOR_SAMPLES);
    let floor = push.luminance_floor;
    let scale = if floor < 0.0 { 1.0 } else { around[2] / around[3] + floor };
    let relative = variance.sqrt() / scale.max(1e-20);
    let good = own[3] > 0.0 && relative < push.threshold * own[3].sqrt();
    if good || own[3] >= push.limit as f32 { 0.0 } else { relative }
}

pub(super) fn reference(inputs: &HostInputs) -> Vec<f32> {
    let HostInputs { stats, push, .. } = inputs;
    let of = |i: usize| {
        let around = window(push, i).map(|j| moments(&stats[j]));
        let sum = around.fold([0.0; 4], |sum: [f32; 4], m| std::array::from_fn(|k| sum[k] + m[k]));
        noise(push, moments(&stats[i]), sum)
    };
    (0..stats.len()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn push() -> PriorityPush {
        PriorityPush {
            size: [1, 1],
            window: 4,
            normal_scale: 1.0,
            position_scale: 1.0,
            luminance_floor: 1.0,
            limit: 100,
            stride: 1,
            ..Default::default()
        }
    }

    fn of_one(stats: PixelStats, push: PriorityPush) -> f32 {
        reference(&HostInputs { guide: &[], stats: &[stats], light: &[], priority: &[], push })[0]
    }

    #[test]
    fn noise_is_the_deviation_over_the_luminance() {
        // Samples 2 and 6: mean 4, m2 = 8, variance 8 from one degree of freedom, and so around; sqrt 8 / (4 + 1).
        let stats = PixelStats { mean: [4.0; 3], count: 2, m2: [8.0; 3], remainder: 0, ..Default::default() };
        assert!((of_one(stats, push()) - 8.0_f32.sqrt() / 5.0).abs() < 1e-6);
        let plain = PriorityPush { luminance_floor: -1.0, ..push() };
        assert!((of_one(stats, plain) - 8.0_f32.sqrt()).abs() < 1e-6);
    }

    #[test]
    fn a_mean_below_the_threshold_wants_nothing_and_an_unknown_one_something() {
        // Relative error of the mean: sqrt 8 / 5 / sqrt 2 = 0.4.
        let stats = PixelStats { mean: [4.0; 3], count: 2, m2: [8.0; 3], remainder: 0, ..Default::default() };
        assert_eq!(of_one(stats, PriorityPush { threshold: 0.41, ..push() }), 0.0);
        assert!(of_one(stats, PriorityPush { threshold: 0.39, ..push() }) > 0.0);
        assert_eq!(of_one(PixelStats::default(), push()), 1.0);
        assert_eq!(of_one(PixelStats { count: 1, ..stats }, PriorityPush { threshold: 9.0, ..push() }), 1.0);
    }
}
