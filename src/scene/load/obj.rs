//! OBJ files: blocks of statements, parsed in parallel, become meshes in the order of the file. Every mistake has its line.
use super::blocks::Blocks;
use super::few;
use super::library::{self, Library};
use super::obj_block::{Indices, NO_COLOR, NO_INDEX, ObjBlock, Statement};
use super::obj_part::{Corner, NO_EXTRA, Numbering, Part, PartBuilder};
use crate::error::{Checked, Error, Result};
use crate::image::input;
use crate::layout::NONE;
use crate::memory;
use crate::threads;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fmt::Display;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Contents of an OBJ file.
#[derive(Debug, Default)]
pub struct ObjFile<'a> {
    /// At least one. An object is split wherever its material changes, and where faces begin or cease to have normals
    /// (texture coordinates); its parts follow each other.
    pub parts: Vec<Part<'a>>,
    /// The warning for a mesh with the file's own materials, some of which grey replaces.
    pub grey: Option<String>,
}

/// Reads an OBJ file and the MTL files it names.
///
/// # Errors
/// [`Error::Input`] with file, line, what is wrong and what to do; [`Error::Memory`].
pub fn load(path: &Path, numbering: Numbering, library: &mut Library) -> Result<ObjFile<'static>> {
    parse(path, input::open(path)?, numbering, library)
}

/// [`load`] from any reader; `path` is for messages and for finding the MTL files.
///
/// # Errors
/// See [`load`].
pub fn parse(
    path: &Path,
    reader: impl Read + Send,
    numbering: Numbering,
    library: &mut Library,
) -> Result<ObjFile<'static>> {
    let mut parser = Parser::new(path, library);
    parser.part.numbering = numbering;
    threads::within(|| read(Blocks::new(reader), parser))
}

fn read(mut blocks: Blocks<impl Read + Send>, mut parser: Parser) -> Result<ObjFile<'static>> {
    let mut parsed: Vec<ObjBlock> = Vec::new();
    loop {
        let next = || {
            let texts = blocks.take(BLOCKS * rayon::current_num_threads());
            texts.par_iter().map(|text| ObjBlock::parse(text)).collect()
        };
        // While some blocks are put together, the next ones are parsed.
        let (next, added) = rayon::join(next, || parsed.drain(..).try_for_each(|block| parser.add(block)));
        added?;
        parsed = next;
        if parsed.is_empty() {
            return match blocks.broken() {
                Some(what) => Err(parser.wrong(parser.above.max(1), what)),
                None => Ok(parser.finish()),
            };
        }
    }
}

/// Blocks per thread that are parsed at a time.
const BLOCKS: usize = 4;
/// Estimated bytes of a parsed file from which on available memory is checked.
const UNASKED: u64 = 1 << 26;
/// Approximate bytes of a part with its name. The arrays below count twice, since arrays double when they are full.
const BYTES_OF_PART: u64 = 400;
const BYTES_OF_VERTEX: u64 = 2 * (12 + 4);
/// Of a position of the file, and of a vertex that is made of it.
const BYTES_OF_COLOR: u64 = 2 * 12;
const BYTES_OF_CORNER_COLOR: u64 = 2 * 16;
const BYTES_OF_CORNER: u64 = 2 * (12 + 12 + 8 + 16);
const BYTES_OF_TRIANGLE: u64 = 2 * 12;

struct Parser<'a> {
    path: &'a Path,
    library: &'a mut Library,
    /// Number of lines above the block that is being added.
    above: usize,
    /// Values of `v`, `vt` and `vn` so far.
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// As [`ObjBlock::colors`].
    colors: Vec<[f32; 3]>,
    /// As [`ObjBlock::has_others`].
    has_others: bool,
    parts: Vec<Part<'static>>,
    part: PartBuilder,
    corners: Vec<Corner>,
    /// Materials by name: the scene file's own, and those of the libraries read so far.
    names: HashMap<String, u32>,
    /// Names of materials that are not there and that faces ask for, and the one that the next face would.
    unknown: BTreeSet<String>,
    wanted: Option<String>,
    /// `mtllib` statements, and the true paths of what they name: each is read once.
    statements: HashSet<String>,
    libraries: HashSet<PathBuf>,
    /// Names of libraries that do not exist.
    missing: BTreeSet<String>,
    /// Keys of curves and curved surfaces.
    curved: BTreeSet<&'static str>,
    /// Faces of one or two corners, dropped: how many, and the line of the first.
    short_faces: (usize, usize),
    /// Approximate bytes of what was read so far, and the number for which memory was checked.
    held: u64,
    asked: u64,
}

impl<'a> Parser<'a> {
    fn new(path: &'a Path, library: &'a mut Library) -> Self {
        Self {
            path,
            names: library.tables.clone(),
            library,
            above: 0,
            positions: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            colors: Vec::new(),
            has_others: false,
            parts: Vec::new(),
            part: PartBuilder::default(),
            corners: Vec::new(),
            unknown: BTreeSet::new(),
            wanted: None,
            statements: HashSet::new(),
            libraries: HashSet::new(),
            missing: BTreeSet::new(),
            curved: BTreeSet::new(),
            short_faces: (0, 0),
            held: 0,
            asked: UNASKED,
        }
    }

    fn wrong(&self, line: usize, what: impl Display) -> Error {
        Error::input_at(self.path, format!("line {line}"), what)
    }

    fn add(&mut self, block: ObjBlock) -> Result<()> {
        let above = [self.positions.len(), self.uvs.len(), self.normals.len()];
        self.positions.extend(block.positions);
        self.uvs.extend(block.uvs);
        self.normals.extend(block.normals);
        let [v, vt, vn] = [self.positions.len(), self.uvs.len(), self.normals.len()];
        if !(block.colors.is_empty() && self.colors.is_empty()) {
            let before = self.colors.len();
            self.colors.resize(above[0], NO_COLOR);
            self.colors.extend(block.colors);
            self.colors.resize(v, NO_COLOR);
            self.held += BYTES_OF_COLOR * (v - before) as u64;
        }
        self.has_others |= block.has_others;
        self.held +=
            BYTES_OF_VERTEX * (v - above[0]) as u64 + 16 * (vt - above[1]) as u64 + 24 * (vn - above[2]) as u64;
        let mut corners = &block.corners[..];
        for (line, statement) in block.statements {
            let line = self.above + line as usize;
            let done = match statement {
                Statement::Face(count, defined) => {
                    let (face, others) = corners.split_at(count as usize);
                    corners = others;
                    self.face(line, face, std::array::from_fn(|i| above[i] as i64 + i64::from(defined[i])))
                }
                Statement::Name(name) => {
                    self.rename(&name);
                    Ok(())
                }
                Statement::Wear(name) => {
                    self.wear(name);
                    Ok(())
                }
                Statement::Curved(key) => {
                    self.curved.insert(key);
                    Ok(())
                }
                Statement::Libraries(names) => {
                    self.read_libraries(names)?;
                    Ok(())
                }
            };
            done.map_err(|what| self.wrong(line, what))?;
        }
        if let Some((line, what)) = block.mistake {
            return Err(self.wrong(self.above + line as usize, what));
        }
        self.above += block.lines as usize;
        self.ask()
    }

    fn rename(&mut self, name: &str) {
        self.end_part();
        self.part.rename(name);
    }

    /// The corners of a face have the texture coordinates (normals) that all of them have, or none.
    fn face(&mut self, line: usize, written: &[Indices], defined: [i64; 3]) -> Checked {
        self.corners.clear();
        for indices in written {
            self.corners.push(corner(indices, defined)?);
        }
        if self.corners.len() < 3 {
            let (count, first) = self.short_faces;
            self.short_faces = (count + 1, if count == 0 { line } else { first });
            return Ok(());
        }
        self.unknown.extend(self.wanted.take());
        let has = [1, 2].map(|extra| self.corners.iter().all(|corner| corner[extra] != NO_EXTRA));
        if self.part.differs(has) {
            self.end_part();
        }
        let points = [&self.positions[..], &self.normals, &self.colors];
        let made = self.part.face(&self.corners, has, points, &self.uvs);
        let of_corner = BYTES_OF_CORNER + if self.colors.is_empty() { 0 } else { BYTES_OF_CORNER_COLOR };
        self.held += BYTES_OF_TRIANGLE * (self.corners.len() as u64 - 2) + of_corner * made as u64;
        Ok(())
    }

    fn wear(&mut self, name: String) {
        let material = self.names.get(&name).copied().unwrap_or(NONE);
        self.wanted = (material == NONE).then_some(name);
        if self.part.material != material {
            self.end_part();
            self.part.material = material;
        }
    }

    fn read_libraries(&mut self, statement: String) -> Result<()> {
        if self.statements.contains(&statement) || self.library.unworn.contains(self.path) {
            return Ok(());
        }
        let (found, missing) = library::find(self.path, &statement);
        self.statements.insert(statement);
        self.missing.extend(missing);
        for path in found {
            if self.libraries.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
                self.names.extend(self.library.mtl(&path)?.iter().cloned());
            }
        }
        Ok(())
    }

    /// What follows is another part, if this one has faces.
    fn end_part(&mut self) {
        if !self.part.is_empty() {
            self.parts.push(self.part.take());
            self.held += BYTES_OF_PART;
        }
    }

    /// Checks available memory whenever the size has doubled.
    fn ask(&mut self) -> Result<()> {
        if self.held <= self.asked {
            return Ok(());
        }
        self.asked = 2 * self.held;
        let about =
            |lack| Error::Memory(format!("{}, line {}: {lack}; split the file", self.path.display(), self.above));
        memory::check(self.held).map_err(about)
    }

    /// The last part is kept even without faces: a file has at least one.
    fn finish(mut self) -> ObjFile<'static> {
        self.parts.push(self.part.take());
        if let (short @ 1.., line) = self.short_faces {
            let what = format!("{short} of fewer than three corners dropped, the first in line {line}");
            self.library.warnings.push(format!("{}: faces repaired: {what}", self.path.display()));
        }
        if !self.curved.is_empty() {
            let keys: Vec<_> = self.curved.iter().copied().collect();
            self.library.warnings.push(format!("{}: not read: {}", self.path.display(), keys.join(", ")));
        }
        for part in &mut self.parts {
            self.library.color(part, self.has_others);
        }
        if self.has_others {
            let what = "numbers behind positions are not read: as colours, all must be from 0 to 1";
            self.library.warnings.push(format!("{}: {what}", self.path.display()));
        }
        ObjFile { grey: self.grey(), parts: self.parts }
    }

    /// The warning about material names that are used but not defined.
    fn grey(&self) -> Option<String> {
        let unknown: Vec<_> = self.unknown.iter().collect();
        let libraries = match self.missing.is_empty() {
            true => String::new(),
            false => format!(" (no such library: {})", few(&self.missing)),
        };
        let late = unknown.iter().any(|name| self.names.contains_key(*name));
        let nowhere = if late { "defined nowhere, or only below their use" } else { "defined nowhere" };
        let has_colors = self.parts.iter().any(|part| !part.mesh.colors.is_empty());
        let stand_in = if has_colors { "grey, or what colours of vertices show," } else { "grey" };
        let what = || format!("{stand_in} is used for materials {nowhere}: {}{libraries}", few(&unknown));
        (!unknown.is_empty()).then(|| format!("{}: {}", self.path.display(), what()))
    }
}

/// The places of what a corner refers to, from 0 on, where so many are defined. Negative indices count back from the last one.
fn corner(indices: &Indices, defined: [i64; 3]) -> Checked<Corner> {
    const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];
    let mut corner = [NO_EXTRA; 3];
    for (i, (&index, count)) in indices.iter().zip(defined).enumerate().filter(|(_, (index, _))| **index != NO_INDEX) {
        if index == 0 || index > count || index < -count {
            let what = format!("the face uses {} {index}, but {count} are defined above it", KINDS[i]);
            return Err(format!("{what}: export the file again"));
        }
        let place = if index > 0 { index - 1 } else { count + index };
        corner[i] = u32::try_from(place).map_err(|_| "the file has more than 2^32 vertices: split it")?;
    }
    Ok(corner)
}

#[cfg(test)]
mod tests;
