//! Bakes what instances place into world space, in scenes that stay as they are: rays that change between spaces take about twice
//! the time.
use super::plan::{Job, Plan, is_even};
use super::sources::Sources;
use super::store::triangles_of;

/// Largest number of triangles of a scene whose instances are baked: they take 40 MB, and a fifth of a second to build a hierarchy
/// of.
pub const MOST_TRIANGLES: u64 = 1 << 18;

/// The plan without instances, where all of them can be baked and leave few enough triangles; else as it is, since rays pay for
/// instances whether there is one or many. Objects keep their numbers.
pub fn bake(sources: &Sources, plan: Plan) -> Plan {
    let copies = plan.stored.iter().flat_map(|stored| baked_copies(stored, &plan.copies));
    let all: Vec<Job> = plan.baked.iter().copied().chain(copies).collect();
    let triangles = all.iter().map(|job| triangles_of(sources, job)).fold(0, u64::saturating_add);
    let can = plan.stored.iter().all(|stored| can_be_baked(sources, stored, &plan.copies));
    match can && triangles <= MOST_TRIANGLES {
        true => Plan { baked: all, ..Plan::default() },
        false => plan,
    }
}

/// The copies of a mesh as meshes in world space.
fn baked_copies<'a>(stored: &'a Job, copies: &'a [Job]) -> impl Iterator<Item = Job> {
    let own = copies.iter().filter(|copy| copy.mesh == stored.mesh);
    own.map(|copy| Job { affine: copy.affine * stored.affine, material: copy.material, ..*stored })
}

/// What is deformed stays in its own space; so does a sphere that becomes an ellipsoid.
fn can_be_baked(sources: &Sources, stored: &Job, copies: &[Job]) -> bool {
    let mut placed = baked_copies(stored, copies);
    !sources.description.mesh[stored.mesh].moving && (!stored.exact || placed.all(|job| is_even(&job.affine)))
}
