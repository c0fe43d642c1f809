//! A mesh whose vertices may move: what is kept of it to place its triangles again.
use super::attributes::Extras;
use super::bvh;
use super::geometry::{Corners, FLAT, Geometry, Placement, Repairs, Tag, TooFar};
use crate::layout::{BvhNode, NONE, Shading, Triangle};
use crate::scene::MAX_COORDINATE;
use crate::scene::pose::Vertices;
use glam::Vec3;
use obvhs::Boundable;
use rayon::prelude::*;
use std::ops::Range;

/// Triangles that a thread places at a time.
const PART: usize = 4096;

/// What is kept of a mesh so that it can be deformed.
#[derive(Clone, Debug)]
pub struct Soft {
    vertices: usize,
    indices: Vec<u32>,
    placement: Placement,
    /// By place in the hierarchy, the triangle's number in the mesh.
    pub order: Vec<u32>,
    /// Cost of the hierarchy when it was built, see [`bvh::refit`].
    pub cost: f32,
    /// What identifies the vertices, once they have moved.
    pub pose: String,
}

impl Soft {
    /// Of a mesh of so many vertices, of which `indices` make triangles.
    pub fn new(vertices: usize, indices: Vec<u32>, placement: Placement) -> Self {
        Self { vertices, indices, placement, order: Vec::new(), cost: 0.0, pose: String::new() }
    }

    /// The triangles in leaf order with these vertices, and their packed normals. `before` are the records that they replace.
    ///
    /// # Errors
    /// A sentence about what does not fit.
    pub fn place(&self, to: &Vertices, before: &[Triangle]) -> Result<(Vec<Triangle>, Vec<[u32; 3]>), String> {
        let indices = if to.indices.is_empty() { &self.indices } else { &to.indices };
        self.check(to, indices)?;
        let place = |part: &[u32]| self.place_part(to, indices, part);
        let parts = self.order.par_chunks(PART).map(place).collect::<Result<Vec<_>, _>>()?;
        let (mut triangles, mut normals) = (Vec::with_capacity(before.len()), Vec::with_capacity(before.len()));
        for part in parts {
            let flat = part.shading.is_empty();
            normals.extend(part.shading.iter().map(|s| s.normal));
            normals.resize(normals.len() + if flat { part.triangles.len() } else { 0 }, FLAT);
            triangles.extend(part.triangles);
        }
        for (to, from) in triangles.iter_mut().zip(before) {
            (to.primitive, to.material, to.object) = (from.primitive, from.material, from.object);
        }
        Ok((triangles, normals))
    }

    fn check(&self, to: &Vertices, indices: &[u32]) -> Result<(), String> {
        let (vertices, normals, triangles) = (to.positions.len(), to.normals.len(), indices.len() / 3);
        if to.indices.is_empty() && vertices != self.vertices {
            return Err(format!("has {} vertices, not {vertices}: their number cannot change", self.vertices));
        }
        if ![0, vertices].contains(&normals) {
            return Err(format!("gets {vertices} positions but {normals} normals: give one per position, or none"));
        }
        if indices.len() != self.indices.len() {
            return Err(format!(
                "has {} triangles, not {triangles}: their number cannot change",
                self.indices.len() / 3
            ));
        }
        match indices.iter().find(|&&i| i as usize >= vertices) {
            Some(i) => Err(format!("gets an index of {i}, but {vertices} positions: count from 0")),
            None => Ok(()),
        }
    }

    fn place_part(&self, to: &Vertices, indices: &[u32], part: &[u32]) -> Result<Geometry, String> {
        let (mut geometry, mut repairs) = (Geometry::default(), Repairs::default());
        let tag = Tag { primitive: 0, material: NONE, object: 0 };
        for &triangle in part {
            let corners = [0, 1, 2].map(|c| indices[3 * triangle as usize + c] as usize);
            let of = |values: &[[f32; 3]]| corners.map(|i| Vec3::from(values[i]));
            let n = (!to.normals.is_empty()).then(|| of(&to.normals));
            let c = Corners { p: of(&to.positions), n, uv: None, extras: Extras::default() };
            let placed = geometry.push(&c, tag, &self.placement, &mut repairs);
            placed.map_err(|TooFar(v)| format!("gets a coordinate of {v:e}: the limit is {MAX_COORDINATE:e}"))?;
        }
        match repairs.not_finite {
            0 => Ok(geometry),
            _ => Err("gets a vertex with a NaN or infinite coordinate".to_owned()),
        }
    }

    /// Puts what is in leaf order into the mesh's own.
    pub fn unsorted<T: Copy>(&self, sorted: &[T]) -> Vec<T> {
        let mut own = sorted.to_vec();
        self.order.iter().zip(sorted).for_each(|(&triangle, item)| own[triangle as usize] = *item);
        own
    }
}

/// Replaces the normals of shading records.
pub fn bend(shading: &mut [Shading], normals: &[[u32; 3]]) {
    shading.iter_mut().zip(normals).for_each(|(record, normal)| record.normal = *normal);
}

/// Fits a tree to triangles that have moved, numbered from the start of `range` on; returns its cost, see [`bvh::refit`].
pub fn refit(nodes: &mut [BvhNode], tree: Range<usize>, triangles: &[Triangle], range: &Range<usize>) -> f32 {
    let boxes: Vec<_> = triangles.par_iter().map(Boundable::aabb).collect();
    bvh::refit(nodes, tree, |index| boxes[index as usize - range.start])
}
