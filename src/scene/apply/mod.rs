//! Brings a scene into another pose: first everything that can fail, then the arrays.
mod commit;
mod material;
mod next;

pub use next::check_numbers;

use super::{Change, Pose, Scene};
use crate::error::{Error, Result};
use crate::threads;

impl Scene {
    /// Changes what the pose names. Rigid motion builds the top level of the hierarchy anew and nothing else. A deformed mesh keeps
    /// the shape of its hierarchy, whose boxes are fitted to it, until that costs too much: see [`Pose::rebuild_above`].
    ///
    /// What is named and is as it was counts as unchanged, a camera aside: a scene at rest changes nothing.
    ///
    /// The scene is that of the same description loaded in this pose, up to the order of triangles in a hierarchy that was not
    /// built anew. Other edits of the arrays that a pose changes are lost. [`Renderer::update`](crate::render::Renderer::update)
    /// brings it to the device.
    ///
    /// # Errors
    /// [`Error::Usage`] with the first thing that cannot be, such as a vertex that is no number; the scene is as before then.
    /// [`Error::Memory`].
    pub fn apply(&mut self, pose: &Pose) -> Result<Change> {
        threads::within_kept(|| {
            let next = next::Next::of(self, pose).map_err(|what| Error::Usage(format!("pose: {what}")))?;
            commit::commit(self, next, pose)
        })
    }
}
