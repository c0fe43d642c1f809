//! Collects a part of an OBJ file: corners, which index positions, texture coordinates and normals separately, become vertices
//! that have all three.
use super::obj_block::NO_COLOR;
use super::triangulate::Triangulator;
use crate::layout::NONE;
use crate::scene::description::mesh::Mesh;
use std::borrow::Cow;

/// What counts as a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Numbering {
    /// Corners of the same indices.
    #[default]
    Shared,
    /// Every corner of a face, in the order of the file, so that files of the same faces number theirs alike.
    Corners,
}

/// Triangles of one object and one material.
#[derive(Clone, Debug, Default)]
pub struct Part<'a> {
    /// Name of the object or group.
    pub name: String,
    /// Index of the material.
    pub material: u32,
    /// Borrowed where an engine has it in memory.
    pub mesh: Cow<'a, Mesh>,
}

/// Indices of a position, a texture coordinate and a normal.
pub type Corner = [u32; 3];
/// The colour of vertices whose positions have none.
pub const NO_VERTEX_COLOR: [f32; 4] = [NO_COLOR[0], NO_COLOR[1], NO_COLOR[2], 1.0];
/// In place of a texture coordinate or normal that a corner does not have.
pub const NO_EXTRA: u32 = u32::MAX;

/// Vertices of one position that are compared before another is made; a duplicate takes memory but changes no triangle.
const LOOKS: usize = 16;

/// The name of faces before the first object.
const UNNAMED: &str = "unnamed_object";

/// Collects the faces of one part.
pub struct PartBuilder {
    /// What counts as a vertex.
    pub numbering: Numbering,
    name: String,
    /// Scene material, or [`NONE`] before the first known one.
    pub material: u32,
    mesh: Mesh,
    /// Whether its faces have texture coordinates, and normals.
    has: [bool; 2],
    /// The last vertex that was made of each position, or [`NONE`].
    latest: Vec<u32>,
    /// The corner that each vertex was made of, and the vertex before it of the same position, or [`NONE`].
    made: Vec<(Corner, u32)>,
    triangulator: Triangulator,
    face: Vec<u32>,
}

impl Default for PartBuilder {
    fn default() -> Self {
        Self {
            numbering: Numbering::Shared,
            name: UNNAMED.into(),
            material: NONE,
            mesh: Mesh::default(),
            has: [false; 2],
            latest: Vec::new(),
            made: Vec::new(),
            triangulator: Triangulator::default(),
            face: Vec::new(),
        }
    }
}

impl PartBuilder {
    /// Sets the name of the faces that follow.
    pub fn rename(&mut self, name: &str) {
        self.name = if name.is_empty() { UNNAMED } else { name }.to_owned();
    }

    /// Whether no face is in it.
    pub fn is_empty(&self) -> bool {
        self.mesh.indices.is_empty()
    }

    /// Whether faces that have texture coordinates (normals) or not have to go to another part.
    pub fn differs(&self, has: [bool; 2]) -> bool {
        !self.is_empty() && self.has != has
    }

    /// Returns the collected part; name and material stay for the next one.
    pub fn take(&mut self) -> Part<'static> {
        for ([position, ..], _) in self.made.drain(..) {
            self.latest[position as usize] = NONE;
        }
        let mesh = Cow::Owned(std::mem::take(&mut self.mesh));
        Part { name: self.name.clone(), material: self.material, mesh }
    }

    /// Adds a face of three corners or more; returns how many vertices were made. `points`: positions, normals, and the positions' colours,
    /// if there are any.
    pub fn face(&mut self, corners: &[Corner], has: [bool; 2], points: [&[[f32; 3]]; 3], uvs: &[[f32; 2]]) -> usize {
        let before = self.made.len();
        self.has = has;
        self.latest.resize(points[0].len(), NONE);
        self.face.clear();
        for &[position, uv, normal] in corners {
            let corner = [position, if has[0] { uv } else { NO_EXTRA }, if has[1] { normal } else { NO_EXTRA }];
            let known = if self.numbering == Numbering::Shared { self.known(corner) } else { None };
            let vertex = known.unwrap_or_else(|| {
                if let Some(&[r, g, b]) = points[2].get(position as usize) {
                    // Faces before the first colour have none.
                    self.mesh.colors.resize(self.mesh.positions.len(), NO_VERTEX_COLOR);
                    self.mesh.colors.push([r, g, b, 1.0]);
                }
                self.mesh.positions.push(points[0][position as usize]);
                self.mesh.uvs.extend(has[0].then(|| uvs[uv as usize]));
                self.mesh.normals.extend(has[1].then(|| points[1][normal as usize]));
                let latest = &mut self.latest[position as usize];
                self.made.push((corner, std::mem::replace(latest, self.made.len() as u32)));
                *latest
            });
            self.face.push(vertex);
        }
        self.triangulator.add(&self.mesh.positions, &self.face, &mut self.mesh.indices);
        self.made.len() - before
    }

    /// The vertex that was made of such a corner, if it is among the latest of its position.
    fn known(&self, corner: Corner) -> Option<u32> {
        let link = |vertex: u32| self.made.get(vertex as usize).map(|&(_, before)| before);
        let mut vertices = std::iter::successors(Some(self.latest[corner[0] as usize]), |&vertex| link(vertex));
        vertices.by_ref().take(LOOKS).find(|&vertex| self.made.get(vertex as usize).is_some_and(|m| m.0 == corner))
    }
}
