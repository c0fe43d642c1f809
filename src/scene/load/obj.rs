//! OBJ files: statements become meshes line by line, so that every mistake has its line.
use super::library::{self, Library};
use super::lines::Lines;
use super::obj_part::{Corner, NO_EXTRA, Part, PartBuilder};
use crate::error::{Error, Result};
use crate::image::input;
use crate::layout::NONE;
use crate::memory;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

/// The value that a line holds, or a sentence about what is wrong with it.
type Checked<T> = std::result::Result<T, String>;

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
pub fn load(path: &Path, library: &mut Library) -> Result<ObjFile<'static>> {
    parse(path, BufReader::with_capacity(1 << 18, input::open(path)?), library)
}

/// [`load`] from any reader; `path` is for messages and for finding the MTL files.
///
/// # Errors
/// See [`load`].
pub fn parse(path: &Path, reader: impl BufRead, library: &mut Library) -> Result<ObjFile<'static>> {
    let mut lines = Lines::new(reader);
    let mut parser = Parser::new(path, library);
    while let Some(line) =
        lines.next().map_err(|(number, what)| Error::input_at(path, format!("line {number}"), what))?
    {
        parser.line = line.number;
        parser.statement(&line.text)?;
        parser.ask()?;
    }
    Ok(parser.finish())
}

/// Estimated bytes of a parsed file from which on available memory is checked.
const UNASKED: u64 = 1 << 26;
/// Approximate bytes of a part with its name. The arrays below count twice, since arrays double when they are full.
const BYTES_OF_PART: u64 = 400;
const BYTES_OF_VERTEX: u64 = 2 * (12 + 4);
const BYTES_OF_CORNER: u64 = 2 * (12 + 12 + 8 + 16);
const BYTES_OF_TRIANGLE: u64 = 2 * 12;

struct Parser<'a> {
    path: &'a Path,
    library: &'a mut Library,
    /// Number of the line that is being read.
    line: usize,
    /// Values of `v`, `vt` and `vn` so far.
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    parts: Vec<Part<'static>>,
    part: PartBuilder,
    corners: Vec<Corner>,
    /// Materials by name: the scene file's own, and those of the libraries read so far.
    names: HashMap<String, u32>,
    /// Material names after `usemtl`.
    worn: BTreeSet<String>,
    /// `mtllib` statements, and the true paths of what they name: each is read once.
    statements: HashSet<String>,
    libraries: HashSet<PathBuf>,
    /// Names of libraries that do not exist.
    missing: BTreeSet<String>,
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
            line: 0,
            positions: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            parts: Vec::new(),
            part: PartBuilder::default(),
            corners: Vec::new(),
            worn: BTreeSet::new(),
            statements: HashSet::new(),
            libraries: HashSet::new(),
            missing: BTreeSet::new(),
            short_faces: (0, 0),
            held: 0,
            asked: UNASKED,
        }
    }

    /// Statements that a path tracer does not need, such as lines and points, are skipped.
    fn statement(&mut self, text: &str) -> Result<()> {
        let text = text.trim_start();
        let (key, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
        let outcome = match key {
            "v" => self.vertex(rest),
            "vt" => self.uv(rest),
            "vn" => self.normal(rest),
            "f" => self.face(rest),
            "o" | "g" => {
                self.end_part();
                self.part.rename(rest.trim());
                Ok(())
            }
            "usemtl" => self.wear(rest.trim()),
            "mtllib" => return self.read_libraries(rest.trim()),
            _ => Ok(()),
        };
        outcome.map_err(|what| Error::input_at(self.path, format!("line {}", self.line), what))
    }

    /// A fourth number is a weight that the others are divided by; five numbers or more end in a colour, which is dropped.
    fn vertex(&mut self, rest: &str) -> Checked<()> {
        let what = "a vertex needs three numbers after v";
        let mut position = numbers(rest, what)?;
        let mut more = rest.split_whitespace().skip(3);
        if let (Some(w), None) = (more.next(), more.next()) {
            let [w]: [f32; 1] = numbers(w, what)?;
            if w == 0.0 {
                return Err(mend("the fourth number of a vertex (w) is 0"));
            }
            position = position.map(|v: f32| v / w);
        }
        self.positions.push(position);
        self.held += BYTES_OF_VERTEX;
        Ok(())
    }

    fn uv(&mut self, rest: &str) -> Checked<()> {
        self.uvs.push(numbers(rest, "a texture coordinate needs two numbers after vt")?);
        self.held += 16;
        Ok(())
    }

    fn normal(&mut self, rest: &str) -> Checked<()> {
        self.normals.push(numbers(rest, "a normal needs three numbers after vn")?);
        self.held += 24;
        Ok(())
    }

    /// The corners of a face have the texture coordinates (normals) that all of them have, or none.
    fn face(&mut self, rest: &str) -> Checked<()> {
        self.corners.clear();
        for word in rest.split_ascii_whitespace() {
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        match self.corners.len() {
            0 => return Err("the face names no vertices: delete the line".into()),
            1 | 2 => {
                let (count, first) = self.short_faces;
                self.short_faces = (count + 1, if count == 0 { self.line } else { first });
                return Ok(());
            }
            _ => {}
        }
        let has = [1, 2].map(|extra| self.corners.iter().all(|corner| corner[extra] != NO_EXTRA));
        if self.part.differs(has) {
            self.end_part();
        }
        let made = self.part.face(&self.corners, has, [&self.positions, &self.normals], &self.uvs);
        self.held += BYTES_OF_TRIANGLE * (self.corners.len() as u64 - 2) + BYTES_OF_CORNER * made as u64;
        Ok(())
    }

    /// The indices of `v/vt/vn`, from 0 on. Negative ones count back from the last one defined.
    fn corner(&self, word: &str) -> Checked<Corner> {
        const KINDS: [&str; 3] = ["vertex", "texture coordinate", "normal"];
        let defined = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let mut corner = [NO_EXTRA; 3];
        for (i, part) in word.split('/').enumerate() {
            if part.is_empty() && i > 0 {
                continue;
            }
            let count = *defined.get(i).ok_or_else(|| format!("\"{word}\" has more than two slashes"))? as i64;
            let index: i64 = part.parse().map_err(|_| format!("\"{word}\" is no vertex of a face"))?;
            if index == 0 || index > count || index < -count {
                let what = format!("the face uses {} {index}, but {count} are defined above it", KINDS[i]);
                return Err(format!("{what}: export the file again"));
            }
            let place = if index > 0 { index - 1 } else { count + index };
            corner[i] = u32::try_from(place).map_err(|_| "the file has more than 2^32 vertices: split it")?;
        }
        Ok(corner)
    }

    fn wear(&mut self, name: &str) -> Checked<()> {
        if name.is_empty() {
            return Err(mend("usemtl names no material"));
        }
        if !self.worn.contains(name) {
            self.worn.insert(name.to_owned());
        }
        let material = self.names.get(name).copied().unwrap_or(NONE);
        if self.part.material != material {
            self.end_part();
            self.part.material = material;
        }
        Ok(())
    }

    fn read_libraries(&mut self, statement: &str) -> Result<()> {
        if !self.statements.insert(statement.to_owned()) {
            return Ok(());
        }
        let (found, missing) = library::find(self.path, statement);
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
            |lack| Error::Memory(format!("{}, line {}: {lack}; split the file", self.path.display(), self.line));
        memory::check(self.held).map_err(about)
    }

    /// The last part is kept even without faces: a file has at least one.
    fn finish(mut self) -> ObjFile<'static> {
        self.parts.push(self.part.take());
        if let (short @ 1.., line) = self.short_faces {
            let what = format!("{short} of fewer than three corners dropped, the first in line {line}");
            self.library.warnings.push(format!("{}: faces repaired: {what}", self.path.display()));
        }
        for part in self.parts.iter_mut().filter(|part| part.material == NONE) {
            part.material = self.library.grey();
        }
        ObjFile { grey: self.grey(), parts: self.parts }
    }

    /// The warning about material names that are used but not defined.
    fn grey(&self) -> Option<String> {
        let unknown: Vec<_> = self.worn.iter().filter(|name| !self.names.contains_key(*name)).collect();
        let libraries = match self.missing.is_empty() {
            true => String::new(),
            false => format!(" (no such library: {})", few(&self.missing.iter().collect::<Vec<_>>())),
        };
        let what = || format!("grey is used for materials defined nowhere: {}{libraries}", few(&unknown));
        (!unknown.is_empty()).then(|| format!("{}: {}", self.path.display(), what()))
    }
}

/// The first numbers of a statement.
fn numbers<const N: usize>(rest: &str, what: &str) -> Checked<[f32; N]> {
    let (mut words, mut found) = (rest.split_whitespace(), [0.0; N]);
    for number in &mut found {
        *number = words.next().and_then(|word| word.parse().ok()).ok_or_else(|| mend(what))?;
    }
    Ok(found)
}

fn mend(what: &str) -> String {
    format!("{what}: mend the line or export the file again")
}

/// The first names of a list, and how many more there are.
fn few(names: &[&String]) -> String {
    let shown: Vec<&str> = names.iter().take(8).map(|name| name.as_str()).collect();
    match names.len() {
        0..=8 => shown.join(", "),
        n => format!("{} and {} more", shown.join(", "), n - 8),
    }
}

#[cfg(test)]
mod tests;
