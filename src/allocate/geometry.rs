//! The policy `geometry` (GEO): importance from normals and positions, before any radiance is known. Kernel:
//! `glsl/allocate/geometry.comp`.
use super::{HostInputs, Inputs, Placing, Policy, PolicyPass};
use crate::error::Result;
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::layout::{Guide, NONE, PriorityPush};
use crate::math::portable::{exp_negative, squared_distance};
use crate::settings::{FINITE_ABOVE_0, settings};
use crate::shaders::geometry::Bind;
use crate::shaders::shared::similarity::SIMILARITY_UNIT;
use serde::Serialize;

/// The entry of this policy in [`super::POLICIES`].
pub const ROW: Policy = Policy {
    name: "geometry",
    about: "more where neighbours differ in normal and position, so that a filter has little to gather (GEO)",
    guides: true,
    split_light: false,
    placing: Placing::Once,
    make: |gpu, _| Ok(Box::new(Geometry::new(gpu)?)),
    reference,
};

settings! {
    /// Which pixels count as similar.
    #[derive(Clone, Copy, Debug, PartialEq, Serialize)]
    pub struct GeometrySettings {
        /// The settings of [`GeometrySettings`] that are given; the others are `None`.
        GeometryOverrides {
            /// Edge of the square of pixels whose geometry is compared.
            window: u32 = 4, 2..=10;
            /// Difference of unit normals that counts as e^-1 alike.
            sigma_normal: f32 = 0.35, FINITE_ABOVE_0;
            /// Distance of hits that counts as e^-1 alike, in diagonals of the scene.
            sigma_position: f32 = 0.003, FINITE_ABOVE_0;
        }
    }
}

pub(super) struct Geometry(Kernel<Bind<'static>>);

impl Geometry {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(Kernel::new(gpu, &gpu.tuning().thread().into())?))
    }
}

impl PolicyPass for Geometry {
    fn record(&self, rec: &mut Recorder, b: &Inputs, push: &PriorityPush) -> Result<()> {
        rec.dispatch_threads(&self.0, Bind { guides: b.guide, priority: b.priority }, push, push.size[0] * push.size[1])
    }
}

/// Similarity of two pixels, in units of 2^-16: [`exp_negative`] of the scaled squared distances.
fn similarity(a: &Guide, b: &Guide, push: &PriorityPush) -> u32 {
    if (a.object == NONE) != (b.object == NONE) {
        return 0;
    }
    let x = squared_distance(a.normal, b.normal) * push.normal_scale
        + squared_distance(a.position, b.position) * push.position_scale;
    (exp_negative(x) * SIMILARITY_UNIT + 0.5) as u32
}

fn importance(inputs: &HostInputs, x: i32, y: i32) -> f32 {
    let [width, height] = inputs.push.size.map(|n| n as i32);
    let at = |x: i32, y: i32| &inputs.guide[(y * width + x) as usize];
    let window = inputs.push.window as i32;
    let reach = |centre: i32, edge: i32| (centre - window / 2).max(0)..(centre + window - window / 2).min(edge);
    let (mut sum, mut count) = (0, 0);
    for qy in reach(y, height) {
        for qx in reach(x, width) {
            sum += similarity(at(x, y), at(qx, qy), &inputs.push);
            count += 1;
        }
    }
    (((count << 16) - sum) / count) as f32 / SIMILARITY_UNIT
}

pub(super) fn reference(inputs: &HostInputs) -> Vec<f32> {
    let [width, height] = inputs.push.size.map(|n| n as i32);
    (0..width * height).map(|i| importance(inputs, i % width, i / width)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_between_two_planes_is_the_worked_example() {
        // Four pixels in a row, two of each plane: window 2 reaches one pixel left and, of one row, nothing up. Pixel 0
        // sees itself alone, 1 and 3 an equal left neighbour, 2 one of the other plane: of 2 pixels 1 differs, q = 1/2.
        let plane = |normal| Guide { normal, ..Guide::default() };
        let guide = [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]].map(plane);
        let push =
            PriorityPush { size: [4, 1], window: 2, normal_scale: 1e6, position_scale: 1.0, ..PriorityPush::default() };
        assert_eq!(
            reference(&HostInputs { guide: &guide, stats: &[], light: &[], priority: &[], push }),
            [0.0, 0.0, 0.5, 0.0]
        );
    }

    #[test]
    fn positions_that_are_no_numbers_are_unlike_all_others() {
        let mut guide = [Guide::default(); 4];
        guide[1].position = [f32::NAN; 3];
        let push = PriorityPush { size: [4, 1], window: 3, position_scale: 1.0, ..PriorityPush::default() };
        let q = reference(&HostInputs { guide: &guide, stats: &[], light: &[], priority: &[], push });
        assert_eq!(q[1], 1.0);
        assert!(q.iter().all(|q| (0.0..=1.0).contains(q)));
    }
}
