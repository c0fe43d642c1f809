//! How far triangles reach along a direction: of a hierarchy, found without a look at all of them.
use super::refit::leaves;
use crate::layout::{BvhNode, Triangle};
use crate::scene::build::geometry;
use glam::Vec3;
use std::ops::Range;

/// How far triangles and spheres reach along a direction of any length: the largest product of it and one of their points.
pub fn along(triangles: &[Triangle], direction: Vec3) -> f32 {
    let reaches = |t: &Triangle| match geometry::radius(t) {
        Some(radius) => direction.dot(t.v0.into()) + direction.length() * radius,
        None => [t.v0, t.v1, t.v2].map(|p| direction.dot(p.into())).into_iter().fold(f32::NEG_INFINITY, f32::max),
    };
    triangles.iter().map(reaches).fold(f32::NEG_INFINITY, f32::max)
}

/// [`along`] of all that lies below `root`. Children that reach farthest are looked into first, and those that reach less far than what
/// was found not at all.
pub fn farthest(nodes: &[BvhNode], root: u32, triangles: &[Triangle], direction: Vec3) -> f32 {
    let (mut found, mut open) = (f32::NEG_INFINITY, vec![(root, f32::INFINITY)]);
    while let Some((index, most)) = open.pop() {
        if most <= found {
            continue;
        }
        let node = &nodes[index as usize];
        let (first, mut inner) = (open.len(), node.child_base);
        for slot in 0..8 {
            if node.e_imask >> (24 + slot) & 1 == 1 {
                open.push((inner, box_along(node, slot, direction)));
                inner += 1;
            } else {
                let Range { start, end } = leaves(node, slot);
                found = found.max(along(&triangles[start as usize..end as usize], direction));
            }
        }
        open[first..].sort_unstable_by(|a, b| a.1.total_cmp(&b.1));
    }
    found
}

/// How far the box of a child reaches, which is somewhat larger than what it holds.
fn box_along(node: &BvhNode, slot: usize, direction: Vec3) -> f32 {
    let planes = [(node.min_x, node.max_x), (node.min_y, node.max_y), (node.min_z, node.max_z)];
    let reaches = |axis: usize| {
        let cell = f32::from_bits((node.e_imask >> (8 * axis) & 0xff) << 23);
        let (low, high) = planes[axis];
        let plane = bytemuck::cast::<_, [u8; 8]>(if direction[axis] < 0.0 { low } else { high })[slot];
        direction[axis] * (node.p[axis] + f32::from(plane) * cell)
    };
    reaches(0) + reaches(1) + reaches(2)
}
