//! Eight-way compressed BVHs (Ylitie et al. 2017) of two-way trees: PLOC (Meister and Bittner 2018) and reinsertion by obvhs. Triangles
//! and their shading are put in leaf order; child and primitive indices are made global, so one array holds all levels.
use super::geometry::{self, Geometry};
use crate::layout::{BvhNode, Instance, TRAVERSAL_STACK, Triangle};
use clusters::Clusters;
use glam::{Mat4, Vec3, Vec4};
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::reinsertion::ReinsertionOptimizer;
use rayon::prelude::*;
use std::collections::HashSet;
use std::ops::Range;
use wide::Wide;

mod clusters;
mod level;
mod ploc;
mod reach;
mod refit;
mod shallow;
mod wide;

pub use reach::{along, farthest};
pub use refit::refit;

/// Relative growth of every box. Quantisation in the builder and slabs in the kernel round at 2^-24: this keeps their
/// errors from opening gaps between boxes that share a face.
const GROWTH: f32 = 1.0 / (1 << 21) as f32;
/// Most levels of a hierarchy: that of the instances and that of a mesh together fill a traversal's stack. Crytek Sponza has 14.
pub const LEVELS: usize = TRAVERSAL_STACK as usize / 2;
/// Levels of a two-way tree above which a part of it is halved, where the whole is too deep.
const HALVED: usize = 24;

/// Bounds of a set of points, `[low, high]`.
pub type Bounds = [[f32; 3]; 2];

/// Grown by [`GROWTH`] of the largest coordinate.
fn grown(low: Vec3, high: Vec3) -> Aabb {
    let by = Vec3::splat(low.abs().max(high.abs()).max_element() * GROWTH);
    Aabb::new((low - by).into(), (high + by).into())
}

impl Boundable for Triangle {
    fn aabb(&self) -> Aabb {
        let [low, high] = extent(self);
        grown(low, high)
    }
}

/// The lowest and the highest coordinates of a triangle or sphere.
fn extent(t: &Triangle) -> [Vec3; 2] {
    let [a, b, c] = [t.v0, t.v1, t.v2].map(Vec3::from);
    match geometry::radius(t) {
        Some(radius) => [a - radius, a + radius],
        None => [a.min(b).min(c), a.max(b).max(c)],
    }
}

/// A box with no thickness of its own: an instance's bounds.
struct Placed(Bounds);

impl Boundable for Placed {
    fn aabb(&self) -> Aabb {
        grown(self.0[0].into(), self.0[1].into())
    }
}

/// Bounds of triangles; `None` for no triangles.
pub fn bounds(triangles: &[Triangle]) -> Option<Bounds> {
    let points = triangles.iter().flat_map(extent);
    let seed = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = points.fold(seed, |(low, high), p| (low.min(p), high.max(p)));
    (!triangles.is_empty()).then(|| [low.to_array(), high.to_array()])
}

/// Builds the BVH of the triangles in `range`, which become leaf-ordered, and returns its root and that order.
pub fn build_mesh(geometry: &mut Geometry, range: Range<usize>, nodes: &mut Vec<BvhNode>) -> (u32, Vec<u32>) {
    let (root, order) = build(&geometry.triangles[range.clone()], range.start as u32, nodes, LEVELS);
    reorder(&mut geometry.triangles[range.clone()], &order);
    if !geometry.shading.is_empty() {
        reorder(&mut geometry.shading[range], &order);
    }
    (root, order)
}

/// Builds the top level over instances of meshes with these object-space bounds, and returns its root and the order of the
/// instances, which are sorted so.
pub fn build_top(
    instances: &mut [Instance],
    object_bounds: &[Bounds],
    nodes: &mut Vec<BvhNode>,
    levels: usize,
) -> (u32, Vec<u32>) {
    let boxes: Vec<_> = instances.iter().zip(object_bounds).map(|(i, &b)| Placed(world_bounds(i, b))).collect();
    let (root, order) = build(&boxes, 0, nodes, levels);
    reorder(instances, &order);
    (root, order)
}

/// The transform of an instance.
pub fn world_from_object(instance: &Instance) -> Mat4 {
    let [x, y, z] = [instance.world0, instance.world1, instance.world2].map(Vec4::from);
    Mat4::from_cols(x, y, z, Vec4::W).transpose()
}

/// World-space bounds of a placed box.
pub fn world_bounds(instance: &Instance, [low, high]: Bounds) -> Bounds {
    let world = world_from_object(instance);
    let corners = (0..8).map(|i| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        world.transform_point3(Vec3::new(pick(0), pick(1), pick(2)))
    });
    let seed = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (low, high) = corners.fold(seed, |(low, high), p| (low.min(p), high.max(p)));
    [low.to_array(), high.to_array()]
}

/// Levels of inner nodes below and with `root`: what a traversal may have to keep on its stack.
pub fn depth(nodes: &[BvhNode], root: u32) -> usize {
    let (mut deepest, mut open) = (0, vec![(root, 1)]);
    while let Some((index, level)) = open.pop() {
        let node = &nodes[index as usize];
        deepest = deepest.max(level);
        let inner = (node.e_imask >> 24).count_ones();
        open.extend((node.child_base..node.child_base + inner).map(|child| (child, level + 1)));
    }
    deepest
}

/// Most groups on a ray's stack: one for each level below the root, and with instances the groups of nodes and of instances around
/// the one that it enters. The result is at least 1 and at most [`TRAVERSAL_STACK`].
pub fn stack_size(nodes: &[BvhNode], root: u32, instances: &[Instance]) -> u32 {
    let roots: HashSet<u32> = instances.iter().map(|i| i.root).collect();
    let below = roots.iter().map(|&mesh| depth(nodes, mesh) + 1).max().unwrap_or(0);
    (depth(nodes, root) - 1 + below).max(1) as u32
}

/// Appends the nodes over `items`, numbered from `first` on; returns the root and the leaf order. A tree of more than `levels` is
/// replaced by one that has the fewest.
pub fn build<T: Boundable + Sync>(items: &[T], first: u32, nodes: &mut Vec<BvhNode>, levels: usize) -> (u32, Vec<u32>) {
    let root = nodes.len() as u32;
    if items.is_empty() {
        nodes.push(BvhNode::default()); // eight empty children: every ray misses
        return (root, Vec::new());
    }
    let Wide { nodes: mut built, mut order, levels: found } = compressed(items);
    if found > levels {
        let boxes: Vec<_> = items.iter().map(Boundable::aabb).collect();
        (built, order) = shallow::build(&boxes);
    }
    nodes.reserve_exact(built.len());
    // Indices become global.
    nodes.extend(built.into_iter().map(|node| BvhNode {
        child_base: node.child_base + root,
        primitive_base: node.primitive_base + first,
        ..node
    }));
    (root, order)
}

/// Search distance 6, then reinsertion. On Crytek Sponza, reinserting 10 % of the nodes instead of 2 % builds in 0.42 s
/// instead of 0.21 s and visits 5 % fewer nodes per ray (Sibenik 4 %, a 100k dragon 3 %); larger search distances visit
/// no fewer. Meshes so large that loading takes seconds keep to 2 %.
fn compressed<T: Boundable + Sync>(items: &[T]) -> Wide {
    let clusters = Clusters::new(items);
    let (mut bvh2, nested) = match &clusters {
        Some(clusters) => ploc::tree(&clusters.boxes(items)),
        None => ploc::tree(items),
    };
    let share = if items.len() > 1_000_000 { 0.02 } else { 0.1 };
    reinsert(&mut bvh2, share, nested);
    bvh2.parents = Vec::new();
    if let Some(clusters) = clusters {
        clusters.unfold(&mut bvh2, items);
    }
    collapsed(&mut bvh2)
}

/// Reinserts this share of the nodes, and ever fewer. Where boxes are nested this makes chains again, which take long and overflow
/// the stack of obvhs: it ends with the first that are deeper than PLOC went.
fn reinsert(bvh2: &mut Bvh2, share: f32, nested: bool) {
    let mut optimizer = ReinsertionOptimizer::default();
    if !nested {
        return optimizer.run(bvh2, share, None);
    }
    for part in (1..32).step_by(2) {
        if bvh2.depth(0) > bvh2.max_depth {
            return;
        }
        optimizer.run(bvh2, share, Some(vec![1.0 / part as f32]));
    }
}

/// Eight-way nodes of at most [`LEVELS`] levels: subtrees that are too deep are replaced by balanced ones, ever nearer to the root.
fn collapsed(bvh2: &mut Bvh2) -> Wide {
    for from in [32, 16, 8, 0] {
        // Eight children are seven levels deep at most, and a leaf of three triangles two.
        match wide::collapse(bvh2, 7 * LEVELS + 2) {
            Some(wide) if wide.levels <= LEVELS => return wide,
            _ => level::level(bvh2, from, if from == 0 { 0 } else { HALVED }),
        }
    }
    wide::collapse(bvh2, usize::MAX).expect("any tree is within so many levels")
}

/// Puts items in leaf order.
pub fn reorder<T: Copy + Send + Sync>(items: &mut [T], order: &[u32]) {
    let sorted: Vec<T> = order.par_iter().map(|&i| items[i as usize]).collect();
    items.copy_from_slice(&sorted);
}

#[cfg(test)]
mod tests;
