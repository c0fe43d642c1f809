//! Geometry first, noise as it becomes known, less what a filter will remove. Kernel: `glsl/both.comp`.
use super::geometry::Geometry;
use super::{HostInputs, Inputs, Placing, Policy, Row, geometry, variance};
use crate::error::Result;
use crate::gpu::layout::{Effects, PriorityPush};
use crate::gpu::{Buffer, Gpu, Location, Recorder};
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
    fn record(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        self.geometry.record(rec, &Inputs { priority: &self.importance, ..*b }, push)?;
        let bind = Bind { stats: b.stats, importances: &self.importance, priority: b.priority };
        self.join.record(rec, bind, push, push.size[0] * push.size[1])
    }
}

fn reference(inputs: &HostInputs) -> Vec<f32> {
    let left = |q: f32| (1.0 - inputs.push.filtered * (1.0 - q)).max(0.0).sqrt();
    let noise = variance::reference(inputs);
    geometry::reference(inputs).into_iter().zip(noise).map(|(q, noise)| noise * left(q)).collect()
}
