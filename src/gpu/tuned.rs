//! What a device is tuned to, and what follows from that and from its subgroups.
use super::{DeviceKind, Gpu, Tuning};
use crate::shaders::shared;

impl Gpu {
    /// Among how many lanes kernels deal triangles; none where they do not. Dealing needs all lanes of a subgroup at the same place of
    /// the code. Drivers that run on a CPU keep them together; a GPU may not: on an H200 rays missed triangles, and took longer.
    pub fn deal(&self) -> shared::deal::Constants {
        let (info, tuning) = (self.info(), self.tuning());
        let lanes = info.subgroup_size;
        let whole =
            info.subgroup_size_fixed && matches!(lanes, 4 | 8 | 16 | 32) && tuning.workgroup.is_multiple_of(lanes);
        let together = info.subgroup_shuffle && info.kind == DeviceKind::Cpu;
        let gains = together && shuffles_at_once(lanes, has_avx2());
        shared::deal::Constants { lanes: if tuning.deals && gains && whole { lanes } else { 0 } }
    }

    /// The sizes into which work is divided: see [`DeviceOptions::tuning`](super::DeviceOptions::tuning).
    pub fn tuning(&self) -> &Tuning {
        &self.0.tuning
    }
}

/// Whether the lanes of a subgroup on a CPU read each other's values by one instruction, as llvmpipe does for eight lanes with AVX2. Where
/// triangles are dealt in vectors of 128 bits, which ARM and x86 before AVX have, renders of bust and grass take 2.8 of
/// the time that they take where each ray tests its own; in vectors of 512 bits 5.3 and 5.9 of it.
fn shuffles_at_once(lanes: u32, avx2: bool) -> bool {
    lanes == 8 && avx2
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    std::is_x86_feature_detected!("avx2")
}

#[cfg(not(target_arch = "x86_64"))]
fn has_avx2() -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_dealt_where_lanes_read_each_other_by_one_instruction() {
        assert!(shuffles_at_once(8, true));
        assert!([4, 8, 16].iter().all(|&lanes| !shuffles_at_once(lanes, false)), "ARM, x86 before AVX2");
        assert!([4, 16].iter().all(|&lanes| !shuffles_at_once(lanes, true)), "vectors of 128 and 512 bits");
    }
}
