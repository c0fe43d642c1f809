//! OBJ files through tobj, behind a reader that repairs what tobj does not and knows the line of every mistake.
use super::material::Materials;
use super::mtl::{self, Mtl};
use super::obj_lines::ObjLines;
use super::polygon;
use crate::error::{Error, Result};
use crate::image::input;
use crate::memory;
use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A parsed OBJ file.
#[derive(Debug, Default)]
pub struct ObjFile {
    /// Single-indexed triangle meshes; within one, either every corner has a normal (coordinate) or none has.
    pub models: Vec<tobj::Model>,
    /// Scene material of each model.
    pub materials: Vec<u32>,
    /// What is said when a mesh wears the file's own materials, and grey stands in for some.
    pub grey: Option<String>,
}

/// Names and indices of materials.
type Named = Arc<[(String, u32)]>;

/// Bytes that a material takes while it is read.
const BYTES_OF_MATERIAL: u64 = 2048;

/// What all OBJ files of a scene share.
#[derive(Debug, Default)]
pub struct Library {
    /// The scene's materials so far.
    pub materials: Materials,
    /// `[[material]]` tables by name: they win over MTL materials.
    pub tables: HashMap<String, u32>,
    /// MTL files already read, by their one true path.
    mtls: HashMap<PathBuf, Named>,
    /// The grey of triangles without a material.
    grey: Option<u32>,
    /// What was repaired.
    pub warnings: Vec<String>,
}

impl Library {
    /// Index of the grey that stands in for missing materials.
    pub fn grey(&mut self) -> u32 {
        let materials = &mut self.materials;
        *self.grey.get_or_insert_with(|| materials.push("(default)", Materials::plain([0.6; 3])))
    }

    /// The materials of an MTL file, read once however its path is written.
    fn mtl(&mut self, path: &Path) -> Result<Named> {
        let known = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if let Some(named) = self.mtls.get(&known) {
            return Ok(named.clone());
        }
        let bytes = input::read_text(path, 4)?;
        let text = String::from_utf8_lossy(&bytes);
        memory::need(path.display(), BYTES_OF_MATERIAL * text.matches("newmtl").count() as u64)?;
        let blocks = mtl::parse(path, &text)?;
        let named: Named = blocks.iter().map(|b| Ok((b.name.clone(), self.block(path, b)?))).collect::<Result<_>>()?;
        self.mtls.insert(known, named.clone());
        Ok(named)
    }

    fn block(&mut self, path: &Path, block: &Mtl) -> Result<u32> {
        if let Some(&index) = self.tables.get(&block.name) {
            return Ok(index);
        }
        let place = || format!("material \"{}\"", block.name);
        self.materials.push_mtl(block, &mut self.warnings).map_err(|what| Error::input_at(path, place(), what))
    }
}

/// The files of an `mtllib` statement, one whose name may hold spaces or several, and the names of which there is none.
fn libraries(obj: &Path, statement: &str) -> (Vec<PathBuf>, Vec<String>) {
    let directory = obj.parent().unwrap_or(Path::new(""));
    let written = statement.trim().replace('\\', "/");
    let whole = mtl::find_file(directory, &written).map(|(path, _)| path);
    if let Some(path) = whole {
        return (vec![path], Vec::new());
    }
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for file in split_files(&written) {
        match mtl::find_file(directory, &file) {
            Some((path, _)) => found.push(path),
            None => missing.push(file),
        }
    }
    (found, missing)
}

/// Words joined until one ends in `.mtl`.
fn split_files(statement: &str) -> Vec<String> {
    let mut files = vec![String::new()];
    for word in statement.split_whitespace() {
        let last = files.last_mut().expect("never empty");
        if !last.is_empty() {
            last.push(' ');
        }
        last.push_str(word);
        if word.to_lowercase().ends_with(".mtl") {
            files.push(String::new());
        }
    }
    files.retain(|f| !f.is_empty());
    files
}

/// Reads the MTL files named within an OBJ file's first 64 KiB. A file that cannot be opened is left to [`load`].
///
/// # Errors
/// [`Error::Input`] for a malformed MTL file.
pub fn read_libraries(path: &Path, library: &mut Library) -> Result<()> {
    let Ok(file) = input::open(path) else { return Ok(()) };
    let mut head = Vec::new();
    let _ = file.take(1 << 16).read_to_end(&mut head); // what could be read is enough
    let head = String::from_utf8_lossy(&head);
    let statements: BTreeSet<_> = head.lines().filter_map(|l| l.trim_start().strip_prefix("mtllib ")).collect();
    // One that is missing is reported when the whole file is read.
    let found = statements.iter().flat_map(|statement| libraries(path, statement).0);
    found.into_iter().try_for_each(|path| library.mtl(&path).map(|_| ()))
}

/// Reads an OBJ file and the MTL files it names.
///
/// # Errors
/// [`Error::Input`] with file, line, what is wrong and what to do.
pub fn load(path: &Path, library: &mut Library) -> Result<ObjFile> {
    parse(path, BufReader::with_capacity(1 << 18, input::open(path)?), library)
}

/// [`load`] from any reader; `path` is for messages and for finding the MTL files.
///
/// # Errors
/// See [`load`].
pub fn parse(path: &Path, reader: impl std::io::BufRead, library: &mut Library) -> Result<ObjFile> {
    let mut lines = ObjLines::new(reader);
    let served = RefCell::new(Served::default());
    let shared = RefCell::new(&mut *library);
    let loader = |statement: &Path| {
        let named = served.borrow_mut().statement(path, &statement.to_string_lossy(), &mut shared.borrow_mut());
        let blocks = named.iter().map(|n| tobj::Material { name: n.0.clone(), ..Default::default() }).collect();
        Ok((blocks, named.into_iter().enumerate().map(|(i, n)| (n.0, i)).collect()))
    };
    let options = tobj::LoadOptions { single_index: true, triangulate: false, ignore_points: true, ignore_lines: true };
    let outcome = tobj::load_obj_buf(&mut lines, &options, loader);
    let served = served.into_inner();
    if let Some(error) = served.failure {
        return Err(error);
    }
    if let Some(lack) = lines.lack {
        return Err(Error::Memory(format!("{}, line {}: {lack}; split the file", path.display(), lines.line)));
    }
    let mut models = match (lines.error.take(), outcome) {
        (Some((line, what)), _) => return Err(Error::input_at(path, format!("line {line}"), what)),
        (None, Err(e)) => return Err(Error::input_at(path, format!("line {}", lines.line), remedy(e))),
        (None, Ok((models, _))) => models,
    };
    for mesh in models.iter_mut().map(|m| &mut m.mesh).filter(|mesh| !mesh.face_arities.is_empty()) {
        mesh.indices = polygon::triangulate(&mesh.positions, &mesh.face_arities, &mesh.indices);
        mesh.face_arities.clear();
    }
    let index = |m: &tobj::Model| m.mesh.material_id.and_then(|i| served.found.get(i).copied());
    if let (short @ 1.., line) = lines.short_faces {
        let what = format!("{short} of fewer than three corners dropped, the first in line {line}");
        library.warnings.push(format!("{}: faces repaired: {what}", path.display()));
    }
    let materials = models.iter().map(|m| index(m).unwrap_or_else(|| library.grey())).collect();
    Ok(ObjFile { models, materials, grey: served.grey(path, &lines.worn) })
}

/// What `mtllib` statements came to so far.
#[derive(Default)]
struct Served {
    /// Statements, and the true paths of what they name: each is served once.
    done: HashSet<PathBuf>,
    /// Libraries that are nowhere.
    missing: BTreeSet<String>,
    /// Scene materials in the order in which tobj numbers them.
    found: Vec<u32>,
    known: HashSet<String>,
    failure: Option<Error>,
}

impl Served {
    /// The materials that a statement adds.
    fn statement(&mut self, obj: &Path, statement: &str, library: &mut Library) -> Vec<(String, u32)> {
        let named: Vec<_> = match statement {
            ObjLines::<&[u8]>::TABLES => library.tables.iter().map(|(n, &i)| (n.clone(), i)).collect(),
            _ if !self.done.insert(statement.into()) => Vec::new(),
            _ => self.files(obj, statement, library).unwrap_or_else(|e| {
                self.failure.get_or_insert(e);
                Vec::new()
            }),
        };
        self.found.extend(named.iter().map(|n| n.1));
        self.known.extend(named.iter().map(|n| n.0.clone()));
        named
    }

    fn files(&mut self, obj: &Path, statement: &str, library: &mut Library) -> Result<Vec<(String, u32)>> {
        let (found, missing) = libraries(obj, statement);
        self.missing.extend(missing);
        let mut named = Vec::new();
        for path in found {
            if self.done.insert(path.canonicalize().unwrap_or_else(|_| path.clone())) {
                named.extend_from_slice(&library.mtl(&path)?);
            }
        }
        Ok(named)
    }

    /// What is said of the names in `worn` that are defined nowhere.
    fn grey(&self, obj: &Path, worn: &BTreeSet<String>) -> Option<String> {
        let unknown: Vec<&str> = worn.iter().filter(|name| !self.known.contains(*name)).map(String::as_str).collect();
        let missing: Vec<&str> = self.missing.iter().map(String::as_str).collect();
        let libraries = match missing.is_empty() {
            true => String::new(),
            false => format!(" (no such library: {})", few(&missing)),
        };
        let what = || format!("grey is used for materials defined nowhere: {}{libraries}", few(&unknown));
        (!unknown.is_empty()).then(|| format!("{}: {}", obj.display(), what()))
    }
}

/// The first names of a list, and how many more there are.
fn few(names: &[&str]) -> String {
    match names.len() {
        0..=8 => names.join(", "),
        n => format!("{} and {} more", names[..8].join(", "), n - 8),
    }
}

fn remedy(error: tobj::LoadError) -> String {
    use tobj::LoadError as E;
    let what = match error {
        E::PositionParseError => "a vertex needs three numbers after v",
        E::ScalingByZeroError => "the fourth number of a vertex (w) is 0",
        E::NormalParseError => "a normal needs three numbers after vn",
        E::TexcoordParseError => "a texture coordinate needs two numbers after vt",
        E::MaterialParseError => "usemtl names no material",
        E::ReadError => "the file could not be read to its end",
        _ => return format!("{error}: export the file again"),
    };
    format!("{what}: mend the line or export the file again")
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n";

    fn read(text: &str) -> Result<ObjFile> {
        parse(Path::new("a.obj"), format!("{SQUARE}{text}").as_bytes(), &mut Library::default())
    }

    fn error(text: &str) -> String {
        read(text).unwrap_err().to_string()
    }

    #[test]
    fn polygons_become_fans_and_negative_indices_count_back() {
        let quad = read("f -4 -3 -2 -1").unwrap();
        assert_eq!(quad.models[0].mesh.indices, [0, 1, 2, 0, 2, 3]);
        assert_eq!(quad.models[0].mesh.positions[..6], [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        let penta = read("v 0.5 2 0\nf 1 2 3 5 4").unwrap();
        assert_eq!(penta.models[0].mesh.indices.len(), 9);
        let marked = parse(Path::new("a.obj"), format!("\u{feff}{SQUARE}f 1 2 4").as_bytes(), &mut Library::default());
        assert_eq!(marked.unwrap().models[0].mesh.indices.len(), 3, "a byte order mark is no part of the first line");
        assert!(read("l 1 2\np 1").unwrap().models.iter().all(|m| m.mesh.indices.is_empty()));
    }

    #[test]
    fn faces_without_area_for_want_of_corners_are_counted() {
        let warnings = |text: &str| {
            let mut library = Library::default();
            let file = parse(Path::new("a.obj"), format!("{SQUARE}{text}").as_bytes(), &mut library).unwrap();
            assert_eq!(file.models.iter().map(|m| m.mesh.indices.len()).sum::<usize>(), 3, "the whole face is kept");
            library.warnings
        };
        let said = "a.obj: faces repaired: 2 of fewer than three corners dropped, the first in line 11";
        assert_eq!(warnings("f 1 2 3\nf 1 2\n\nf -1"), [said]);
        assert_eq!(warnings("l 1 2\nf 1 2 3\np 1"), Vec::<String>::new(), "lines and points are no faces");
    }

    #[test]
    fn corners_with_and_without_normals_stay_apart() {
        let file = read("o box\nf 1//1 2//1 3//1\nf 1 3 4\nf 1/1/1 2/2/1 3/3/1\nf 1/1 2 3").unwrap();
        let shape: Vec<_> =
            file.models.iter().map(|m| (m.name.as_str(), m.mesh.normals.len(), m.mesh.texcoords.len())).collect();
        assert_eq!(shape, [("box", 9, 0), ("box", 0, 0), ("box", 9, 6), ("box", 0, 0)]);
    }

    #[test]
    fn lines_may_continue_and_carry_colours_or_foreign_letters() {
        let bytes = [SQUARE.as_bytes(), b"# caf\xe9\nv 9 9 9 1 0 0\nf 1 2 \\\n 3\n"].concat();
        let file = parse(Path::new("a.obj"), &bytes[..], &mut Library::default()).unwrap();
        assert_eq!(file.models[0].mesh.indices.len(), 3);
    }

    #[test]
    fn mistakes_name_their_line() {
        assert_eq!(
            error("f 1 2 5"),
            "a.obj, line 10: the face uses vertex 5, but 4 are defined above it: export the file again"
        );
        assert!(error("f 1/9 2/9 3/9").contains("line 10: the face uses texture coordinate 9, but 4"));
        assert!(error("f 1//2 2//2 3//2").contains("normal 2, but 1"));
        assert!(error("\n\nf 1 2 -5").contains("line 12: the face uses vertex -5"));
        assert!(error("f 1 0 2").contains("vertex 0"));
        assert!(error("f 1 2 6148914691236517205").contains("vertex 6148914691236517205"));
        assert!(error("f 1 2 x").contains("line 10"));
        assert!(error("f").contains("line 10"));
        assert!(error("v 1 2").contains("line 10: a vertex needs three numbers"));
        assert!(read("f 1 2 3").is_ok(), "control");
    }

    #[test]
    fn tables_stand_in_for_materials_and_unknown_ones_are_grey() {
        let mut library = Library::default();
        let red = library.materials.push("red", Materials::plain([1.0, 0.0, 0.0]));
        library.tables.insert("red".into(), red);
        let text = format!("mtllib none.mtl\n{SQUARE}usemtl red\nf 1 2 3\nusemtl what\nf 1 2 3");
        let file = parse(Path::new("a.obj"), text.as_bytes(), &mut library).unwrap();
        assert_eq!(file.materials, [red, library.grey()]);
        let said = file.grey.unwrap();
        assert!(said.ends_with("defined nowhere: what (no such library: none.mtl)"), "{said}");
    }

    #[test]
    fn several_libraries_and_names_with_spaces() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("one a.mtl"), "newmtl a\nKd 1 0 0").unwrap();
        std::fs::write(dir.path().join("two.mtl"), "newmtl b c\nKd 0 1 0").unwrap();
        let text = format!("mtllib one a.mtl two.mtl\n{SQUARE}usemtl b c\nf 1 2 3\nusemtl a\nf 1 2 3");
        let mut library = Library::default();
        let file = parse(&dir.path().join("x.obj"), text.as_bytes(), &mut library).unwrap();
        let colors: Vec<_> = file.materials.iter().map(|&i| library.materials.list[i as usize].base_color).collect();
        assert_eq!((colors, library.warnings.len()), (vec![[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]], 0));
    }
}
