//! Builds the levels of the BVH: one over the triangles of each stored mesh, and a top level over their instances.
use super::bvh::{self, Bounds};
use super::geometry::Geometry;
use super::plan::{Job, Plan};
use super::sources::Sources;
use super::store::Stored;
use crate::error::Result;
use crate::layout::{Instance, NONE};
use crate::memory;
use crate::scene::{MAX_COORDINATE, Scene};
use glam::{DAffine3, Vec3};
use std::collections::HashMap;
use std::ops::Range;

/// Approximate bytes of an object's name.
const BYTES_OF_NAME: u64 = 64;

/// The triangles below each root that instances name.
pub type Ranges = HashMap<u32, Range<usize>>;

/// Builds the BVHs, which puts triangles in leaf order; sets the scene's nodes, root, stack, bounds, instances and names of
/// objects. `stored[0]` is world space.
///
/// # Errors
/// Where instances reach too far, and [`Error::Memory`](crate::error::Error::Memory).
pub fn build(
    sources: &Sources,
    plan: &Plan,
    stored: Vec<Stored>,
    geometry: &mut Geometry,
    scene: &mut Scene,
) -> Result<Ranges> {
    let ranges = match plan.copies.is_empty() {
        true => {
            one_level(stored, geometry, scene);
            Ranges::new()
        }
        false => {
            let copies = copies_of(sources, plan, &stored)?;
            let (ranges, boxes) = lower_levels(&copies, stored, geometry, scene);
            top_level(sources, &boxes, scene)?;
            ranges
        }
    };
    scene.stack = bvh::stack_size(&scene.nodes, scene.root, &scene.instances);
    Ok(ranges)
}

fn one_level(stored: Vec<Stored>, geometry: &mut Geometry, scene: &mut Scene) {
    let world = stored.into_iter().next().expect("world space is always there");
    scene.root = bvh::build_mesh(geometry, world.range, &mut scene.nodes);
    scene.names.objects = world.objects;
    scene.bounds = bvh::bounds(&geometry.triangles).unwrap_or_default();
}

/// The copies of each stored mesh; world space has itself.
fn copies_of(sources: &Sources, plan: &Plan, stored: &[Stored]) -> Result<Vec<Vec<Job>>> {
    let mut copies: HashMap<usize, Vec<Job>> = HashMap::new();
    plan.copies.iter().for_each(|copy| copies.entry(copy.mesh).or_default().push(*copy));
    let names = |mesh: &Stored| mesh.mesh.and_then(|m| copies.get(&m)).map_or(0, Vec::len) * mesh.objects.len();
    let names: u64 = stored.iter().map(|mesh| names(mesh) as u64).sum();
    memory::need(format!("{}: {names} objects", sources.path.display()), names.saturating_mul(BYTES_OF_NAME))?;
    let itself = Job { mesh: 0, affine: DAffine3::IDENTITY, material: None, exact: false };
    let of = |mesh: &Stored| mesh.mesh.map_or(vec![itself], |mesh| copies.remove(&mesh).unwrap_or_default());
    Ok(stored.iter().map(of).collect())
}

/// A BVH for each mesh that has triangles, and its instances; returns the triangles below each root, and their bounds.
fn lower_levels(
    copies: &[Vec<Job>],
    stored: Vec<Stored>,
    geometry: &mut Geometry,
    scene: &mut Scene,
) -> (Ranges, HashMap<u32, Bounds>) {
    let (mut ranges, mut boxes) = (Ranges::new(), HashMap::new());
    for (mesh, copies) in stored.into_iter().zip(copies) {
        let Some(bounds) = bvh::bounds(&geometry.triangles[mesh.range.clone()]) else { continue };
        let root = bvh::build_mesh(geometry, mesh.range.clone(), &mut scene.nodes);
        for copy in copies {
            let (material, object) = (copy.material.unwrap_or(NONE), scene.names.objects.len() as u32);
            let placed = Instance { material, object, ..instance(&copy.affine, root) };
            // Nodes are counted differently by another builder, triangles are not.
            scene.content.add(&[Instance { root: mesh.range.start as u32, ..placed }]);
            scene.content.add(&[mesh.range.end as u32]);
            scene.instances.push(placed);
            scene.names.objects.extend(mesh.objects.iter().cloned());
        }
        ranges.insert(root, mesh.range);
        boxes.insert(root, bounds);
    }
    (ranges, boxes)
}

/// The device's form of a placement; the caller sets `material` and `object`.
pub fn instance(affine: &DAffine3, root: u32) -> Instance {
    let rows = |a: &DAffine3| {
        [0, 1, 2].map(|i| {
            let row = a.matrix3.row(i);
            [row.x as f32, row.y as f32, row.z as f32, a.translation[i] as f32]
        })
    };
    let ([world0, world1, world2], [object0, object1, object2]) = (rows(affine), rows(&affine.inverse()));
    let mirrored = u32::from(affine.matrix3.determinant() < 0.0);
    Instance {
        world0,
        world1,
        world2,
        object0,
        object1,
        object2,
        root,
        material: NONE,
        object: 0,
        mirrored,
        ..Default::default()
    }
}

fn top_level(sources: &Sources, boxes: &HashMap<u32, Bounds>, scene: &mut Scene) -> Result<()> {
    let object_bounds: Vec<_> = scene.instances.iter().map(|i| boxes[&i.root]).collect();
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for (instance, &bounds) in scene.instances.iter().zip(&object_bounds) {
        let [l, h] = bvh::world_bounds(instance, bounds).map(Vec3::from);
        (low, high) = (low.min(l), high.max(h));
    }
    if scene.instances.is_empty() {
        (low, high) = (Vec3::ZERO, Vec3::ZERO);
    }
    if is_too_far(low.abs().max(high.abs()).max_element()) {
        return Err(sources.at("instances", format!("reach beyond the limit of {MAX_COORDINATE:e}")));
    }
    // Rays are transformed to the space of each instance that they meet.
    let world = [low.to_array(), high.to_array()];
    let seen =
        |i: &Instance| bvh::world_bounds(&turned(i), world).as_flattened().iter().map(|v| v.abs()).fold(0.0, f32::max);
    if let Some(i) = scene.instances.iter().find(|i| is_too_far(seen(i))) {
        let name = &scene.names.objects[i.object as usize];
        let what =
            format!("seen from it, the scene reaches beyond the limit of {MAX_COORDINATE:e}: choose a larger scale");
        return Err(sources.at(format!("an instance of \"{name}\""), what));
    }
    scene.bounds = world;
    scene.root = bvh::build_top(&mut scene.instances, &object_bounds, &mut scene.nodes);
    Ok(())
}

fn is_too_far(coordinate: f32) -> bool {
    coordinate.is_nan() || coordinate > MAX_COORDINATE as f32
}

/// The instance whose world is the object's space.
fn turned(i: &Instance) -> Instance {
    Instance { world0: i.object0, world1: i.object1, world2: i.object2, ..*i }
}
