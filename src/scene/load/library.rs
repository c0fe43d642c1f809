//! The materials that the OBJ files of a scene share, and the MTL files that define them.
use super::find::find_file;
use super::material::Materials;
use super::mtl::{self, Mtl};
use super::obj_part::{NO_VERTEX_COLOR, Part};
use crate::error::{Error, Result};
use crate::image::input;
use crate::layout::NONE;
use crate::memory;
use std::collections::{BTreeSet, HashMap};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Indices of materials by their names.
type Named = Arc<[(String, u32)]>;

/// Bytes that a material takes while it is read.
const BYTES_OF_MATERIAL: u64 = 2048;

/// The materials that all OBJ files of a scene share.
#[derive(Debug, Default)]
pub struct Library {
    /// The scene's materials so far.
    pub materials: Materials,
    /// `[[material]]` tables by name: they win over MTL materials.
    pub tables: HashMap<String, u32>,
    /// Materials of glTF files by name, which MTL materials of that name have nothing to do with.
    pub of_models: HashMap<String, u32>,
    /// OBJ files whose own materials nothing wears: the MTL files that they name, and their pictures, are not read.
    pub unworn: BTreeSet<PathBuf>,
    /// MTL files that were read, by their canonical path.
    mtls: HashMap<PathBuf, Named>,
    /// The grey of triangles without a material, and the white of those whose vertices have colours.
    grey: Option<u32>,
    white: Option<u32>,
    /// Messages about what was repaired.
    pub warnings: Vec<String>,
}

impl Library {
    /// Index of the grey that stands in for missing materials.
    pub fn grey(&mut self) -> u32 {
        let materials = &mut self.materials;
        *self.grey.get_or_insert_with(|| materials.push("(default)", Materials::plain([0.6; 3])))
    }

    /// Index of the white that the colours of vertices are seen in.
    pub fn white(&mut self) -> u32 {
        let materials = &mut self.materials;
        *self.white.get_or_insert_with(|| materials.push("(vertex colours)", Materials::plain([1.0; 3])))
    }

    /// Gives a part of an OBJ file that wears nothing a material: white, if its vertices have colours, else grey. Colours count there
    /// alone, since exporters write them beside a material that shows the same. `has_others` says that the file has numbers in their place that are
    /// no colours.
    pub fn color(&mut self, part: &mut Part, has_others: bool) {
        let has_colors = !has_others && part.mesh.colors.iter().any(|color| *color != NO_VERTEX_COLOR);
        let counts = part.material == NONE && has_colors;
        if !part.mesh.colors.is_empty() {
            let colors = &mut part.mesh.to_mut().colors;
            colors.iter_mut().filter(|color| **color == NO_VERTEX_COLOR).for_each(|color| *color = [1.0; 4]);
            if !counts {
                *colors = Vec::new();
            }
        }
        if part.material == NONE {
            part.material = if counts { self.white() } else { self.grey() };
        }
    }

    /// The MTL files that were read, and the pictures that all materials name.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.mtls.keys().chain(self.materials.textures.files())
    }

    /// The materials of an MTL file, read once however its path is written.
    ///
    /// # Errors
    /// [`Error::Input`] for a malformed file, [`Error::Memory`].
    pub fn mtl(&mut self, path: &Path) -> Result<Named> {
        let known = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if let Some(named) = self.mtls.get(&known) {
            return Ok(named.clone());
        }
        let bytes = input::read_text(path, 4)?;
        let text = String::from_utf8_lossy(&bytes);
        memory::need(path.display(), BYTES_OF_MATERIAL * text.matches("newmtl").count() as u64)?;
        let blocks = mtl::parse(path, &text)?;
        let unread = mtl::unread(&text);
        if !unread.is_empty() {
            self.warnings.push(format!("{}: not read: {}", path.display(), unread.join(", ")));
        }
        let named: Named =
            blocks.iter().map(|b| Ok((b.name().to_owned(), self.block(path, b)?))).collect::<Result<_>>()?;
        self.mtls.insert(known, named.clone());
        Ok(named)
    }

    fn block(&mut self, path: &Path, block: &Mtl) -> Result<u32> {
        if let Some(&index) = self.tables.get(block.name()) {
            return Ok(index);
        }
        let place = || format!("material \"{}\"", block.name());
        self.materials.push_mtl(block, &mut self.warnings).map_err(|what| Error::input_at(path, place(), what))
    }

    /// Reads the MTL files that an OBJ file names within its first 64 KiB. A file that cannot be opened is passed over, and so
    /// are libraries that are missing: reading the whole file reports them.
    ///
    /// # Errors
    /// As [`Self::mtl`].
    pub fn read_ahead(&mut self, obj: &Path) -> Result<()> {
        let Ok(file) = input::open(obj) else { return Ok(()) };
        let mut head = Vec::new();
        let _ = file.take(1 << 16).read_to_end(&mut head); // what could be read is enough
        let head = String::from_utf8_lossy(&head);
        let statements: BTreeSet<_> = head.lines().filter_map(|l| l.trim_start().strip_prefix("mtllib ")).collect();
        let found = statements.iter().flat_map(|statement| find(obj, statement).0);
        found.into_iter().try_for_each(|path| self.mtl(&path).map(|_| ()))
    }
}

/// The files of an `mtllib` statement, one whose name may hold spaces or several, and the names of which there is none.
pub fn find(obj: &Path, statement: &str) -> (Vec<PathBuf>, Vec<String>) {
    let directory = obj.parent().unwrap_or(Path::new(""));
    let written = statement.trim().replace('\\', "/");
    let whole = find_file(directory, written.trim_matches('"')).map(|(path, _)| path);
    if let Some(path) = whole {
        return (vec![path], Vec::new());
    }
    let (mut found, mut missing) = (Vec::new(), Vec::new());
    for file in split_files(&written.replace('"', "")) {
        match find_file(directory, &file) {
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
