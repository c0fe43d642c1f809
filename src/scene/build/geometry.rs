//! The growing triangle arrays: placement, repair of what can be repaired, packing of normals.
use super::attributes::{Extras, words_of};
use super::encode::encode_normal;
use crate::layout::{NONE, SPHERE, SPHERE_INWARD, SPHERE_MIRRORED, Shading, Triangle};
use crate::scene::MAX_COORDINATE;
use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use std::ops::AddAssign;
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

/// Triangles and, once one of them needs it, their shading records. All meshes of a scene share one.
#[derive(Debug, Default)]
pub struct Geometry {
    /// In the order of input until the BVH sorts them.
    pub triangles: Vec<Triangle>,
    /// Empty, or as long as `triangles`.
    pub shading: Vec<Shading>,
    /// Words of vertices' colours, second coordinates and tangents, which `shading` tells the places of.
    pub attributes: Vec<u32>,
}

/// How a mesh enters the scene.
#[derive(Clone, Copy, Debug)]
pub struct Placement {
    /// Transform to the space that triangles are stored in, which must be invertible.
    pub affine: DAffine3,
    /// Whether vertex normals are ignored, and their absence is no reason for a warning.
    pub flat: bool,
    /// Whether triangles and their normals are turned around.
    pub flip: bool,
    /// Whether texture coordinates are kept.
    pub uvs: bool,
    /// Whether triangles without area are kept, since they may have one in another frame.
    pub keep: bool,
}

/// One triangle of a file, in file space.
#[derive(Clone, Copy, Debug)]
pub struct Corners {
    /// Positions of the three corners.
    pub p: [Vec3; 3],
    /// Vertex normals of any length.
    pub n: Option<[Vec3; 3]>,
    /// Texture coordinates of the corners; v points up.
    pub uv: Option<[Vec2; 3]>,
    /// What else there is.
    pub extras: Extras,
}

/// Indices by which a triangle is named in reports and shaded.
#[derive(Clone, Copy, Debug)]
pub struct Tag {
    /// Index of the triangle in its file.
    pub primitive: u32,
    /// Index of the triangle's material.
    pub material: u32,
    /// Index of the triangle's object.
    pub object: u32,
}

/// Numbers of triangles that were dropped or repaired, for the warnings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repairs {
    /// Triangles dropped for a NaN or infinite coordinate.
    pub not_finite: usize,
    /// Triangles dropped for having no area.
    pub no_area: usize,
    /// Triangles dropped for equalling an earlier one.
    pub copies: usize,
    /// Triangles without vertex normals that are not meant to be flat: shaded flat.
    pub no_normals: usize,
    /// Triangles whose vertex normals are unusable: shaded flat.
    pub bad_normals: usize,
    /// Triangles whose texture coordinates are not finite: set to zero.
    pub bad_uvs: usize,
}

impl AddAssign for Repairs {
    fn add_assign(&mut self, other: Self) {
        let Self { not_finite, no_area, copies, no_normals, bad_normals, bad_uvs } = other;
        self.not_finite += not_finite;
        self.no_area += no_area;
        self.copies += copies;
        self.no_normals += no_normals;
        self.bad_normals += bad_normals;
        self.bad_uvs += bad_uvs;
    }
}

impl Repairs {
    /// One line, or `None` when nothing was wrong.
    pub fn warning(&self, mesh: &str) -> Option<String> {
        let rows = [
            (self.not_finite, "with NaN or infinite coordinates dropped"),
            (self.no_area, "without area dropped"),
            (self.copies, "that repeat an earlier one dropped"),
            (self.no_normals, "without vertex normals shaded flat"),
            (self.bad_normals, "with unusable vertex normals shaded flat"),
            (self.bad_uvs, "with NaN or infinite texture coordinates set to zero"),
        ];
        let said: Vec<_> = rows.iter().filter(|r| r.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
        (!said.is_empty()).then(|| format!("{mesh}: triangles repaired: {}", said.join(", ")))
    }
}

/// The error of a coordinate beyond [`MAX_COORDINATE`].
#[derive(Clone, Copy, Debug)]
pub struct TooFar(pub f32);

impl Geometry {
    /// Adds one triangle, placed, or counts why not.
    pub fn push(&mut self, c: &Corners, tag: Tag, at: &Placement, repairs: &mut Repairs) -> Result<(), TooFar> {
        if !c.p.iter().all(|p| p.is_finite()) {
            repairs.not_finite += 1;
            return Ok(());
        }
        let mut p = c.p.map(|p| at.affine.transform_point3(p.as_dvec3()).as_vec3());
        let far = p.iter().map(|p| p.abs().max_element()).fold(0.0, f32::max);
        if far > MAX_COORDINATE as f32 {
            return Err(TooFar(far));
        }
        // A mirror turns windings around; swapping two corners keeps the outside of the mesh outside.
        let swap = (at.affine.matrix3.determinant() < 0.0) != at.flip;
        if swap {
            p.swap(1, 2);
        }
        let face = face_normal(p);
        if face.is_none() && !at.keep {
            repairs.no_area += 1;
            return Ok(());
        }
        let normal = self.normals(c, at, swap, face, repairs);
        let uv = c.uv.filter(|_| at.uvs).map(|uv| sane_uvs(uv, swap, repairs));
        let first = self.attributes.len() as u32;
        let attributes = c.extras.pack(&at.affine.matrix3, swap, &mut self.attributes);
        self.shade(normal, uv, attributes, first);
        let Tag { primitive, material, object } = tag;
        let [v0, v1, v2] = p.map(|p| p.to_array());
        self.triangles.push(Triangle { v0, primitive, v1, material, v2, object, ..Default::default() });
        Ok(())
    }

    /// Adds the unit sphere around the origin, placed by a rotation and a scale that is the same along all axes, or a mirror
    /// of that.
    pub fn push_sphere(&mut self, tag: Tag, at: &Placement, repairs: &mut Repairs) -> Result<(), TooFar> {
        let (matrix, determinant) = (at.affine.matrix3, at.affine.matrix3.determinant());
        let radius = determinant.abs().cbrt();
        let far = (at.affine.translation.abs().max_element() + radius) as f32;
        if far > MAX_COORDINATE as f32 {
            return Err(TooFar(far));
        }
        if radius < LEAST_RADIUS {
            repairs.no_area += 1;
            return Ok(());
        }
        let axis = |a: DVec3| (a.normalize() * radius).as_vec3().to_array();
        let inward = if at.flip { SPHERE_INWARD } else { 0 };
        let mirrored = if determinant < 0.0 { SPHERE_MIRRORED } else { 0 };
        self.shade(FLAT, None, 0, 0);
        self.triangles.push(Triangle {
            v0: at.affine.translation.as_vec3().to_array(),
            primitive: SPHERE | inward | mirrored,
            v1: axis(matrix.z_axis),
            material: tag.material,
            v2: axis(matrix.x_axis),
            object: tag.object,
            ..Default::default()
        });
        Ok(())
    }

    /// Adds what another one holds.
    pub fn append(&mut self, other: Self) {
        let (triangles, words) = (self.triangles.len(), self.attributes.len() as u32);
        self.triangles.extend_from_slice(&other.triangles);
        self.attributes.extend(other.attributes);
        if self.shading.is_empty() && other.shading.is_empty() {
            return;
        }
        self.shading.resize(triangles, plain());
        let first = |s: &Shading| if s.attributes == 0 { 0 } else { words + s.first };
        self.shading.extend(other.shading.iter().map(|s| Shading { first: first(s), ..*s }));
        self.shading.resize(self.triangles.len(), plain());
    }

    /// What is stored of a triangle's vertices apart.
    fn words(&self, s: &Shading) -> &[u32] {
        &self.attributes[s.first as usize..][..words_of(s.attributes) as usize]
    }

    /// Drops triangles from `start` on that equal an earlier one of them in all but number and object; returns how many.
    /// A duplicate lamp would be sampled twice as often as rays hit it.
    pub fn drop_copies(&mut self, start: usize) -> usize {
        let shading = |i: usize| self.shading.get(i).map(|s| (Shading { first: 0, ..*s }, self.words(s)));
        let all = |i: usize| (Triangle { primitive: 0, object: 0, ..self.triangles[i] }, shading(i));
        let hash = |i: usize| {
            let (triangle, shading) = all(start + i);
            let seed = shading.map_or(0, |(s, words)| {
                xxh3_64_with_seed(bytemuck::bytes_of(&s), xxh3_64(bytemuck::cast_slice(words)))
            });
            xxh3_64_with_seed(bytemuck::bytes_of(&triangle), seed)
        };
        let keep = firsts(self.triangles.len() - start, hash, |i| all(start + i));
        let dropped = keep.iter().filter(|keep| !**keep).count();
        if dropped > 0 {
            retain(&mut self.triangles, start, &keep);
            retain(&mut self.shading, start, &keep);
        }
        dropped
    }

    /// Packed vertex normals; `FLAT` where they say no more than the face does.
    fn normals(&self, c: &Corners, at: &Placement, swap: bool, face: Option<Vec3>, repairs: &mut Repairs) -> [u32; 3] {
        let Some(mut n) = c.n.filter(|_| !at.flat) else {
            repairs.no_normals += usize::from(!at.flat);
            return FLAT;
        };
        if swap {
            n.swap(1, 2);
        }
        let to_normal: DMat3 = at.affine.matrix3.inverse().transpose();
        let sign = if at.flip { -1.0 } else { 1.0 };
        let n = n.map(|n| (to_normal * n.as_dvec3() * sign).try_normalize().map(|n| n.as_vec3()));
        let [Some(a), Some(b), Some(c)] = n else {
            repairs.bad_normals += 1;
            return FLAT;
        };
        match [a, b, c].map(encode_normal) {
            codes if face.is_some_and(|face| codes == [encode_normal(face); 3]) => FLAT,
            codes => codes,
        }
    }

    fn shade(&mut self, normal: [u32; 3], uv: Option<[Vec2; 3]>, attributes: u32, first: u32) {
        if self.shading.is_empty() {
            if normal == FLAT && uv.is_none() && attributes == 0 {
                return;
            }
            self.shading = vec![plain(); self.triangles.len()];
        }
        let [uv0, uv1, uv2] = uv.unwrap_or_default().map(|uv| uv.to_array());
        let first = if attributes == 0 { 0 } else { first };
        self.shading.push(Shading { normal, uv0, uv1, uv2, attributes, first, ..Default::default() });
    }
}

/// Which of `count` things are the first of their kind; those that are alike have the same hash.
pub fn firsts<T: PartialEq>(count: usize, hash: impl Fn(usize) -> u64 + Sync, of: impl Fn(usize) -> T) -> Vec<bool> {
    let mut keys: Vec<_> = (0..count).into_par_iter().map(|i| (hash(i), i as u32)).collect();
    keys.par_sort_unstable();
    let mut first = vec![true; count];
    for alike in keys.chunk_by(|a, b| a.0 == b.0).filter(|alike| alike.len() > 1) {
        let one = of(alike[0].1 as usize);
        alike[1..].iter().for_each(|&(_, i)| first[i as usize] = of(i as usize) != one);
    }
    first
}

/// Drops what is not kept from `start` on; `items` may be empty.
pub fn retain<T: Copy>(items: &mut Vec<T>, start: usize, keep: &[bool]) {
    let tail = items.get(start..).unwrap_or_default();
    let kept: Vec<T> = tail.iter().zip(keep).filter(|(_, keep)| **keep).map(|(item, _)| *item).collect();
    items.truncate(start);
    items.extend(kept);
}

/// Smaller spheres are dropped, since the square of a radius has to be a normal 32-bit float.
const LEAST_RADIUS: f64 = 1e-15;

/// Radius of a sphere; `None` for a triangle.
pub fn radius(t: &Triangle) -> Option<f32> {
    (t.primitive & SPHERE != 0).then(|| Vec3::from(t.v1).length())
}

/// The code of a triangle without vertex normals.
pub const FLAT: [u32; 3] = [NONE; 3];

/// The record of a triangle of which nothing else is known.
fn plain() -> Shading {
    Shading { normal: FLAT, ..Shading::default() }
}

/// Unit normal by the right-hand rule, or `None` where rounding leaves no area (below 1e-12 of the longest edge squared).
pub fn face_normal(p: [Vec3; 3]) -> Option<Vec3> {
    let [a, b, c] = p.map(|p| p.as_dvec3());
    let cross = (b - a).cross(c - a);
    let longest = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
    let area = cross.length();
    (area > longest * 1e-12 && area > f64::from(f32::MIN_POSITIVE)).then(|| (cross / area).as_vec3())
}

/// Area in square world units, of the triangle as stored.
pub fn area(t: [[f32; 3]; 3]) -> f64 {
    let [a, b, c] = t.map(|p| DVec3::from(p.map(f64::from)));
    (b - a).cross(c - a).length() / 2.0
}

fn sane_uvs(mut uv: [Vec2; 3], swap: bool, repairs: &mut Repairs) -> [Vec2; 3] {
    if !uv.iter().all(|uv| uv.is_finite()) {
        repairs.bad_uvs += 1;
        return [Vec2::ZERO; 3];
    }
    if swap {
        uv.swap(1, 2);
    }
    uv
}

/// Inverse of [`encode_normal`], as kernels compute it.
#[cfg(test)]
pub fn decode_normal(code: u32) -> Vec3 {
    let unpack = |v: u32| f32::from(v as u16 as i16) / 32767.0;
    let p = Vec2::new(unpack(code), unpack(code >> 16));
    let z = 1.0 - p.x.abs() - p.y.abs();
    let fold = (-z).max(0.0);
    Vec3::new(p.x - fold.copysign(p.x), p.y - fold.copysign(p.y), z).normalize()
}

#[cfg(test)]
mod tests;
