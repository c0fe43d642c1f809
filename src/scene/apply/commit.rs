//! Puts into a scene's arrays what a pose makes of it.
use super::next::{Next, NextCopies, NextMesh};
use crate::error::Result;
use crate::layout::{BvhNode, Instance, Material, Shading};
use crate::scene::build::geometry::FLAT;
use crate::scene::build::soft::{self, Placed};
use crate::scene::build::{bvh, coat, hierarchy, lights};
use crate::scene::change::numbers;
use crate::scene::fingerprint::posed;
use crate::scene::pose::Pose;
use crate::scene::{Change, Deformed, Fingerprint, Scene};
use std::ops::Range;

/// Changes the scene.
///
/// # Errors
/// [`Error::Memory`](crate::error::Error::Memory), before which a change of lights may be half done.
pub fn commit(scene: &mut Scene, next: Next, pose: &Pose) -> Result<Change> {
    let mut change = Change::default();
    // Also where this fails half way, so that no renderer takes the scene for one that it knows.
    let serial = scene.rig.renew_serial();
    if let Some(materials) = next.materials {
        wear(scene, materials, &mut change);
    }
    let before = scene.bounds;
    let mut copies = next.copies;
    if let Some(copies) = &mut copies {
        next.meshes.into_iter().for_each(|mesh| deform(scene, mesh, &mut copies.all, pose.rebuild_above, &mut change));
    }
    if let Some(NextCopies { all, flat, hidden, world }) = copies {
        (scene.bounds, scene.rig.flat, scene.rig.hidden) = (world, flat, hidden);
        scene.nodes.truncate(scene.root as usize);
        let before = std::mem::take(&mut scene.rig.order);
        hierarchy::place(scene, all, scene.rig.levels[0]);
        change.instance_now = numbers(&before, &scene.rig.order);
        change.nodes.push(scene.root as usize..scene.nodes.len());
        (change.instances, change.lights) = (true, true);
    }
    if let Some(lights) = next.lights {
        (scene.rig.lights, change.lights) = (lights, true);
    }
    if change.lights {
        change.lights_before = scene.rig.light_numbers.iter().copied().zip(scene.lights.iter().copied()).collect();
        lights::list(scene)?;
    }
    if let Some(camera) = &pose.camera {
        (scene.view, change.camera) = (camera.clone(), true);
    }
    // A camera without a position or a target looks at where the scene reaches now.
    change.framing = scene.view.frames_scene() && scene.bounds != before;
    match change.is_of_camera_alone() && !change.camera && !change.framing {
        true => scene.rig.serial = serial,
        false => change.serials = Some([serial, scene.rig.serial]),
    }
    identify(scene);
    Ok(change)
}

fn wear(scene: &mut Scene, materials: Vec<Material>, change: &mut Change) {
    scene.materials = materials;
    for index in 0..scene.materials.len() {
        if coat::reads_table(&scene.materials[index]) && scene.rig.tabled.insert(index as u32) {
            let first = scene.texels.len();
            coat::add_tables(&mut scene.materials[index..=index], &mut scene.texels);
            change.texels.push(first..scene.texels.len());
        }
    }
    lights::weigh(scene);
    (change.materials, change.lights) = (true, true);
}

/// Moves the triangles of a mesh, and fits its hierarchy to them or builds another.
fn deform(scene: &mut Scene, mesh: NextMesh, copies: &mut [Instance], rebuild_above: f32, change: &mut Change) {
    let tree = &mut scene.rig.trees[mesh.tree];
    let (range, nodes) = (tree.range.clone(), tree.nodes.clone());
    tree.bounds = mesh.bounds;
    let Placed { triangles, normals, tangents } = &mesh.placed;
    if scene.shading.is_empty() && normals.iter().any(|codes| *codes != FLAT) {
        // The first vertex normals of the scene: all triangles get a record.
        scene.shading = vec![Shading { normal: FLAT, ..Shading::default() }; scene.triangles.len()];
        change.triangles.push(0..scene.triangles.len());
    }
    scene.triangles[range.clone()].copy_from_slice(triangles);
    if !scene.shading.is_empty() {
        let records = &mut scene.shading[range.clone()];
        soft::bend(records, normals);
        change.texels.extend(soft::twist(&mut scene.texels, records, tangents));
    }
    let Some(soft) = &mut tree.soft else { return };
    soft.pose = mesh.pose;
    let cost = soft::refit(&mut scene.nodes, nodes.clone(), &scene.triangles[range.clone()], &range);
    let rebuilt = cost > rebuild_above * soft.cost || rebuild_above == 0.0;
    let ratio = if soft.cost > 0.0 { cost / soft.cost } else { 1.0 };
    change.deformed.push(Deformed { mesh: tree.mesh.unwrap_or_default(), cost: ratio, rebuilt });
    change.triangles.push(range);
    change.nodes.push(nodes);
    if rebuilt {
        rebuild(scene, mesh.tree, copies, change);
    }
}

/// Builds the hierarchy of a mesh as if it were loaded.
fn rebuild(scene: &mut Scene, index: usize, copies: &mut [Instance], change: &mut Change) {
    let levels = scene.rig.levels[1];
    let tree = &mut scene.rig.trees[index];
    let Some(soft) = &mut tree.soft else { return };
    let range = tree.range.clone();
    let mut triangles = soft.unsorted(&scene.triangles[range.clone()]);
    let mut built = Vec::new();
    let (_, order) = bvh::build(&triangles, range.start as u32, &mut built, levels);
    bvh::reorder(&mut triangles, &order);
    scene.triangles[range.clone()].copy_from_slice(&triangles);
    if !scene.shading.is_empty() {
        let mut shading = soft.unsorted(&scene.shading[range.clone()]);
        bvh::reorder(&mut shading, &order);
        scene.shading[range.clone()].copy_from_slice(&shading);
    }
    let before = std::mem::replace(&mut soft.order, order);
    renumber(&mut change.triangle_now, &range, &numbers(&before, &soft.order), scene.triangles.len());
    tree.list_lit(&scene.triangles, &scene.materials);
    let from = put(scene, index, built, copies);
    change.nodes.push(from..scene.nodes.len());
    let tree = &mut scene.rig.trees[index];
    let cost = soft::refit(&mut scene.nodes, tree.nodes.clone(), &scene.triangles[range.clone()], &range);
    if let Some(soft) = &mut tree.soft {
        soft.cost = cost;
    }
}

/// Notes that the triangles of `range`, of so many in all, have new numbers, counted from its start.
fn renumber(triangle_now: &mut Vec<u32>, range: &Range<usize>, now: &[u32], all: usize) {
    if triangle_now.is_empty() && !now.is_empty() {
        triangle_now.extend(0..all as u32);
    }
    let first = range.start as u32;
    triangle_now.iter_mut().skip(range.start).zip(now).for_each(|(to, index)| *to = first + index);
}

/// Puts another tree in the place of one. Where it does not fit, what lies behind moves, and some room is left for the next. Returns
/// the first node that changed.
fn put(scene: &mut Scene, index: usize, built: Vec<BvhNode>, copies: &mut [Instance]) -> usize {
    let old = scene.rig.trees[index].nodes.clone();
    let start = old.start as u32;
    let room = if built.len() > old.len() { built.len() + built.len() / 4 } else { old.len() };
    let more = room - old.len();
    let mut built: Vec<_> = built.into_iter().map(|n| BvhNode { child_base: n.child_base + start, ..n }).collect();
    built.resize(room, BvhNode::default());
    scene.nodes[old.end..].iter_mut().for_each(|n| n.child_base += more as u32);
    scene.nodes.splice(old.clone(), built);
    scene.rig.trees[index].nodes.end += more;
    let behind = |at: u32| at as usize >= old.end;
    for tree in scene.rig.trees.iter_mut().filter(|tree| behind(tree.nodes.start as u32)) {
        tree.nodes = tree.nodes.start + more..tree.nodes.end + more;
    }
    copies.iter_mut().filter(|copy| behind(copy.root)).for_each(|copy| copy.root += more as u32);
    scene.root += if behind(scene.root) { more as u32 } else { 0 };
    old.start
}

/// Makes the fingerprint that of the scene as it was loaded and, if that differs from then, of all that can have changed since: the way
/// here does not count.
fn identify(scene: &mut Scene) {
    scene.content = scene.rig.content.clone();
    let now = posed(scene, Fingerprint::default());
    if now != scene.rig.rest {
        scene.content = posed(scene, scene.rig.content.clone());
    }
}
