//! Builds the levels of the BVH: one over the triangles of each stored mesh, and a top level over their instances.
use super::bvh::{self, Bounds};
use super::geometry::Geometry;
use super::plan::{Job, Plan};
use super::soft;
use super::sources::Sources;
use super::store::Stored;
use crate::error::{Checked, Result};
use crate::layout::{Instance, NONE, TRAVERSAL_STACK};
use crate::memory;
use crate::scene::rig::{Rig, Tree};
use crate::scene::{MAX_COORDINATE, Scene};
use glam::{DAffine3, Vec3};
use std::collections::{HashMap, HashSet};

/// Approximate bytes of an object's name.
const BYTES_OF_NAME: u64 = 64;

/// Builds the BVHs, which puts triangles in leaf order; sets the scene's nodes, root, stack, bounds, instances, rig and names of
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
) -> Result<()> {
    if plan.copies.is_empty() {
        one_level(stored, geometry, scene);
    } else {
        let copies = copies_of(sources, plan, &stored)?;
        let most = plan.copies.iter().map(|copy| copy.placement + 1).max().unwrap_or(0);
        scene.rig.placed = vec![NONE; most.max(sources.description.instance.len() as u32) as usize];
        lower_levels(&copies, stored, geometry, scene);
        top_level(sources, geometry, scene)?;
    }
    size_stack(scene);
    Ok(())
}

/// Sets the stack that kernels are compiled with: trees of what moves may come to be this much deeper than now.
fn size_stack(scene: &mut Scene) {
    const TOP: u32 = 1;
    const MESH: u32 = 2;
    let stack = bvh::stack_size(&scene.nodes, scene.root, &scene.instances);
    let room = TRAVERSAL_STACK - stack;
    let top = if scene.instances.is_empty() { 0 } else { TOP.min(room) };
    let soft = scene.rig.trees.iter().any(|tree| tree.soft.is_some());
    let mesh = if soft { MESH.min(room - top) } else { 0 };
    scene.stack = stack + top + mesh;
    let deepest = scene.rig.trees.iter().map(|tree| bvh::depth(&scene.nodes, tree.nodes.start as u32)).max();
    scene.rig.levels = [bvh::depth(&scene.nodes, scene.root) + top as usize, deepest.unwrap_or(1) + mesh as usize];
}

fn one_level(stored: Vec<Stored>, geometry: &mut Geometry, scene: &mut Scene) {
    let mut world = stored.into_iter().next().expect("world space is always there");
    scene.names.objects = std::mem::take(&mut world.objects);
    scene.bounds = bvh::bounds(&geometry.triangles).unwrap_or_default();
    scene.root = add_tree(world, scene.bounds, geometry, scene);
}

/// Builds the BVH of a mesh; returns its root.
fn add_tree(mesh: Stored, bounds: Bounds, geometry: &mut Geometry, scene: &mut Scene) -> u32 {
    let Stored { job, range, mut soft, .. } = mesh;
    let (root, order) = bvh::build_mesh(geometry, range.clone(), &mut scene.nodes);
    let nodes = root as usize..scene.nodes.len();
    if let Some(soft) = &mut soft {
        soft.order = order;
        soft.cost = soft::refit(&mut scene.nodes, nodes.clone(), &geometry.triangles[range.clone()], &range);
    }
    scene.rig.trees.push(Tree { mesh: job.map(|job| job.mesh), nodes, range, bounds, lit: Vec::new(), soft });
    root
}

/// The copies of each stored mesh; world space has itself.
fn copies_of(sources: &Sources, plan: &Plan, stored: &[Stored]) -> Result<Vec<Vec<Job>>> {
    let mut copies: HashMap<_, Vec<Job>> = HashMap::new();
    plan.copies.iter().for_each(|copy| copies.entry(copy.stored_as()).or_default().push(*copy));
    let names =
        |mesh: &Stored| mesh.job.and_then(|job| copies.get(&job.stored_as())).map_or(0, Vec::len) * mesh.objects.len();
    let names: u64 = stored.iter().map(|mesh| names(mesh) as u64).sum();
    memory::need(format!("{}: {names} objects", sources.path.display()), names.saturating_mul(BYTES_OF_NAME))?;
    let itself = Job::new(0, DAffine3::IDENTITY);
    let of = |mesh: &Stored| mesh.job.map_or(vec![itself], |job| copies.remove(&job.stored_as()).unwrap_or_default());
    Ok(stored.iter().map(of).collect())
}

/// A BVH for each mesh that has triangles, and its instances.
fn lower_levels(copies: &[Vec<Job>], stored: Vec<Stored>, geometry: &mut Geometry, scene: &mut Scene) {
    for (mesh, copies) in stored.into_iter().zip(copies) {
        let Some(bounds) = bvh::bounds(&geometry.triangles[mesh.range.clone()]) else { continue };
        let (range, objects, tree) = (mesh.range.clone(), mesh.objects.clone(), scene.rig.trees.len() as u32);
        let root = add_tree(mesh, bounds, geometry, scene);
        for copy in copies {
            let (material, object) = (copy.material.unwrap_or(NONE), scene.names.objects.len() as u32);
            let placed = Instance { material, object, ..instance(&copy.affine, root) };
            // Nodes are counted differently by another builder, triangles are not.
            scene.content.add(&[Instance { root: range.start as u32, ..placed }]);
            scene.content.add(&[range.end as u32]);
            note(copy, tree, scene);
            scene.instances.push(placed);
            scene.names.objects.extend(objects.iter().cloned());
        }
    }
}

/// Tells the rig of the next copy.
fn note(copy: &Job, tree: u32, scene: &mut Scene) {
    let number = scene.instances.len() as u32;
    scene.rig.tree_of.push(tree);
    if let Some(place) = scene.rig.placed.get_mut(copy.placement as usize) {
        *place = number;
    }
    if copy.own != DAffine3::IDENTITY {
        scene.rig.own.insert(number, copy.own);
    }
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

fn top_level(sources: &Sources, geometry: &Geometry, scene: &mut Scene) -> Result<()> {
    let copies = std::mem::take(&mut scene.instances);
    let Rig { trees, tree_of, .. } = &scene.rig;
    let bounds: Vec<_> = trees.iter().map(|tree| tree.bounds).collect();
    let farthest = |tree: usize, direction| {
        bvh::farthest(&scene.nodes, trees[tree].nodes.start as u32, &geometry.triangles, direction)
    };
    let found = seen(&copies, tree_of, &HashSet::new(), &bounds, farthest);
    (scene.rig.hidden, scene.bounds) = found.map_err(|what| sources.at("instances", what))?;
    check_none_lost(scene, &copies, &scene.rig.hidden, scene.bounds)
        .map_err(|[place, what]| sources.at(place, what))?;
    place(scene, copies, bvh::LEVELS);
    Ok(())
}

/// The copies that are not seen, those that are `flat` and those that are too small, and what the others reach: see [`reach`].
///
/// # Errors
/// As [`reach`].
pub fn seen(
    copies: &[Instance],
    tree_of: &[u32],
    flat: &HashSet<u32>,
    bounds: &[Bounds],
    farthest: impl Fn(usize, Vec3) -> f32,
) -> Checked<(HashSet<u32>, Bounds)> {
    let reach = |hidden: &HashSet<u32>| reach(&placed(copies, tree_of, hidden, bounds), &farthest);
    let (mut hidden, mut world) = (flat.clone(), reach(flat)?);
    let bounds_of = |copy: usize| bounds[tree_of[copy] as usize];
    let specks: Vec<_> = (0..copies.len()).filter(|&copy| is_speck(&copies[copy], bounds_of(copy), world)).collect();
    if !specks.is_empty() {
        hidden.extend(specks.into_iter().map(|copy| copy as u32));
        world = reach(&hidden)?;
    }
    Ok((hidden, world))
}

/// A copy that is seen.
struct PlacedTree<'a> {
    copy: &'a Instance,
    /// Index of the tree that it places.
    tree: usize,
    /// World-space bounds of the tree's box, which may be larger than those of what is in it.
    around: Bounds,
}

/// The copies that are not `hidden`; `tree_of` says which tree each places, and `bounds` how far that reaches in its own space.
fn placed<'a>(
    copies: &'a [Instance],
    tree_of: &[u32],
    hidden: &HashSet<u32>,
    bounds: &[Bounds],
) -> Vec<PlacedTree<'a>> {
    let seen = (0..).zip(copies).filter(|(number, _)| !hidden.contains(number));
    let place = |(number, copy): (u32, &'a Instance)| {
        let tree = tree_of[number as usize] as usize;
        PlacedTree { copy, tree, around: bvh::world_bounds(copy, bounds[tree]) }
    };
    seen.map(place).collect()
}

/// World-space bounds of all triangles that are seen, as if they were stored there; `farthest` tells how far those of a tree reach along
/// a direction, as [`bvh::along`] does.
///
/// # Errors
/// A sentence, where that is too far.
fn reach(seen: &[PlacedTree], farthest: impl Fn(usize, Vec3) -> f32) -> Checked<Bounds> {
    if seen.is_empty() {
        return Ok(Bounds::default());
    }
    let low = [0, 1, 2].map(|axis| -farthest_along(seen, axis, -1.0, &farthest));
    let high = [0, 1, 2].map(|axis| farthest_along(seen, axis, 1.0, &farthest));
    match low.into_iter().chain(high).any(|coordinate| is_too_far(coordinate.abs())) {
        true => Err(format!("reach beyond the limit of {MAX_COORDINATE:e}")),
        false => Ok([low, high]),
    }
}

/// How far anything reaches along an axis of the world, or for a `sign` of -1 against it. Only copies whose boxes reach farther than what
/// was found are looked into, beginning with that whose box reaches farthest.
fn farthest_along(seen: &[PlacedTree], axis: usize, sign: f32, farthest: impl Fn(usize, Vec3) -> f32) -> f32 {
    let at_most = |one: &PlacedTree| one.around.map(|corner| sign * corner[axis]).into_iter().fold(f32::MIN, f32::max);
    let exactly = |one: &PlacedTree| {
        let [x, y, z, shift] = [one.copy.world0, one.copy.world1, one.copy.world2][axis].map(|v| sign * v);
        farthest(one.tree, Vec3::new(x, y, z)) + shift
    };
    let first = seen.iter().max_by(|a, b| at_most(a).total_cmp(&at_most(b)));
    let found = first.map_or(f32::NEG_INFINITY, exactly);
    seen.iter().fold(found, |found, one| if at_most(one) > found { found.max(exactly(one)) } else { found })
}

/// Checks that the world, in the space of each copy that is not `hidden`, is not too large: rays are transformed to the
/// space of each instance that they meet.
///
/// # Errors
/// For a copy that is too small: which, and a sentence.
pub fn check_none_lost(
    scene: &Scene,
    copies: &[Instance],
    hidden: &HashSet<u32>,
    world: Bounds,
) -> std::result::Result<(), [String; 2]> {
    match (0..).zip(copies).find(|(copy, at)| !hidden.contains(copy) && is_lost(at, world)) {
        Some((_, lost)) => Err([
            format!("an instance of \"{}\"", scene.names.objects[lost.object as usize]),
            format!("seen from it, the scene reaches beyond the limit of {MAX_COORDINATE:e}: choose a larger scale"),
        ]),
        None => Ok(()),
    }
}

fn is_lost(copy: &Instance, world: Bounds) -> bool {
    is_too_far(farthest(bvh::world_bounds(&turned(copy), world)))
}

/// What is no larger than this, as a part of how far the world reaches, cannot be seen: a micrometre in a kilometre.
const SPECK: f32 = 1e-9;

/// Whether a copy of something of these bounds is too small to be seen, and for rays to be transformed to its space.
fn is_speck(copy: &Instance, bounds: Bounds, world: Bounds) -> bool {
    let [low, high] = bounds.map(Vec3::from);
    let edge = |row: [f32; 4]| Vec3::from_slice(&row).abs().dot(high - low);
    let largest = [copy.world0, copy.world1, copy.world2].map(edge).into_iter().fold(0.0, f32::max);
    largest <= SPECK * farthest(world) && is_lost(copy, world)
}

/// Builds the top level over the copies that are seen, of so many levels at most; those that are hidden come last among the
/// instances, where no leaf leads to them.
pub fn place(scene: &mut Scene, copies: Vec<Instance>, levels: usize) {
    let rig = &mut scene.rig;
    let (hidden, seen): (Vec<u32>, Vec<u32>) = (0..copies.len() as u32).partition(|copy| rig.hidden.contains(copy));
    let mut instances: Vec<_> = seen.iter().map(|&copy| copies[copy as usize]).collect();
    let boxes: Vec<_> = seen.iter().map(|&copy| rig.trees[rig.tree_of[copy as usize] as usize].bounds).collect();
    let (root, order) = bvh::build_top(&mut instances, &boxes, &mut scene.nodes, levels);
    instances.extend(hidden.iter().map(|&copy| copies[copy as usize]));
    rig.order = order.into_iter().map(|slot| seen[slot as usize]).chain(hidden).collect();
    (scene.root, scene.instances) = (root, instances);
}

/// The largest coordinate.
fn farthest(bounds: Bounds) -> f32 {
    bounds.as_flattened().iter().map(|v| v.abs()).fold(0.0, f32::max)
}

fn is_too_far(coordinate: f32) -> bool {
    coordinate.is_nan() || coordinate > MAX_COORDINATE as f32
}

/// The instance whose world is the object's space.
fn turned(i: &Instance) -> Instance {
    Instance { world0: i.object0, world1: i.object1, world2: i.object2, ..*i }
}
