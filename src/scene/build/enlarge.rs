//! Enlarges meshes that are tiny in their own space, and makes their instances as much smaller: rays are traced in the space of a mesh, by
//! products of three lengths, which 32 bits have no room for where these are below 1e-13.
use super::plan::{Job, Plan};
use super::sources::Sources;
use super::store::reach_of;
use glam::{DAffine3, DVec3};
use std::collections::HashMap;

/// Meshes whose coordinates are all smaller are enlarged.
const TINY: f64 = 1e-6;

/// Stores tiny meshes larger where all of their copies enlarge them, and makes the copies as much smaller: all stays where it is. It is by a
/// power of two, so that nothing is rounded.
pub fn enlarge(sources: &Sources, plan: &mut Plan) {
    let mut least = HashMap::new();
    for copy in &plan.copies {
        let least = least.entry(copy.stored_as()).or_insert(f64::INFINITY);
        *least = least.min(scale(copy));
    }
    let mut enlarged = HashMap::new();
    for job in &mut plan.stored {
        let least = least.get(&job.stored_as()).copied().filter(|least| least.is_finite() && *least > 2.0);
        let Some(by) = least.map(|least| least.log2().floor().exp2()) else { continue };
        if reach_of(sources, job) < TINY {
            job.affine = DAffine3::from_scale(DVec3::splat(by)) * job.affine;
            enlarged.insert(job.stored_as(), DAffine3::from_scale(DVec3::splat(1.0 / by)));
        }
    }
    for copy in &mut plan.copies {
        if let Some(smaller) = enlarged.get(&copy.stored_as()) {
            (copy.affine, copy.own) = (copy.affine * *smaller, copy.own * *smaller);
        }
    }
}

/// By what a copy scales the axis that it scales least.
fn scale(copy: &Job) -> f64 {
    let matrix = copy.affine.matrix3;
    [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec3::length).into_iter().fold(f64::INFINITY, f64::min)
}
