//! A mesh whose vertices may move: what is kept of it to place its triangles again.
use super::attributes::{Extras, corners, words_of};
use super::bvh;
use super::geometry::{Corners, FLAT, Geometry, Placement, Repairs, Tag, TooFar};
use crate::error::Checked;
use crate::layout::{ATTRIBUTE_TANGENTS, BvhNode, NONE, Shading, Triangle};
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

/// The triangles of a mesh in another pose, in leaf order.
#[derive(Debug, Default)]
pub struct Placed {
    pub triangles: Vec<Triangle>,
    /// Packed normals.
    pub normals: Vec<[u32; 3]>,
    /// Packed tangents, where there are any.
    pub tangents: Vec<Option<[u32; 3]>>,
}

impl Placed {
    fn add(&mut self, part: Geometry) {
        let count = part.triangles.len();
        let words = |s: &Shading| part.attributes[s.first as usize..].first_chunk().copied();
        let tangents = |s: &Shading| words(s).filter(|_| s.attributes & ATTRIBUTE_TANGENTS != 0);
        self.normals.extend(part.shading.iter().map(|s| s.normal));
        self.tangents.extend(part.shading.iter().map(tangents));
        // Triangles without vertex normals or tangents have no records.
        let lack = if part.shading.is_empty() { count } else { 0 };
        self.normals.extend(std::iter::repeat_n(FLAT, lack));
        self.tangents.extend(std::iter::repeat_n(None, lack));
        self.triangles.extend(part.triangles);
    }
}

impl Soft {
    /// Of a mesh of so many vertices, of which `indices` make triangles.
    pub fn new(vertices: usize, indices: Vec<u32>, placement: Placement) -> Self {
        Self { vertices, indices, placement, order: Vec::new(), cost: 0.0, pose: String::new() }
    }

    /// The triangles with these vertices. `before` are the records that they replace.
    ///
    /// # Errors
    /// A sentence about what does not fit.
    pub fn place(&self, to: &Vertices, before: &[Triangle]) -> Checked<Placed> {
        let indices = if to.indices.is_empty() { &self.indices } else { &to.indices };
        self.check(to, indices)?;
        let place = |part: &[u32]| self.place_part(to, indices, part);
        let parts = self.order.par_chunks(PART).map(place).collect::<Result<Vec<_>, _>>()?;
        let mut placed = Placed::default();
        parts.into_iter().for_each(|part| placed.add(part));
        for (to, from) in placed.triangles.iter_mut().zip(before) {
            (to.primitive, to.material, to.object) = (from.primitive, from.material, from.object);
        }
        Ok(placed)
    }

    fn check(&self, to: &Vertices, indices: &[u32]) -> Checked {
        let (vertices, normals, triangles) = (to.positions.len(), to.normals.len(), indices.len() / 3);
        if to.indices.is_empty() && vertices != self.vertices {
            return Err(format!("has {} vertices, not {vertices}: their number cannot change", self.vertices));
        }
        if ![0, vertices].contains(&normals) {
            return Err(format!("gets {vertices} positions but {normals} normals: give one per position, or none"));
        }
        if ![0, vertices].contains(&to.tangents.len()) {
            let tangents = to.tangents.len();
            return Err(format!("gets {vertices} positions but {tangents} tangents: give one per position, or none"));
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

    fn place_part(&self, to: &Vertices, indices: &[u32], part: &[u32]) -> Checked<Geometry> {
        let (mut geometry, mut repairs) = (Geometry::default(), Repairs::default());
        let tag = Tag { primitive: 0, material: NONE, object: 0 };
        for &triangle in part {
            let vertices = [0, 1, 2].map(|c| indices[3 * triangle as usize + c] as usize);
            let p = vertices.map(|i| Vec3::from(to.positions[i]));
            let extras = Extras { tangents: corners(&to.tangents, vertices), ..Extras::default() };
            let c = Corners { p, n: corners(&to.normals, vertices), uv: None, extras };
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

/// Replaces the words of tangents among the texels, where triangles have some; returns the part that has changed.
pub fn twist(texels: &mut [u32], shading: &[Shading], tangents: &[Option<[u32; 3]>]) -> Option<Range<usize>> {
    let mut changed: Option<Range<usize>> = None;
    for (record, tangents) in shading.iter().zip(tangents) {
        let Some(words) = tangents.filter(|_| record.attributes & ATTRIBUTE_TANGENTS != 0) else { continue };
        let first = (record.first + words_of(record.attributes & !ATTRIBUTE_TANGENTS)) as usize;
        let range = first..first + words.len();
        texels[range.clone()].copy_from_slice(&words);
        let so_far = changed.unwrap_or(range.clone());
        changed = Some(so_far.start.min(range.start)..so_far.end.max(range.end));
    }
    changed
}

/// Fits a tree to triangles that have moved, numbered from the start of `range` on; returns its cost, see [`bvh::refit`].
pub fn refit(nodes: &mut [BvhNode], tree: Range<usize>, triangles: &[Triangle], range: &Range<usize>) -> f32 {
    let boxes: Vec<_> = triangles.par_iter().map(Boundable::aabb).collect();
    bvh::refit(nodes, tree, |index| boxes[index as usize - range.start])
}
