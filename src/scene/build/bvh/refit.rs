//! Fits the boxes of a hierarchy to primitives that have moved, and measures what rays pay for a tree that was built for others.
use crate::layout::BvhNode;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use std::ops::Range;

/// Cost of a primitive where a node costs 1.
pub const PRIMITIVE: f32 = 0.3;
/// Extents below this count as it: exponents stay those of normal floats.
const LEAST_EXTENT: f32 = 1e-20;

/// Fits the nodes of one tree, whose root is the first of them, to the boxes of its primitives, by their global index. Children
/// come after their parents, so that one pass from the back meets them first.
///
/// Returns the cost by the surface area heuristic, `sum of A(node) / A(root) + 0.3 * sum of n A(leaf) / A(root)`, with the exact
/// boxes: what a ray that meets the root pays on average. 0 for a tree without area.
pub fn refit(nodes: &mut [BvhNode], tree: Range<usize>, boxes: impl Fn(u32) -> Aabb) -> f32 {
    let mut exact = vec![Aabb::empty(); tree.len()];
    let mut cost = 0.0;
    for index in tree.clone().rev() {
        let node = &mut nodes[index];
        let mut children = [Aabb::empty(); 8];
        let mut inner = node.child_base as usize;
        for (slot, child) in children.iter_mut().enumerate() {
            if node.e_imask >> (24 + slot) & 1 == 1 {
                *child = exact[inner - tree.start];
                inner += 1;
                continue;
            }
            let leaves = leaves(node, slot);
            let count = leaves.len() as f32;
            *child = leaves.map(&boxes).fold(Aabb::empty(), |all, one| all.union(&one));
            cost += PRIMITIVE * count * area(child);
        }
        let whole = children.iter().fold(Aabb::empty(), |all, child| all.union(child));
        exact[index - tree.start] = whole;
        cost += area(&whole);
        if whole.min.x <= whole.max.x {
            quantise(node, &whole, &children);
        }
    }
    let root = exact.first().map_or(0.0, area);
    if root > 0.0 { cost / root } else { 0.0 }
}

/// Primitives of a child that is a leaf; none for one that is empty.
pub fn leaves(node: &BvhNode, slot: usize) -> Range<u32> {
    let meta = bytemuck::cast::<_, [u8; 8]>(node.meta)[slot];
    let first = node.primitive_base + u32::from(meta & 31);
    first..first + u32::from(meta >> 5).count_ones()
}

/// Half the surface; 0 for the empty box.
fn area(of: &Aabb) -> f32 {
    let [x, y, z] = (of.max - of.min).max(Vec3A::ZERO).to_array();
    x * y + y * z + z * x
}

/// Stores boxes on the grid of Ylitie et al. 2017, rounded outward: a cell is the least power of two of which 255 reach across.
/// The rounding of the differences themselves, at 2^-24, is within what every box was grown by.
pub fn quantise(node: &mut BvhNode, whole: &Aabb, children: &[Aabb; 8]) {
    let cells = ((whole.max - whole.min).max(Vec3A::splat(LEAST_EXTENT)) / 255.0).to_array();
    let exponents = cells.map(|cell| (cell.to_bits() >> 23) + u32::from(cell.to_bits() << 9 != 0));
    let inverse = Vec3A::from(exponents.map(|e| 1.0 / f32::from_bits(e << 23)));
    let (mut low, mut high) = ([[0u8; 8]; 3], [[0u8; 8]; 3]);
    for (slot, child) in children.iter().enumerate().filter(|(_, child)| child.min.x <= child.max.x) {
        let from = ((child.min - whole.min) * inverse).floor().to_array();
        let to = ((child.max - whole.min) * inverse).ceil().to_array();
        for axis in 0..3 {
            low[axis][slot] = from[axis] as u8; // saturates
            high[axis][slot] = to[axis] as u8;
        }
    }
    node.p = whole.min.to_array();
    let [x, y, z] = exponents;
    node.e_imask = node.e_imask & 0xff00_0000 | z << 16 | y << 8 | x;
    [node.min_x, node.min_y, node.min_z] = low.map(bytemuck::cast);
    [node.max_x, node.max_y, node.max_z] = high.map(bytemuck::cast);
}
