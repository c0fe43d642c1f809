//! Meshes that have a file, OBJ or PLY, for each pose.
use super::Mover;
use super::time::within;
use crate::error::{Error, Result};
use crate::scene::build::store::joined;
use crate::scene::description::{Interpolation, Mesh, MeshTable, numbered};
use crate::scene::load::library::Library;
use crate::scene::load::mesh_file;
use crate::scene::pose::{Pose, Vertices};
use std::path::PathBuf;
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
    /// Those read last.
    pub read: Mutex<Vec<(u32, Arc<Mesh>)>>,
}

impl Frames {
    /// # Errors
    /// [`Error::Input`] of its file.
    fn load(&self, index: u32) -> Result<Arc<Mesh>> {
        let mut read = self.read.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, mesh)) = read.iter().find(|(number, _)| *number == index) {
            return Ok(mesh.clone());
        }
        let name = numbered(&self.pattern.to_string_lossy(), self.first + index).unwrap_or_default();
        let file = mesh_file::load(name.as_ref(), &mut Library::default())?;
        let mesh = Arc::new(joined(&self.table, &file));
        if mesh.positions.is_empty() {
            return Err(Error::input(name, "has no triangles of this mesh: every file has to have all"));
        }
        read.truncate(KEPT - 1);
        read.insert(0, (index, mesh.clone()));
        Ok(mesh)
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
        // Only what has the same triangles has anything between.
        let alike = a.indices == b.indices && a.positions.len() == b.positions.len();
        let b = if alike { b } else { a.clone() };
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
}
