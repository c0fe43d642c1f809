//! What a device is tuned to, and what follows from that and from its subgroups.
use super::{Gpu, Tuning};
use crate::shaders::shared;

impl Gpu {
    /// Among how many lanes kernels deal triangles; none where they do not.
    pub fn deal(&self) -> shared::deal::Constants {
        let (info, tuning) = (self.info(), self.tuning());
        let lanes = info.subgroup_size;
        let whole =
            info.subgroup_size_fixed && matches!(lanes, 4 | 8 | 16 | 32) && tuning.workgroup.is_multiple_of(lanes);
        shared::deal::Constants { lanes: if tuning.deals && info.subgroup_shuffle && whole { lanes } else { 0 } }
    }

    /// The sizes into which work is divided: see [`DeviceOptions::tuning`](super::DeviceOptions::tuning).
    pub fn tuning(&self) -> &Tuning {
        &self.0.tuning
    }
}
