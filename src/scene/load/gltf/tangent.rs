//! Tangents of primitives that have none, as glTF 2.0, section 3.7.2.1, asks for: MikkTSpace's, with the texture coordinates of the
//! normal map.
use super::asset::Asset;
use super::picture::coordinates_of;
use super::primitive::{self, Influence, Primitive, Target};
use crate::scene::description::Mesh;
use crate::scene::load::mapping::Mapping;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use gltf_json::mesh::Primitive as Json;
use std::collections::HashMap;

/// Bytes that a corner takes while tangents are made.
const BYTES_OF_CORNER: u64 = 600;

/// Bytes that making a primitive's tangents takes, at most. Its accessors must have been checked.
pub fn bytes(asset: &Asset, primitive: &Json) -> u64 {
    let made = coordinates(asset, primitive.material.map(|material| material.value())).is_some();
    if made { primitive::corners(asset, primitive).saturating_mul(BYTES_OF_CORNER) } else { 0 }
}

/// How a material's normal map reads coordinates, or else that of its clear coat; `None` without either.
fn coordinates(asset: &Asset, material: Option<usize>) -> Option<Mapping> {
    let material = asset.root.materials.get(material?)?;
    if let Some(normal) = &material.normal_texture {
        return Some(coordinates_of(normal.tex_coord, normal.extensions.as_ref().map(|e| &e.others)));
    }
    let coat = material.extensions.as_ref()?.others.get("KHR_materials_clearcoat")?.get("clearcoatNormalTexture")?;
    let set = coat.get("texCoord").and_then(|set| set.as_u64()).unwrap_or(0);
    Some(coordinates_of(set as u32, coat.get("extensions").and_then(|e| e.as_object())))
}

/// Gives a primitive tangents if its material reads them. A vertex whose triangles disagree about its tangent becomes several. Without normals the surface is
/// flat, and its triangles have their tangents by themselves.
pub fn add(asset: &Asset, primitive: &mut Primitive) {
    if let Some(mapping) = coordinates(asset, primitive.material) {
        make(primitive, &mapping);
    }
}

fn make(primitive: &mut Primitive, mapping: &Mapping) {
    let mesh = &primitive.mesh;
    let uvs = if mapping.second { &mesh.uvs2 } else { &mesh.uvs };
    if !mesh.tangents.is_empty() || mesh.normals.is_empty() || uvs.is_empty() {
        return;
    }
    let uvs = uvs.iter().map(|uv| mapping.applied(*uv)).collect();
    let mut surface = Surface { mesh, uvs, tangents: vec![None; mesh.indices.len()] };
    // It has no errors today, and a surface without tangents is none either.
    let made = generate_tangents(&mut surface).is_ok();
    let tangents = surface.tangents;
    if made && tangents.iter().any(Option::is_some) {
        assign(primitive, &tangents);
    }
}

/// What the crate reads and writes.
struct Surface<'a> {
    mesh: &'a Mesh,
    /// Where vertices read the picture.
    uvs: Vec<[f32; 2]>,
    /// By corner.
    tangents: Vec<Option<[f32; 4]>>,
}

impl Surface<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.mesh.indices[3 * face + corner] as usize
    }
}

impl Geometry for Surface<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.indices.len() / 3
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.positions[self.vertex(face, corner)]
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.mesh.normals[self.vertex(face, corner)]
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uvs[self.vertex(face, corner)]
    }

    fn set_tangent(&mut self, space: Option<TangentSpace>, face: usize, corner: usize) {
        self.tangents[3 * face + corner] = space.map(|space| space.tangent_encoded());
    }
}

/// Any direction, for corners of triangles without extent in the picture.
const ANY: [f32; 4] = [1.0, 0.0, 0.0, 1.0];

/// Gives vertices the tangents of their corners: the first tangent of a vertex stays with it, others go to copies at the end.
fn assign(primitive: &mut Primitive, tangents: &[Option<[f32; 4]>]) {
    let mut own: Vec<Option<[f32; 4]>> = vec![None; primitive.mesh.positions.len()];
    let (mut copies, mut origins) = (HashMap::new(), Vec::new());
    let count = own.len();
    for (index, tangent) in primitive.mesh.indices.iter_mut().zip(tangents) {
        let (vertex, tangent) = (*index as usize, tangent.unwrap_or(ANY));
        let first = *own[vertex].get_or_insert(tangent);
        if first != tangent {
            let bits = tangent.map(f32::to_bits);
            *index = *copies.entry((vertex, bits)).or_insert_with(|| {
                origins.push((vertex, tangent));
                (count + origins.len() - 1) as u32
            });
        }
    }
    let ends = origins.iter().map(|(_, tangent)| *tangent);
    primitive.mesh.tangents = own.into_iter().map(|tangent| tangent.unwrap_or(ANY)).chain(ends).collect();
    let from: Vec<_> = origins.into_iter().map(|(vertex, _)| vertex).collect();
    repeat(primitive, &from);
}

/// Puts copies of these vertices at the end of all that a primitive has of vertices but the tangents.
fn repeat(primitive: &mut Primitive, from: &[usize]) {
    fn more<T: Copy>(values: &mut Vec<T>, from: &[usize]) {
        if !values.is_empty() {
            values.extend(from.iter().map(|&vertex| values[vertex]).collect::<Vec<_>>());
        }
    }
    let Mesh { positions, normals, uvs, uvs2, colors, tangents: _, indices: _ } = &mut primitive.mesh;
    more(positions, from);
    more(normals, from);
    more(uvs, from);
    more(uvs2, from);
    more(colors, from);
    for Target { positions, normals, tangents } in &mut primitive.targets {
        more(positions, from);
        more(normals, from);
        more(tangents, from);
    }
    for Influence { joints, weights } in &mut primitive.joints {
        more(joints, from);
        more(weights, from);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles that share an edge, in the plane z = 0, of which the picture mirrors one: u runs along +x in the first, and along
    /// -x in the second.
    fn mirrored() -> Primitive {
        let mesh = Mesh {
            positions: vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]],
            normals: vec![[0.0, 0.0, 1.0]; 4],
            uvs: vec![[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 0.0]],
            indices: vec![0, 3, 1, 0, 1, 2],
            ..Mesh::default()
        };
        let target = Target { positions: (0..4).map(|i| [i as f32, 0.0, 0.0]).collect(), ..Target::default() };
        Primitive { mesh, material: None, targets: vec![target], joints: Vec::new() }
    }

    #[test]
    fn a_mirrored_picture_splits_the_vertices_of_its_seam() {
        let mut primitive = mirrored();
        make(&mut primitive, &Mapping::default());
        let mesh = &primitive.mesh;
        assert_eq!((mesh.positions.len(), mesh.tangents.len()), (6, 6));
        let of = |corner: usize| mesh.tangents[mesh.indices[corner] as usize];
        for corner in 0..3 {
            assert_eq!(of(corner), [1.0, 0.0, 0.0, 1.0], "cross(+z, +x) is +y, along which v rises");
            assert_eq!(of(3 + corner), [-1.0, 0.0, 0.0, -1.0], "-cross(+z, -x) is +y");
        }
        let at = |corner: usize| mesh.positions[mesh.indices[corner] as usize];
        assert_eq!([at(3), at(4), at(5)], [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]);
        let moved = &primitive.targets[0].positions;
        assert_eq!((moved.len(), moved[mesh.indices[4] as usize]), (6, [1.0, 0.0, 0.0]), "copies move alike");
    }

    #[test]
    fn tangents_lead_along_the_picture_where_a_transform_turns_or_mirrors_it() {
        let turned = Mapping { scale: [0.0; 2], shear: [-1.0, 1.0], ..Mapping::default() };
        let flipped = Mapping { scale: [1.0, -2.0], ..Mapping::default() };
        for (mapping, expected) in [(turned, [0.0, -1.0, 0.0, 1.0]), (flipped, [1.0, 0.0, 0.0, -1.0])] {
            let mut primitive = mirrored();
            make(&mut primitive, &mapping);
            assert_eq!(primitive.mesh.tangents[primitive.mesh.indices[0] as usize], expected, "{mapping:?}");
        }
    }

    #[test]
    fn what_has_tangents_or_needs_none_stays_as_it_is() {
        let mut given = mirrored();
        given.mesh.tangents = vec![ANY; 4];
        let mut flat = mirrored();
        flat.mesh.normals.clear();
        let mut without = mirrored();
        without.mesh.uvs.clear();
        let mut other_set = mirrored();
        make(&mut other_set, &Mapping { second: true, ..Mapping::default() });
        assert!(other_set.mesh.tangents.is_empty(), "it has no second set");
        for mut primitive in [given, flat, without] {
            let before = primitive.mesh.tangents.clone();
            make(&mut primitive, &Mapping::default());
            assert_eq!((primitive.mesh.tangents, primitive.mesh.positions.len()), (before, 4));
        }
    }

    #[test]
    fn triangles_without_extent_in_the_picture_take_part() {
        let mut primitive = mirrored();
        primitive.mesh.uvs = vec![[0.5; 2]; 4];
        primitive.mesh.uvs[3] = [f32::NAN; 2];
        make(&mut primitive, &Mapping::default()); // whatever it makes of them, all have as many of everything
        assert!(primitive.mesh.check().is_ok());
    }
}
