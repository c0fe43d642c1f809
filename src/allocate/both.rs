//! Geometry first, noise as it becomes known, estimated among neighbours that look alike, less what a filter will remove.
//! Kernel: `glsl/both.comp`.
use super::geometry::Geometry;
use super::variance::{moments, noise, square};
use super::{HostInputs, Inputs, Placing, Policy, Row, geometry};
use crate::error::Result;
use crate::gpu::layout::{Effects, Guide, NONE, PriorityPush, vec3};
use crate::gpu::{Buffer, Gpu, Location, Recorder};
use crate::reference::exact::{exp_negative, squared_distance};
use crate::shaders::both::Bind;
use crate::stage::PerThread;

pub(super) const ROW: Row = Row {
    name: "both",
    about: "noise that the samples show, less what a geometry-aware filter will remove; geometry until samples tell",
    guides: true,
    placing: Placing::Learning,
    make: |gpu, pixels, workgroup| Ok(Box::new(Both::new(gpu, pixels, workgroup)?)),
    reference,
};

struct Both {
    geometry: Geometry,
    join: PerThread<Bind<'static>>,
    importance: Buffer<f32>,
}

impl Both {
    fn new(gpu: &Gpu, pixels: u32, workgroup: u32) -> Result<Self> {
        Ok(Self {
            geometry: Geometry::new(gpu, workgroup)?,
            join: PerThread::new(gpu, &Effects::default(), workgroup)?,
            importance: Buffer::new(gpu, "importance", pixels as usize, Location::Device)?,
        })
    }
}

impl Policy for Both {
    fn prepare(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        if push.filtered > 0.0 {
            self.geometry.record(rec, &Inputs { priority: &self.importance, ..*b }, push)?;
        }
        Ok(())
    }

    fn record(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        let bind = Bind { guides: b.guide, stats: b.stats, importances: &self.importance, priority: b.priority };
        self.join.record(rec, bind, push, push.size[0] * push.size[1])
    }
}

/// Of pixels that look nothing alike.
const LEAST_KINSHIP: f32 = 0.2;

/// How much a neighbour's noise says of a pixel's, 0 to 1.
fn kinship(a: &Guide, b: &Guide, push: &PriorityPush) -> f32 {
    let apart = |of: fn(&Guide) -> vec3| squared_distance(of(a), of(b));
    let x = apart(|g| g.normal) * push.normal_scale + apart(|g| g.albedo) * 25.0;
    let alike = (a.material == NONE) == (b.material == NONE);
    if alike { exp_negative(x).max(LEAST_KINSHIP) } else { LEAST_KINSHIP }
}

fn reference(inputs: &HostInputs) -> Vec<f32> {
    let HostInputs { guide, stats, push, .. } = inputs;
    let of = |(i, q): (usize, f32)| {
        let mut around = [0.0; 4];
        for j in square(push, i) {
            let (kin, m) = (kinship(&guide[i], &guide[j], push), moments(&stats[j]));
            around = std::array::from_fn(|k| around[k] + kin * m[k]);
        }
        noise(push, moments(&stats[i]), around) * (1.0 - push.filtered * (1.0 - q)).max(0.0).sqrt()
    };
    geometry::reference(inputs).into_iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::PixelStats;

    #[test]
    fn noise_is_that_of_neighbours_that_look_alike() {
        // Two pixels of 2 samples, m2 = 8 and 0, in one row: of the 3 columns around a pixel the one beyond the film holds the
        // pixel itself, so that it counts 2 and the other 1. Every pixel has one degree of freedom; the mean variance
        // around, 16/3 and 8/3, is worth 32 samples beside the pixel's own. Of other albedo, the other pixel counts a
        // fifth: 16 / 2.2 and 1.6 / 2.2.
        let stats = [8.0, 0.0].map(|m2| PixelStats { mean: [1.0; 3], count: 2, m2: [m2; 3], rays: 0 });
        let push = PriorityPush { size: [2, 1], window: 2, luminance_floor: 0.0, limit: 99, ..PriorityPush::default() };
        let of = |albedo| {
            let guide = [0.0, albedo].map(|albedo| Guide { albedo: [albedo; 3], ..Guide::default() });
            reference(&HostInputs { guide: &guide, stats: &stats, priority: &[], push })
        };
        let close = |found: Vec<f32>, expected: [f32; 2]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
        let expected = |own: f32, around: f32| ((own + 32.0 * around) / 33.0).sqrt();
        assert!(close(of(0.0), [expected(8.0, 16.0 / 3.0), expected(0.0, 8.0 / 3.0)]), "{:?}", of(0.0));
        assert!(close(of(9.0), [expected(8.0, 16.0 / 2.2), expected(0.0, 1.6 / 2.2)]), "{:?}", of(9.0));
    }
}
