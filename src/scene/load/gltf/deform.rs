//! Skins and morph targets: where the vertices of a primitive are when joints and weights have moved them.
use super::accessor::Elements;
use super::asset::Asset;
use super::primitive::{Influence, Primitive, Target};
use crate::error::Result;
use crate::scene::description::Mesh;
use glam::{DAffine3, DMat3, DMat4, DVec3, Vec3};

/// A skin: its joints, and where they were when it was bound to them.
#[derive(Debug)]
pub struct Skin {
    /// Nodes that are joints.
    pub joints: Vec<usize>,
    /// By joint: from the mesh's space to the joint's, as it was when the skin was bound.
    inverse_binds: Vec<DAffine3>,
}

impl Skin {
    /// Reads skin `index`.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for too few matrices, or one with numbers that are not finite.
    pub fn read(asset: &Asset, index: usize) -> Result<Self> {
        let (skin, place) = (&asset.root.skins[index], format!("skin {index}"));
        let joints: Vec<_> = skin.joints.iter().map(|joint| joint.value()).collect();
        let Some(matrices) = skin.inverse_bind_matrices else {
            let inverse_binds = vec![DAffine3::IDENTITY; joints.len()];
            return Ok(Self { joints, inverse_binds });
        };
        let elements = Elements::of(asset, matrices.value())?;
        let numbers = elements.numbers::<16>().map_err(|what| asset.at(&place, what))?;
        if numbers.len() < joints.len() {
            let what = format!("has {} inverse bind matrices for {} joints", numbers.len(), joints.len());
            return Err(asset.at(place, what));
        }
        let affine = |columns: &[f32; 16]| DAffine3::from_mat4(DMat4::from_cols_array(&columns.map(f64::from)));
        let inverse_binds: Vec<_> = numbers.iter().map(affine).collect();
        match inverse_binds.iter().all(|matrix| matrix.is_finite()) {
            true => Ok(Self { joints, inverse_binds }),
            false => Err(asset.at(place, "has an inverse bind matrix with NaN or infinite numbers")),
        }
    }

    /// Of one joint, the node that shows the mesh, which is at `own` seen from there.
    pub fn of_node(node: usize, own: DAffine3) -> Self {
        Self { joints: vec![node], inverse_binds: vec![own] }
    }

    /// By joint: what it does to vertices, where `worlds` are the transforms of all nodes.
    pub fn matrices(&self, worlds: &[DAffine3]) -> Vec<DAffine3> {
        self.joints.iter().zip(&self.inverse_binds).map(|(&joint, inverse)| worlds[joint] * *inverse).collect()
    }
}

/// The mesh of a primitive with `weights` of its morph targets, moved by the joints' `matrices` to world space if it has any
/// joints. Weights that are missing are 0.
pub fn deformed(primitive: &Primitive, weights: &[f32], matrices: Option<&[DAffine3]>) -> Mesh {
    let mut mesh = primitive.mesh.clone();
    for (target, &weight) in primitive.targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        add(&mut mesh, target, weight);
    }
    if let Some(matrices) = matrices.filter(|_| !primitive.joints.is_empty()) {
        let mut mirrored = vec![false; mesh.positions.len()];
        for (vertex, mirrored) in mirrored.iter_mut().enumerate() {
            let matrix = blended(primitive, vertex, matrices);
            *mirrored = mirrors(&matrix.matrix3);
            mesh.positions[vertex] = matrix.transform_point3(double(mesh.positions[vertex])).as_vec3().to_array();
            if let Some(normal) = mesh.normals.get_mut(vertex) {
                *normal = turned_normal(&matrix, double(*normal)).as_vec3().to_array();
            }
            if let Some([x, y, z, sign]) = mesh.tangents.get_mut(vertex) {
                [*x, *y, *z] = matrix.transform_vector3(double([*x, *y, *z])).as_vec3().to_array();
                *sign = if *mirrored { -*sign } else { *sign };
            }
        }
        // glTF 2.0, section 3.7.4: what is mirrored winds the other way. Later poses keep the triangles of the one at rest.
        mesh.indices.chunks_exact_mut(3).filter(|t| mirrored[t[0] as usize]).for_each(|t| t.swap(1, 2));
    }
    mesh
}

fn add(mesh: &mut Mesh, target: &Target, weight: f32) {
    let moved = |from: [f32; 3], by: &[f32; 3]| (Vec3::from(from) + weight * Vec3::from(*by)).to_array();
    mesh.positions.iter_mut().zip(&target.positions).for_each(|(at, by)| *at = moved(*at, by));
    mesh.normals.iter_mut().zip(&target.normals).for_each(|(at, by)| *at = moved(*at, by));
    for ([x, y, z, _], by) in mesh.tangents.iter_mut().zip(&target.tangents) {
        [*x, *y, *z] = moved([*x, *y, *z], by);
    }
}

/// The mean of what the joints of a vertex do, by their weights, which need not sum to 1. A vertex without weight, or whose
/// joints are not there, stays.
fn blended(primitive: &Primitive, vertex: usize, matrices: &[DAffine3]) -> DAffine3 {
    let (mut sum, mut total) = (DAffine3::ZERO, 0.0);
    for Influence { joints, weights } in &primitive.joints {
        for (joint, weight) in joints[vertex].iter().zip(weights[vertex]) {
            let Some(matrix) = matrices.get(*joint as usize).filter(|_| weight > 0.0) else { continue };
            let weight = f64::from(weight);
            sum.matrix3 += matrix.matrix3 * weight;
            sum.translation += matrix.translation * weight;
            total += weight;
        }
    }
    match total > 0.0 && total.is_finite() {
        true => DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation * (1.0 / total) },
        false => DAffine3::IDENTITY,
    }
}

/// Whether a transform takes space to a plane, a line or a point, up to rounding: of turned parents and children of a scale of 0 hardly any has
/// a determinant of exactly 0.
pub fn is_flat(m: &DMat3) -> bool {
    const ROUNDING: f64 = 1e-14;
    m.determinant().abs() <= ROUNDING * m.x_axis.length() * m.y_axis.length() * m.z_axis.length()
}

fn mirrors(m: &DMat3) -> bool {
    m.determinant() < 0.0 && !is_flat(m)
}

/// Normals are turned by the cofactors, which are the inverse transpose times the determinant, and tell the normal of the plane where joints
/// flatten the surface.
fn turned_normal(matrix: &DAffine3, normal: DVec3) -> DVec3 {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = matrix.matrix3;
    let turned = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * normal;
    let outward = if mirrors(&matrix.matrix3) { -turned } else { turned };
    outward.normalize_or(normal)
}

fn double(v: [f32; 3]) -> DVec3 {
    Vec3::from(v).as_dvec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_joints_mirror_keeps_its_outside() {
        let mesh = Mesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 3],
            tangents: vec![[1.0, 0.0, 0.0, 1.0]; 3],
            indices: vec![0, 1, 2],
            ..Mesh::default()
        };
        let joints = vec![Influence { joints: vec![[0.0; 4]; 3], weights: vec![[1.0, 0.0, 0.0, 0.0]; 3] }];
        let primitive = Primitive { mesh, material: None, targets: Vec::new(), joints };
        for (x, indices, tangent) in [(1.0, [0, 1, 2], [1.0, 0.0, 0.0, 1.0]), (-1.0, [0, 2, 1], [-1.0, 0.0, 0.0, -1.0])]
        {
            let moved = deformed(&primitive, &[], Some(&[DAffine3::from_scale(DVec3::new(x, 1.0, 1.0))]));
            assert_eq!((moved.indices.as_slice(), moved.tangents[0]), (&indices[..], tangent), "scaled by {x}");
            assert_eq!(moved.normals[0], [0.0, 0.0, 1.0], "which the triangle faces");
        }
        // A matrix of shear, beside the inverse transpose; and one that flattens along z, where all of it faces along z.
        let sheared = DAffine3::from_cols_array(&[1.0, 0.2, 0.0, 0.5, -2.0, 0.1, 0.3, 0.0, 3.0, 0.0, 0.0, 0.0]);
        let normal = DVec3::new(0.48, 0.6, 0.64);
        let expected = (sheared.matrix3.inverse().transpose() * normal).normalize();
        assert!((turned_normal(&sheared, normal) - expected).length() < 1e-12);
        assert_eq!(turned_normal(&DAffine3::from_scale(DVec3::new(2.0, 1.0, 0.0)), normal), DVec3::Z);
    }
}
