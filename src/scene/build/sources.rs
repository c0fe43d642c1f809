//! Reads what a description names: materials and files of meshes, with the warnings about them.
use crate::error::{Error, Result};
use crate::scene::description::mesh::Mesh;
use crate::scene::description::{self, Description, MeshTable, Shape};
use crate::scene::load::library::Library;
use crate::scene::load::mesh_file::{self, Format};
use crate::scene::load::obj::ObjFile;
use crate::scene::load::obj_part::Numbering;
use std::collections::{BTreeSet, HashMap};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// The sources of one scene.
pub struct Sources<'a> {
    /// Path of the scene file, for messages and for the files that it names.
    pub path: &'a Path,
    /// The description that the scene is built from.
    pub description: &'a Description,
    /// Materials and warnings so far.
    pub library: Library,
    /// Parsed files that meshes still need.
    pub files: HashMap<PathBuf, ObjFile<'a>>,
}

/// `mesh "name"`, by its own name, its file's or its shape's.
pub fn mesh_name(mesh: &MeshTable) -> String {
    match (&mesh.name, &mesh.file, mesh.shape) {
        (Some(name), ..) => name.clone(),
        (_, Some(file), _) => file.display().to_string(),
        (_, _, Some(shape)) => format!("{shape:?}").to_lowercase(),
        _ => "unnamed".into(),
    }
}

/// Whether the materials of a mesh's file matter: where one of the scene replaces them they do not, but the vertices of a mesh that
/// moves are numbered from material to material.
fn wears_own(mesh: &MeshTable) -> bool {
    mesh.material.is_none() || mesh.moving
}

impl<'a> Sources<'a> {
    /// Takes the pictures and materials of a description, and reads the MTL files that OBJ files name near their beginning;
    /// others are read when an OBJ file reaches them.
    ///
    /// # Errors
    /// For what is wrong with them, with its place.
    pub fn new(path: &'a Path, description: &'a Description) -> Result<Self> {
        let mut sources = Self { path, description, library: Library::default(), files: HashMap::new() };
        sources.add_pictures()?;
        sources.add_materials()?;
        let obj_files = |worn: bool| -> BTreeSet<PathBuf> {
            let meshes = description.mesh.iter().filter(|m| wears_own(m) == worn);
            meshes.filter_map(|m| sources.file_of(m)).filter(|path| Format::of(path) == Format::Obj).collect()
        };
        let (worn, covered) = (obj_files(true), obj_files(false));
        worn.iter().try_for_each(|path| sources.library.read_ahead(path))?;
        sources.library.unworn = covered.difference(&worn).cloned().collect();
        Ok(sources)
    }

    /// Folder that paths are relative to.
    pub fn directory(&self) -> &'a Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// The files that were read, or are, sorted.
    pub fn files(&self) -> BTreeSet<PathBuf> {
        let sky = self.description.environment.as_ref().and_then(|table| table.file.as_ref());
        let sky = sky.map(|file| self.beside(file));
        self.files.keys().chain(self.library.files()).cloned().chain(sky).collect()
    }

    /// What the scene file names by `file`.
    pub fn beside(&self, file: &Path) -> PathBuf {
        self.directory().join(file.to_string_lossy().replace('\\', "/"))
    }

    /// An error at a place in the scene file.
    pub fn at(&self, place: impl Display, what: impl Display) -> Error {
        Error::input_at(self.path, place, what)
    }

    fn add_pictures(&mut self) -> Result<()> {
        let Description { bitmap, picture_file, .. } = self.description;
        for bitmap in bitmap {
            let taken = self.library.materials.textures.add_bitmap(bitmap);
            taken.map_err(|what| self.at(format!("bitmap \"{}\"", bitmap.name.display()), what))?;
        }
        for file in picture_file {
            let taken = self.library.materials.textures.add_file(file);
            taken.map_err(|what| self.at(format!("picture \"{}\"", file.name.display()), what))?;
        }
        Ok(())
    }

    fn add_materials(&mut self) -> Result<()> {
        for table in &self.description.material {
            let place = format!("material \"{}\"", table.name);
            let directory = self.directory();
            let Library { materials, warnings, .. } = &mut self.library;
            let index = materials.push_table(table, directory, warnings).map_err(|what| self.at(&place, what))?;
            if table.name.is_empty() {
                return Err(self.at("[[material]]", "has no name: meshes could not refer to it"));
            }
            let named = if table.of_model { &mut self.library.of_models } else { &mut self.library.tables };
            if named.insert(table.name.clone(), index).is_some() {
                return Err(self.at(place, "is defined twice: rename one"));
            }
        }
        Ok(())
    }

    /// Parses every file of meshes. All are needed before the first is placed: whether texture coordinates are kept depends on all
    /// materials.
    ///
    /// # Errors
    /// For a mesh without a source or with two, and for what is wrong with a source.
    pub fn read_files(&mut self) -> Result<()> {
        for mesh in &self.description.mesh {
            self.check(mesh)?;
            if mesh.segments.is_some() && !matches!(mesh.shape, Some(Shape::Sphere | Shape::Disk)) {
                let what = format!("mesh \"{}\": only spheres and disks read segments", mesh_name(mesh));
                self.library.warnings.push(what);
            }
            let Some(path) = self.file_of(mesh) else { continue };
            if !self.files.contains_key(&path) {
                let parsed = mesh_file::load(&path, Numbering::Shared, &mut self.library)?;
                self.files.insert(path, parsed);
            }
        }
        let given = self.description.mesh.iter().filter_map(|mesh| mesh.data.as_ref());
        let read = self.files.values().flat_map(|file| &file.parts).map(|part| &*part.mesh);
        if given.chain(read).any(|mesh| mesh.colors.iter().any(|color| color[3] < 1.0)) {
            self.library.materials.mask_by_vertices();
        }
        Ok(())
    }

    fn check(&self, mesh: &MeshTable) -> Result<()> {
        let place = || format!("mesh \"{}\"", mesh_name(mesh));
        let sources = [mesh.file.is_some(), mesh.shape.is_some(), mesh.data.is_some()];
        match sources.into_iter().filter(|there| *there).count() {
            0 => return Err(self.at(place(), "needs a file or a shape (or, in memory, data)")),
            1 => {}
            _ => return Err(self.at(place(), "has more than one of a file, a shape and data in memory: choose one")),
        }
        if mesh.file.as_ref().is_some_and(|file| file.as_os_str().is_empty()) {
            return Err(self.at(place(), "its file has an empty name"));
        }
        if mesh.clip.is_some() {
            return Err(self.at(place(), "has a clip, which is for glTF files"));
        }
        mesh.data.as_ref().map_or(Ok(()), Mesh::check).map_err(|what| self.at(place(), what))?;
        match mesh.segments.filter(|n| !(3..=4096).contains(n)) {
            Some(n) => Err(self.at(place(), format!("segments is {n}: choose a value from 3 to 4096"))),
            None => Ok(()),
        }
    }

    /// Path of a mesh's file.
    pub fn file_of(&self, table: &MeshTable) -> Option<PathBuf> {
        Some(self.beside(table.file.as_ref()?))
    }

    /// Whether a mesh shows colours of its OBJ file's vertices.
    pub fn colors_show(&self, table: &MeshTable) -> bool {
        let file = self.file_of(table).filter(|path| table.material.is_none() && Format::of(path) == Format::Obj);
        let parts = file.and_then(|path| self.files.get(&path)).map_or(&[][..], |file| &file.parts);
        let is_shown = |name: &str| table.group.as_ref().is_none_or(|group| group == name);
        parts.iter().any(|part| is_shown(&part.name) && !part.mesh.colors.is_empty())
    }

    /// Index of a `[[material]]`.
    ///
    /// # Errors
    /// With the nearest name, when there is none of that name.
    pub fn material(&self, name: &str, place: &str) -> Result<u32> {
        let [tables, of_models] = [&self.library.tables, &self.library.of_models];
        if let Some(&index) = tables.get(name).or_else(|| of_models.get(name)) {
            return Ok(index);
        }
        let remedy = match description::nearest(name, tables.keys().chain(of_models.keys()).map(String::as_str)) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => "add a [[material]] table".to_owned(),
        };
        Err(self.at(place, format!("no material \"{name}\": {remedy}")))
    }
}
