//! The policy `threshold` (RAS as published): the noise of a pixel is compared with a threshold that falls from round to
//! round; after the last round, each pixel keeps a fixed probability. Kernel: `glsl/allocate/threshold.comp`;
//! `render::pass::choose` turns its priorities into samples.
use super::variance::moments;
use super::{HostInputs, Inputs, Placing, Policy, PolicyPass};
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::{PixelStats, PriorityPush};
use crate::shaders::threshold::Bind;

/// The entry of this policy in [`super::POLICIES`].
pub const ROW: Policy = Policy {
    name: "threshold",
    about: "RAS as published: a sample a round where noise reaches a threshold that falls to 0 by --max-spp, then by chance; below \
            --min-spp 16 it brightens",
    guides: false,
    split_light: false,
    placing: Placing::Chosen,
    make: |gpu, _| Ok(Box::new(Threshold(Kernel::new(gpu, &gpu.tuning().thread().into())?))),
    reference,
};

struct Threshold(Kernel<Bind<'static>>);

impl PolicyPass for Threshold {
    fn record(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        rec.dispatch_threads(&self.0, Bind { stats: b.stats, priority: b.priority }, push, push.size[0] * push.size[1])
    }
}

fn reference(inputs: &HostInputs) -> Vec<f32> {
    let PriorityPush { round, limit, luminance_floor, .. } = inputs.push;
    let noise = |s: &PixelStats| {
        let [squares, freedom, luminance, n] = moments(s);
        let deviation = (squares / freedom).max(0.0).sqrt();
        match (n < 2.0, luminance_floor < 0.0) {
            (true, _) => 1.0,
            (_, true) => deviation,
            _ => (deviation + luminance_floor) / (luminance / n + luminance_floor).max(1e-20),
        }
    };
    match round.cmp(&limit) {
        std::cmp::Ordering::Less => inputs.stats.iter().map(noise).collect(),
        std::cmp::Ordering::Equal => inputs.stats.iter().map(|s| s.count as f32 / limit as f32).collect(),
        std::cmp::Ordering::Greater => inputs.priority.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of_one(stats: PixelStats, round: u32) -> f32 {
        let push = PriorityPush { size: [1, 1], luminance_floor: 1.0, limit: 8, round, ..PriorityPush::default() };
        reference(&HostInputs { guide: &[], stats: &[stats], light: &[], priority: &[0.25], push })[0]
    }

    #[test]
    fn noise_counts_until_the_last_threshold_and_the_share_of_samples_after() {
        // Samples 2 and 6: mean 4, m2 = 8, variance 8; (sqrt 8 + 1) / (4 + 1). By round 8 it has 2 of 8 samples.
        let stats = PixelStats { mean: [4.0; 3], count: 2, m2: [8.0; 3], remainder: 0, ..Default::default() };
        assert!((of_one(stats, 7) - (8.0_f32.sqrt() + 1.0) / 5.0).abs() < 1e-6);
        assert_eq!(of_one(stats, 8), 0.25);
        assert_eq!(of_one(PixelStats { count: 7, ..stats }, 9), 0.25, "frozen");
        // Black so far: (0 + 1) / (0 + 1) reaches every threshold. One sample: nothing is known.
        assert_eq!(of_one(PixelStats { count: 4, ..PixelStats::default() }, 4), 1.0);
        assert_eq!(of_one(PixelStats { mean: [9.0; 3], count: 1, ..PixelStats::default() }, 4), 1.0);
    }
}
