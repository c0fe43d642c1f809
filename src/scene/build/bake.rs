//! Bakes what instances place into world space, in scenes that stay as they are: rays that change between spaces take about twice
//! the time.
use super::plan::{Job, Plan, is_even};
use super::sources::Sources;
use super::store::triangles_of;
use std::collections::HashMap;

/// Largest number of triangles of a scene whose instances are baked: they take 40 MB, and a fifth of a second to build a hierarchy
/// of.
pub const MOST_TRIANGLES: u64 = 1 << 18;

/// The plan without instances, where all of them can be baked and leave few enough triangles; else as it is, since rays pay for
/// instances whether there is one or many. Objects keep their numbers.
pub fn bake(sources: &Sources, plan: Plan) -> Plan {
    let copies = baked_copies(&plan);
    let can = copies.iter().all(|job| can_be_baked(sources, job));
    let all: Vec<Job> = plan.baked.iter().copied().chain(copies).collect();
    let triangles = all.iter().map(|job| triangles_of(sources, job)).fold(0, u64::saturating_add);
    match can && triangles <= MOST_TRIANGLES {
        true => Plan { baked: all, ..Plan::default() },
        false => plan,
    }
}

/// All copies as meshes in world space, in the order of what they are copies of.
fn baked_copies(plan: &Plan) -> Vec<Job> {
    let order: HashMap<_, usize> = plan.stored.iter().map(Job::stored_as).zip(0..).collect();
    let mut copies: Vec<_> = plan.copies.iter().map(|copy| (order[&copy.stored_as()], copy)).collect();
    copies.sort_by_key(|(order, _)| *order);
    let baked = |(order, copy): (usize, &Job)| {
        let stored = plan.stored[order];
        Job { affine: copy.affine * stored.affine, material: copy.material, ..stored }
    };
    copies.into_iter().map(baked).collect()
}

/// What is deformed stays in its own space; so does a sphere that becomes an ellipsoid.
fn can_be_baked(sources: &Sources, job: &Job) -> bool {
    !sources.description.mesh[job.mesh].moving && (!job.exact || is_even(&job.affine))
}
