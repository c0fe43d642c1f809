//! PLY files: text or binary of either byte order, also within gzip. The crate `ply-rs-bw` reads their headers and binary rows;
//! what headers claim is compared with what there is before.
//!
//! Of vertices `x y z`, `nx ny nz`, `u v` (or `s t`, `texture_u texture_v`), and `red green blue alpha` are read; integers are
//! sRGB code values, as scanners and modellers write them, and floats are linear. Faces are polygons, or strips of triangles.
use super::library::Library;
use super::obj::ObjFile;
use super::obj_part::{Numbering, Part};
use super::triangulate::Triangulator;
use crate::error::{Checked, Error, Result};
use crate::image::{contained, input};
use crate::math::srgb::linear_from_srgb;
use crate::memory;
use crate::scene::BYTES_OF_TRIANGLE;
use crate::scene::description::mesh::Mesh;
use flate2::read::MultiGzDecoder;
use ply_rs_bw::parser::{ParseError, Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult};
use std::borrow::Cow;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::Path;

/// Bytes of a vertex, and of a face of three or four corners, as read and as a part of the mesh.
const BYTES_OF_VERTEX: u64 = 2 * 48;
const BYTES_OF_FACE: u64 = 24 + 32 + 24;

/// Largest number of bytes that one of gzip can stand for.
const DEFLATE: u64 = 1032;

/// Reads a PLY file.
///
/// # Errors
/// [`Error::Input`] with file, what is wrong and what to do; [`Error::Memory`].
pub fn load(path: &Path, numbering: Numbering, library: &mut Library) -> Result<ObjFile<'static>> {
    let file = input::open(path)?;
    let size = file.metadata().map_or(u64::MAX, |m| m.len());
    let packed = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"));
    let mut file = BufReader::with_capacity(1 << 18, file);
    let warnings = &mut library.warnings;
    let mut read = || match packed {
        true => {
            let unpacked = &mut BufReader::with_capacity(1 << 18, MultiGzDecoder::new(&mut file));
            parse(path, unpacked, size.saturating_mul(DEFLATE), numbering, warnings)
        }
        false => parse(path, &mut file, size, numbering, warnings),
    };
    // The memory that is missing is found before the crate is asked for anything.
    let mesh = contained(|| Ok(read())).map_err(|what| Error::input(path, what))??;
    let material = if mesh.colors.is_empty() { library.grey() } else { library.white() };
    let part = Part { name: String::new(), material, mesh: Cow::Owned(mesh) };
    Ok(ObjFile { parts: vec![part], grey: None })
}

/// What faces may have that no vertex of theirs has, by its property, and as a warning calls it.
const UNREAD: [(&str, &str); 2] = [("texcoord", "texture coordinates of faces"), ("red", "colours of faces")];

fn parse(
    path: &Path,
    reader: &mut dyn BufRead,
    size: u64,
    numbering: Numbering,
    warnings: &mut Vec<String>,
) -> Result<Mesh> {
    if !reader.fill_buf().is_ok_and(|head| head.starts_with(b"ply")) {
        return Err(Error::input(path, "is no PLY file"));
    }
    let about = |what| Error::input(path, what);
    let mut whole = Cursor::new(head::read(reader).map_err(about)?).chain(reader);
    let mut file = File { reader: Reader::new(&mut whole as &mut dyn BufRead), line: 0 };
    let header = Parser::<Vertex>::new().read_header(&mut file.reader).map_err(|e| about(damaged(&e)))?;
    file.line = file.reader.line();
    check(&header, size).map_err(about)?;
    let of_faces = |(name, _): &(&str, &str)| header.elements.get("face").is_some_and(|face| has(face, &[name]));
    let unread: Vec<_> = UNREAD.into_iter().filter(of_faces).map(|(_, what)| what).collect();
    if !unread.is_empty() {
        warnings.push(format!("{}: not read: {}", path.display(), unread.join(", ")));
    }
    let count = |name| header.elements.get(name).map_or(0, |e| e.count as u64);
    let (vertices, faces) = (count("vertex"), count("face") + count("tristrips"));
    let read = vertices * BYTES_OF_VERTEX + faces * BYTES_OF_FACE;
    // A face is a triangle or more, and what those need is known before minutes are spent on reading them.
    memory::need(format!("{}: {faces} faces", path.display()), read.max(faces * BYTES_OF_TRIANGLE))?;
    let (mesh, dropped) = file.mesh(&header, numbering).map_err(about)?;
    if dropped > 0 {
        let place = path.display();
        warnings.push(format!("{place}: faces repaired: {dropped} of fewer than three corners dropped"));
    }
    Ok(mesh)
}

/// Compares the header with the bytes that there can be: every property of an element takes at least one.
fn check(header: &Header, size: u64) -> Checked {
    for (name, element) in &header.elements {
        let least = (element.count as u64).saturating_mul(element.properties.len().max(1) as u64);
        if least > size {
            let count = element.count;
            return Err(format!("claims {count} of \"{}\", more than it has bytes for; is it complete?", short(name)));
        }
    }
    let Some(vertex) = header.elements.get("vertex") else { return Err("has no vertices: is it a mesh?".into()) };
    let lacks_corners = |face: &ElementDef| face.count > 0 && !face.properties.keys().any(|name| is_corners(name));
    if header.elements.get("face").is_some_and(lacks_corners) {
        return Err("its faces have no vertex_indices: save it again as PLY 1.0".into());
    }
    let missing = ["x", "y", "z"].into_iter().find(|axis| !has(vertex, &[axis]));
    missing.map_or(Ok(()), |axis| Err(format!("its vertices have no {axis}")))
}

/// A name of the file for a message.
fn short(name: &str) -> String {
    name.chars().filter(|c| !c.is_control()).take(40).collect()
}

fn has(element: &ElementDef, names: &[&str]) -> bool {
    names.iter().all(|name| element.properties.contains_key(*name))
}

fn damaged(e: &ParseError) -> String {
    let line = e.line().map_or_else(String::new, |line| format!(" in line {line}"));
    format!("is damaged or ends too early{line}: save it again as PLY 1.0")
}

/// Of any reader, so that the crate's parser is compiled once.
struct File<'a> {
    reader: Reader<&'a mut dyn BufRead>,
    /// Number of the line that is next in a text.
    line: usize,
}

impl File<'_> {
    fn rows<E: PropertyAccess>(&mut self, element: &ElementDef, header: &Header) -> Checked<Vec<E>> {
        match header.encoding {
            Encoding::Ascii => text::rows(*self.reader.get_mut(), element, &mut self.line),
            _ => {
                let rows = Parser::new().read_payload_for_element(&mut self.reader, element, header);
                rows.map_err(|e| damaged(&e))
            }
        }
    }

    /// The mesh, and how many faces have too few corners.
    fn mesh(&mut self, header: &Header, numbering: Numbering) -> Checked<(Mesh, usize)> {
        let (mut mesh, mut faces, mut strips) = (Mesh::default(), Vec::<Face>::new(), Vec::<Face>::new());
        for (name, element) in &header.elements {
            match name.as_str() {
                "vertex" => add_vertices(self.rows(element, header)?, element, &mut mesh),
                "face" => faces = self.rows(element, header)?,
                "tristrips" => strips = self.rows(element, header)?,
                _ => drop(self.rows::<Nothing>(element, header)?),
            }
        }
        if faces.is_empty() && strips.is_empty() {
            return Err("has no faces: points alone have no surface".to_owned());
        }
        let vertices = mesh.positions.len();
        let (mesh, vertices_of) = match numbering {
            Numbering::Shared => (mesh, None),
            Numbering::Corners => (Mesh::default(), Some(mesh)),
        };
        let mut faces_of = Faces { mesh, vertices_of, triangulator: Triangulator::default(), dropped: 0 };
        for face in faces {
            faces_of.add(face.corners(vertices, &face.0)?);
        }
        for strip in strips {
            strip.triangles(vertices)?.into_iter().for_each(|triangle| faces_of.add(triangle.to_vec()));
        }
        Ok((faces_of.mesh, faces_of.dropped))
    }
}

/// Collects faces.
struct Faces {
    mesh: Mesh,
    /// Where each corner becomes a vertex: those of the file.
    vertices_of: Option<Mesh>,
    triangulator: Triangulator,
    /// Faces of fewer than three corners.
    dropped: usize,
}

impl Faces {
    fn add(&mut self, mut corners: Vec<u32>) {
        if corners.len() < 3 {
            self.dropped += 1;
            return;
        }
        let mesh = &mut self.mesh;
        if let Some(from) = &self.vertices_of {
            corners.iter_mut().for_each(|corner| *corner = copy_vertex(from, *corner as usize, mesh));
        }
        self.triangulator.add(&mesh.positions, &corners, &mut mesh.indices);
    }
}

/// Returns the number of the copy.
fn copy_vertex(from: &Mesh, vertex: usize, to: &mut Mesh) -> u32 {
    to.positions.push(from.positions[vertex]);
    to.normals.extend(from.normals.get(vertex));
    to.uvs.extend(from.uvs.get(vertex));
    to.colors.extend(from.colors.get(vertex));
    to.positions.len() as u32 - 1
}

fn add_vertices(rows: Vec<Vertex>, element: &ElementDef, mesh: &mut Mesh) {
    mesh.positions = rows.iter().map(|row| row.position).collect();
    if has(element, &["nx", "ny", "nz"]) {
        mesh.normals = rows.iter().map(|row| row.normal).collect();
    }
    if [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]].iter().any(|names| has(element, names)) {
        mesh.uvs = rows.iter().map(|row| row.uv).collect();
    }
    if has(element, &["red", "green", "blue"]) {
        mesh.colors = rows.iter().map(|row| row.color).collect();
    }
}

/// A row of `vertex`.
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    uv: [f32; 2],
    color: [f32; 4],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: [0.0; 3], normal: [0.0; 3], uv: [0.0; 2], color: [1.0; 4] }
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            "nx" => &mut self.normal[0],
            "ny" => &mut self.normal[1],
            "nz" => &mut self.normal[2],
            "u" | "s" | "texture_u" => &mut self.uv[0],
            "v" | "t" | "texture_v" => &mut self.uv[1],
            "red" | "green" | "blue" | "alpha" => return self.set_color(name, &value),
            _ => return PropertyAccessResult::Ignored,
        };
        let Some(number) = value.to_f32_lossy() else { return PropertyAccessResult::UnsupportedType };
        *slot = number;
        PropertyAccessResult::Set
    }
}

impl Vertex {
    fn set_color(&mut self, name: &str, value: &Property) -> PropertyAccessResult {
        let Some(number) = value.to_f32_lossy() else { return PropertyAccessResult::UnsupportedType };
        let code = match value {
            Property::UChar(_) => Some(number / 255.0),
            Property::UShort(_) => Some(number / 65535.0),
            Property::Float(_) | Property::Double(_) => None,
            // Wider numbers count to 255 as well.
            _ => Some(number / 255.0),
        };
        let linear = code.map_or(number, linear_from_srgb);
        match name {
            "red" => self.color[0] = linear,
            "green" => self.color[1] = linear,
            "blue" => self.color[2] = linear,
            _ => self.color[3] = code.unwrap_or(number),
        }
        PropertyAccessResult::Set
    }
}

/// Corners of a row of `face`, or of `tristrips`, where -1 ends a strip.
struct Face(Vec<i32>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self(Vec::new())
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if !is_corners(name) {
            return PropertyAccessResult::Ignored;
        }
        if let Property::ListInt(corners) = value {
            self.0 = corners;
            return PropertyAccessResult::Set;
        }
        let Some(corners) = value.to_u32_list() else { return PropertyAccessResult::UnsupportedType };
        // What no 32-bit index reaches becomes negative, which is refused.
        self.0 = corners.into_iter().map(|corner| corner as i32).collect();
        PropertyAccessResult::Set
    }
}

fn is_corners(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

impl Face {
    fn corners(&self, vertices: usize, of: &[i32]) -> Checked<Vec<u32>> {
        let known = |&corner: &i32| u32::try_from(corner).ok().filter(|&i| (i as usize) < vertices).ok_or(corner);
        of.iter()
            .map(known)
            .collect::<std::result::Result<_, i32>>()
            .map_err(|corner| format!("has an index of {corner}, and {vertices} vertices: save it again"))
    }

    /// Every other triangle of a strip is turned around.
    fn triangles(&self, vertices: usize) -> Checked<Vec<[u32; 3]>> {
        let mut triangles = Vec::new();
        for strip in self.0.split(|&corner| corner == -1) {
            let corners = self.corners(vertices, strip)?;
            let turned = |(i, three): (usize, &[u32])| [three[0], three[1 + i % 2], three[2 - i % 2]];
            triangles.extend(corners.windows(3).enumerate().map(turned));
        }
        Ok(triangles)
    }
}

/// A row of what is passed over.
struct Nothing;

impl PropertyAccess for Nothing {
    fn new() -> Self {
        Self
    }
}

mod head;
mod text;

#[cfg(test)]
mod tests;
