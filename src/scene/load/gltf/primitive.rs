//! Primitives of meshes: attributes of vertices, and triangles in the three ways that glTF writes them.
use super::accessor::Elements;
use super::asset::Asset;
use crate::error::Result;
use crate::memory;
use crate::scene::description::Mesh;
use gltf_json::Index;
use gltf_json::accessor::Accessor;
use gltf_json::mesh::{Mode, MorphTarget, Primitive as Json, Semantic};
use gltf_json::validation::Checked;

/// The surface of a primitive, at rest.
#[derive(Debug)]
pub struct Primitive {
    /// Vertices and triangles.
    pub mesh: Mesh,
    /// Index of the material.
    pub material: Option<usize>,
    /// How far each morph target moves the vertices.
    pub targets: Vec<Target>,
    /// The joints that move the vertices.
    pub joints: Vec<Influence>,
}

impl Primitive {
    /// The same, all of it moved by the first joint.
    pub fn of_one_joint(&self) -> Self {
        let vertices = self.mesh.positions.len();
        let joints = Influence { joints: vec![[0.0; 4]; vertices], weights: vec![[1.0, 0.0, 0.0, 0.0]; vertices] };
        let (mesh, targets) = (self.mesh.clone(), self.targets.clone());
        Self { mesh, material: self.material, targets, joints: vec![joints] }
    }
}

/// Four of the joints that move each vertex.
#[derive(Debug)]
pub struct Influence {
    /// Whole numbers: which of the skin's joints.
    pub joints: Vec<[f32; 4]>,
    /// How much each of them counts.
    pub weights: Vec<[f32; 4]>,
}

/// What a morph target of weight 1 adds to each vertex; an empty list adds nothing.
#[derive(Clone, Debug, Default)]
pub struct Target {
    /// Added to positions.
    pub positions: Vec<[f32; 3]>,
    /// Added to normals.
    pub normals: Vec<[f32; 3]>,
    /// Added to the directions of tangents.
    pub tangents: Vec<[f32; 3]>,
}

/// Most bytes of a vertex with all attributes, of a morph target's part of it, and of three corners.
const BYTES_OF_VERTEX: u64 = 12 + 12 + 8 + 8 + 16 + 16 + 64;
const BYTES_OF_TARGET: u64 = 36;
const BYTES_OF_CORNERS: u64 = 16;

/// Whether a primitive has a surface, which points and lines do not have.
pub fn has_surface(primitive: &Json) -> bool {
    let surfaces = [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan];
    matches!(primitive.mode, Checked::Valid(mode) if surfaces.contains(&mode))
}

/// Bytes that reading a primitive takes, at most. Its accessors must have been checked.
pub fn bytes(asset: &Asset, primitive: &Json) -> u64 {
    let (vertices, corners) = (count(asset, attribute(primitive, Semantic::Positions)), corners(asset, primitive));
    // A corner of a strip has up to three corners of triangles.
    let read = vertices.min(corners.saturating_mul(3));
    let targets = primitive.targets.as_ref().map_or(0, |targets| targets.len() as u64);
    let of_vertices = read.saturating_mul(BYTES_OF_VERTEX + targets.saturating_mul(BYTES_OF_TARGET));
    of_vertices.saturating_add(corners.saturating_mul(BYTES_OF_CORNERS))
}

/// Number of corners that a primitive's triangles have, or strips and fans share.
pub fn corners(asset: &Asset, primitive: &Json) -> u64 {
    count(asset, primitive.indices.as_ref().or_else(|| attribute(primitive, Semantic::Positions)))
}

fn count(asset: &Asset, index: Option<&Index<Accessor>>) -> u64 {
    index.map_or(0, |i| asset.root.accessors[i.value()].count.0)
}

/// Reads a primitive that has a surface; `None` for one without positions, which extensions may fill.
///
/// # Errors
/// [`crate::error::Error::Input`] for attributes of other types than they have, or of different lengths, and for indices that
/// lead nowhere.
pub fn read(asset: &Asset, primitive: &Json, place: &str) -> Result<Option<Primitive>> {
    let Some(positions) = attribute(primitive, Semantic::Positions) else { return Ok(None) };
    let vertices = Elements::of(asset, positions.value())?.count();
    let mut reader = Reader { asset, primitive, place, vertices, used: None };
    let indices = reader.used_triangles()?;
    let uv_up = |uvs: Vec<[f32; 2]>| uvs.into_iter().map(|[u, v]| [u, 1.0 - v]).collect();
    let normals = reader.numbers(Semantic::Normals)?;
    // glTF 2.0, section 3.7.2.1: tangents without normals are ignored.
    let tangents = if normals.is_empty() { Vec::new() } else { reader.numbers(Semantic::Tangents)? };
    let mut mesh = Mesh {
        positions: reader.numbers(Semantic::Positions)?,
        normals,
        uvs: uv_up(reader.numbers(Semantic::TexCoords(0))?),
        uvs2: uv_up(reader.numbers(Semantic::TexCoords(1))?),
        colors: reader.colors()?,
        tangents,
        indices,
    };
    let joints = reader.joints()?;
    // What moves may part corners that rest at one place.
    if primitive.targets.is_none() && joints.is_empty() {
        drop_joints_of_strips(&mut mesh);
    }
    let targets = primitive.targets.iter().flatten().map(|target| reader.target(target)).collect::<Result<_>>()?;
    let material = primitive.material.map(|material| material.value());
    Ok(Some(Primitive { mesh, material, targets, joints }))
}

/// Drops triangles with two corners at one place, as strips and spheres have them on purpose: they are no reason for a warning.
fn drop_joints_of_strips(mesh: &mut Mesh) {
    let at = |corner: u32| mesh.positions[corner as usize];
    let open = |t: &&[u32]| at(t[0]) != at(t[1]) && at(t[1]) != at(t[2]) && at(t[2]) != at(t[0]);
    mesh.indices = mesh.indices.chunks_exact(3).filter(open).flatten().copied().collect();
}

fn attribute(primitive: &Json, semantic: Semantic) -> Option<&Index<Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic))
}

struct Reader<'a> {
    asset: &'a Asset<'a>,
    primitive: &'a Json,
    place: &'a str,
    vertices: usize,
    /// The vertices that are read, in ascending order; all if there are none.
    used: Option<Vec<u32>>,
}

impl Reader<'_> {
    /// An attribute of every vertex; empty where it is not there.
    fn numbers<const N: usize>(&self, semantic: Semantic) -> Result<Vec<[f32; N]>> {
        attribute(self.primitive, semantic).map_or_else(|| Ok(Vec::new()), |index| self.accessor(index))
    }

    fn accessor<const N: usize>(&self, index: &Index<Accessor>) -> Result<Vec<[f32; N]>> {
        let elements = self.elements(index)?;
        let numbers = match &self.used {
            Some(used) => elements.numbers_of(used.iter().map(|&vertex| vertex as usize)),
            None => elements.numbers(),
        };
        numbers.map_err(|what| self.asset.at(format!("{}, accessor {index}", self.place), what))
    }

    fn elements(&self, index: &Index<Accessor>) -> Result<Elements<'_>> {
        let elements = Elements::of(self.asset, index.value())?;
        match elements.count() == self.vertices {
            true => Ok(elements),
            false => {
                let what = format!("has {} elements for {} vertices", elements.count(), self.vertices);
                Err(self.asset.at(format!("{}, accessor {index}", self.place), what))
            }
        }
    }

    /// Colours may come without opacity.
    fn colors(&self) -> Result<Vec<[f32; 4]>> {
        let Some(index) = attribute(self.primitive, Semantic::Colors(0)) else { return Ok(Vec::new()) };
        let rgba = match self.elements(index)?.width() {
            3 => self.accessor(index)?.into_iter().map(|[r, g, b]: [f32; 3]| [r, g, b, 1.0]).collect(),
            _ => self.accessor(index)?,
        };
        Ok(rgba.into_iter().map(|color: [f32; 4]| color.map(|c| c.clamp(0.0, 1.0))).collect())
    }

    fn target(&self, target: &MorphTarget) -> Result<Target> {
        let read = |index: Option<Index<Accessor>>| index.map_or_else(|| Ok(Vec::new()), |i| self.accessor(&i));
        Ok(Target {
            positions: read(target.positions)?,
            normals: read(target.normals)?,
            tangents: read(target.tangents)?,
        })
    }

    fn joints(&self) -> Result<Vec<Influence>> {
        let mut sets = Vec::new();
        for set in 0.. {
            let (joints, weights) = (self.numbers(Semantic::Joints(set))?, self.numbers(Semantic::Weights(set))?);
            if joints.is_empty() || weights.is_empty() {
                break;
            }
            sets.push(Influence { joints, weights });
        }
        Ok(sets)
    }

    /// Corners of the triangles. Where a primitive has few of the vertices that it shares with others, those alone are read.
    fn used_triangles(&mut self) -> Result<Vec<u32>> {
        let triangles = self.triangles()?;
        if triangles.is_empty() || triangles.len() >= self.vertices {
            return Ok(triangles);
        }
        let mut used = triangles.clone();
        used.sort_unstable();
        used.dedup();
        let place = |vertex: &u32| used.binary_search(vertex).map_or(0, |place| place as u32);
        let placed = triangles.iter().map(place).collect();
        self.used = Some(used);
        Ok(placed)
    }

    /// Corners of the triangles. glTF 2.0, section 3.7.2.1: of a strip and of a fan each corner but two makes a triangle, and
    /// every other triangle of a strip is turned around.
    fn triangles(&self) -> Result<Vec<u32>> {
        let corners = self.corners()?;
        if let Some(index) = corners.iter().find(|&&index| index as usize >= self.vertices) {
            let what = format!("has an index of {index}, and {} vertices: export it again", self.vertices);
            return Err(self.asset.at(self.place, what));
        }
        let count = corners.len().saturating_sub(2);
        let (odd, fan) = match self.primitive.mode {
            Checked::Valid(Mode::TriangleStrip) => (1, false),
            Checked::Valid(Mode::TriangleFan) => (0, true),
            _ => {
                let whole = corners.len() - corners.len() % 3;
                return Ok(corners[..whole].to_vec());
            }
        };
        let mut triangles = memory::vector(self.place, 3 * count)?;
        for i in 0..count {
            let turned = odd * (i % 2);
            let three = match fan {
                true => [i + 1, i + 2, 0],
                false => [i, i + 1 + turned, i + 2 - turned],
            };
            triangles.extend(three.map(|corner| corners[corner]));
        }
        Ok(triangles)
    }

    fn corners(&self) -> Result<Vec<u32>> {
        let Some(index) = &self.primitive.indices else {
            // Accessors have at most as many elements as a file has bytes, or a bound below.
            return Ok((0..u32::try_from(self.vertices).unwrap_or(u32::MAX)).collect());
        };
        let elements = Elements::of(self.asset, index.value())?;
        elements.indices().map_err(|what| self.asset.at(format!("{}, accessor {index}", self.place), what))
    }
}
