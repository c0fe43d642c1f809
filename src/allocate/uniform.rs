//! The policy `uniform`: the same number of samples for every pixel. It is the baseline of the other policies.
use super::{HostInputs, Inputs, Placing, Policy, PolicyPass};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::layout::PriorityPush;

/// The entry of this policy in [`super::POLICIES`].
pub const ROW: Policy = Policy {
    name: "uniform",
    about: "the same number for every pixel",
    guides: false,
    split_light: false,
    placing: Placing::Even,
    make: |_, _| Ok(Box::new(Uniform)),
    reference,
};

struct Uniform;

impl PolicyPass for Uniform {
    fn record(&self, rec: &mut Recorder, b: &Inputs, _: &PriorityPush) -> Result<()> {
        rec.fill(b.priority, 1.0_f32.to_bits())
    }
}

fn reference(inputs: &HostInputs) -> Vec<f32> {
    vec![1.0; (inputs.push.size[0] * inputs.push.size[1]) as usize]
}
