//! Meshes that have a file, OBJ or PLY, for each pose.
use super::Mover;
use super::time::within;
use crate::error::{Error, Result};
use crate::scene::build::store::joined;
use crate::scene::description::{Interpolation, Mesh, MeshTable, numbered};
use crate::scene::load::library::Library;
use crate::scene::load::mesh_file;
use crate::scene::load::obj_part::Numbering;
use crate::scene::pose::{Pose, Vertices};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Files that are kept: the two around a time, and the next.
const KEPT: usize = 3;

/// The files of a mesh.
#[derive(Debug)]
pub struct Frames {
    /// Number of the mesh.
    pub mesh: usize,
    /// Its table, which may name a group.
    pub table: MeshTable,
    /// Path with `#` for the number.
    pub pattern: PathBuf,
    /// Number of the first file.
    pub first: u32,
    /// Of files.
    pub count: u32,
    /// Files per second.
    pub fps: f64,
    /// What lies between two.
    pub interpolation: Interpolation,
    /// Whether the first follows the last.
    pub repeat: bool,
    /// The file of the mesh itself.
    pub base: PathBuf,
    /// What was read.
    pub read: Mutex<Read>,
}

/// What was read of the files.
#[derive(Debug, Default)]
pub struct Read {
    /// The mesh itself.
    base: Option<Arc<Mesh>>,
    /// The poses read last.
    poses: Vec<(u32, Arc<Mesh>)>,
}

impl Frames {
    /// A pose, whose triangles are those of the mesh itself: materials and texture coordinates belong to them, while the shape of a face
    /// in this pose may ask for others.
    ///
    /// # Errors
    /// [`Error::Input`] of its file.
    fn load(&self, index: u32) -> Result<Arc<Mesh>> {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, mesh)) = read.poses.iter().find(|(number, _)| *number == index) {
            return Ok(mesh.clone());
        }
        let base = match &read.base {
            Some(base) => base.clone(),
            None => read.base.insert(Arc::new(self.corners(&self.base)?)).clone(),
        };
        let name = numbered(&self.pattern.to_string_lossy(), self.first + index).unwrap_or_default();
        let path = Path::new(&name);
        let mut mesh = if path == self.base { (*base).clone() } else { self.corners(path)? };
        if mesh.positions.len() != base.positions.len() {
            let [corners, own] = [&mesh, &base].map(|mesh| mesh.positions.len());
            return Err(Error::input(
                name,
                format!(
                    "has {corners} corners of faces where {} has {own}: every file has to have the same faces",
                    self.base.display()
                ),
            ));
        }
        mesh.indices.clone_from(&base.indices);
        let mesh = Arc::new(mesh);
        read.poses.truncate(KEPT - 1);
        read.poses.insert(0, (index, mesh.clone()));
        Ok(mesh)
    }

    /// What a file has of this mesh, with a vertex for each corner of its faces.
    fn corners(&self, path: &Path) -> Result<Mesh> {
        Ok(joined(&self.table, &mesh_file::load(path, Numbering::Corners, &mut Library::default())?))
    }

    /// The file before a time, the one after it, and how far it is to that.
    fn around(&self, seconds: f64) -> (u32, u32, f32) {
        let last = f64::from(self.count - 1);
        let seconds = if self.repeat { within(seconds, f64::from(self.count) / self.fps) } else { seconds };
        let at = (seconds * self.fps).clamp(0.0, f64::from(self.count));
        let nearest = at.round();
        let at = if (at - nearest).abs() < 1e-6 * at.max(1.0) { nearest } else { at };
        let at = if self.repeat { at } else { at.min(last) };
        let before = at.floor().min(last) as u32;
        let after = if before + 1 < self.count {
            before + 1
        } else if self.repeat {
            0
        } else {
            before
        };
        (before, after, (at - f64::from(before)) as f32)
    }
}

impl Mover for Frames {
    fn pose(&self, seconds: f64, pose: &mut Pose) -> Result<()> {
        let (before, after, share) = self.around(seconds);
        let a = self.load(before)?;
        let still = share == 0.0 || self.interpolation == Interpolation::Step;
        let b = if still { a.clone() } else { self.load(after)? };
        let mix = |a: &[[f32; 3]], b: &[[f32; 3]]| -> Vec<[f32; 3]> {
            let between = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share);
            a.iter().zip(b).map(between).collect()
        };
        let positions = mix(&a.positions, &b.positions);
        let normals = if b.normals.len() == b.positions.len() { mix(&a.normals, &b.normals) } else { Vec::new() };
        // A mesh without normals has none in between either.
        let normals = if normals.len() == positions.len() { normals } else { Vec::new() };
        pose.meshes
            .push((self.mesh, Vertices { positions, normals, tangents: Vec::new(), indices: a.indices.clone() }));
        Ok(())
    }

    fn end(&self) -> f64 {
        f64::from(self.count - 1) / self.fps
    }

    fn moving(&self) -> Option<Range<f64>> {
        let span = if self.repeat { f64::NEG_INFINITY..f64::INFINITY } else { 0.0..self.end() };
        (self.count > 1).then_some(span)
    }
}
