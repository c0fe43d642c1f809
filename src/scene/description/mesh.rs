//! Geometry and pictures as scenes have them, whether they come out of files or out of an engine's memory.
use crate::error::Checked;
use std::path::PathBuf;
use std::sync::Arc;

/// Triangles: what files, shapes and engines give. Everything is per vertex.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Positions of the vertices in object units.
    pub positions: Vec<[f32; 3]>,
    /// Normals of the vertices, of any length, outward; empty, or one per position.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates of the vertices, v up, so that row 0 of a picture is v = 1; empty, or one per position.
    pub uvs: Vec<[f32; 2]>,
    /// A second set of texture coordinates, as `uvs`, for textures that ask for set 1.
    pub uvs2: Vec<[f32; 2]>,
    /// Colours of the vertices, linear Rec. 709 and opacity, in [0, 1] (others are clamped), which multiply the `color` of diffuse,
    /// coated and metallic-roughness materials, and the alpha of those that have an opacity; empty, or one per position.
    pub colors: Vec<[f32; 4]>,
    /// Tangents for normal maps: a direction along +u, and +1 or -1, by which `cross(normal, tangent)` becomes a direction along
    /// +v; empty, or one per position.
    pub tangents: Vec<[f32; 4]>,
    /// Vertices of the triangles, three each, counter-clockwise seen from outside.
    pub indices: Vec<u32>,
}

impl Mesh {
    /// # Errors
    /// A sentence that says what does not fit together.
    pub(in crate::scene) fn check(&self) -> Checked {
        let vertices = self.positions.len();
        let extras = [
            ("normals", self.normals.len()),
            ("uvs", self.uvs.len()),
            ("uvs2", self.uvs2.len()),
            ("colors", self.colors.len()),
            ("tangents", self.tangents.len()),
        ];
        if let Some((name, count)) = extras.iter().find(|(_, count)| ![0, vertices].contains(count)) {
            return Err(format!("has {vertices} positions but {count} {name}: give one per position, or none"));
        }
        if !self.indices.len().is_multiple_of(3) {
            return Err(format!("has {} indices: give three per triangle", self.indices.len()));
        }
        match self.indices.iter().find(|&&i| i as usize >= vertices) {
            Some(i) => Err(format!("has an index of {i}, but {vertices} positions: count from 0")),
            None => Ok(()),
        }
    }

    /// Number of triangles of the mesh.
    pub(in crate::scene) fn triangles(&self) -> usize {
        self.indices.len() / 3
    }
}

/// A picture in memory: a texture that materials name as they name a file.
#[derive(Clone, Debug)]
pub struct Bitmap {
    /// What materials call it; wins over a file of that name.
    pub name: PathBuf,
    /// Width in texels, 1 to 65536.
    pub width: u32,
    /// Height in texels, 1 to 65536.
    pub height: u32,
    /// `width * height` texels, row-major, row 0 at the top: sRGB where a material's texture is a colour, else linear;
    /// alpha, always linear, is what masks read.
    pub rgba: Arc<[[u8; 4]]>,
}

/// A picture in memory as a file holds it: a texture that materials name as they name a file. It is decoded beside all others.
#[derive(Clone, Debug)]
pub struct PictureFile {
    /// What materials call it; wins over a file of that name, and may be that of no [`Bitmap`].
    pub name: PathBuf,
    /// The bytes of a PNG, JPEG, EXR, HDR, TGA or BMP file, sRGB or linear as they are of a file.
    pub bytes: Arc<[u8]>,
}
