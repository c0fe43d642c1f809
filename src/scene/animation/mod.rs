//! What moves a scene with time: an [`Animation`] gives the [`Pose`] at a time.
mod curve;
mod frames;
mod keyed;
mod load;
pub(super) mod time;
mod turntable;

use super::pose::Pose;
use crate::error::Result;
pub(super) use keyed::Keyed;
pub(super) use load::{load, of_node, with_freed_meshes};
use std::fmt::Debug;
use std::ops::Range;
use std::sync::Arc;
pub use turntable::Turntable;

/// Moves a part of a scene. What it says of a time may not depend on what it was asked before, so that a frame alone is the frame of
/// a sequence.
///
/// The `[[animation]]` tables of a scene file are movers, see `keyed.rs` and `frames.rs`. The loader of another format gives its own
/// to the `SceneFile` that it opens (`SceneFile::movers`): nodes that move each other are one mover, which works out where every
/// instance is and, for skins and morph targets, all vertices. It names them by their numbers in the description, as a pose does:
/// instances by that of their `[[instance]]` table, meshes by that of their `[[mesh]]`, which has to be `moving` to be deformed.
pub trait Mover: Debug + Send + Sync {
    /// Adds to `pose` what it moves and where that is at a time in seconds from the start, which may be before the first key and
    /// after the last.
    ///
    /// # Errors
    /// Those of files that it reads.
    fn pose(&self, seconds: f64, pose: &mut Pose) -> Result<()>;

    /// Seconds from the start to the last key, 0 or more.
    fn end(&self) -> f64;

    /// Seconds between which it moves: before them and after them all is as it is at their ends. None where it never moves, as by one
    /// key alone, whenever that is.
    fn moving(&self) -> Option<Range<f64>> {
        (self.end() > 0.0).then_some(0.0..f64::INFINITY)
    }
}

/// All that moves a scene.
#[derive(Clone, Debug, Default)]
pub struct Animation {
    /// Later ones win where two move the camera or the environment.
    pub movers: Vec<Arc<dyn Mover>>,
}

impl Animation {
    /// Where everything is that moves, at a time in seconds. It depends on nothing else: every pose says of all that ever moves
    /// where it is.
    ///
    /// # Errors
    /// See [`Mover::pose`].
    pub fn at(&self, seconds: f64) -> Result<Pose> {
        let mut pose = Pose::default();
        self.movers.iter().try_for_each(|mover| mover.pose(seconds, &mut pose))?;
        Ok(pose)
    }

    /// Seconds until the last key of all.
    pub fn end(&self) -> f64 {
        self.movers.iter().map(|mover| mover.end()).fold(0.0, f64::max)
    }

    /// Seconds from the begin of all motion to its end; none where nothing moves at any time. See [`Mover::moving`].
    pub fn moving(&self) -> Option<Range<f64>> {
        time::hull(self.movers.iter().filter_map(|mover| mover.moving()))
    }

    /// Whether anything moves between two times in seconds, the first of which is the earlier.
    pub fn moves_between(&self, [first, last]: [f64; 2]) -> bool {
        let meets = |span: Range<f64>| !time::reaches(span.start, last) && !time::reaches(first, span.end);
        self.movers.iter().filter_map(|mover| mover.moving()).any(meets)
    }

    /// Number of the last frame that is not after the last key of all.
    pub fn last_frame(&self, fps: f64) -> f64 {
        let nearest = (self.end() * fps).round();
        if time::reaches(self.end(), nearest / fps) { nearest } else { (self.end() * fps).floor() }
    }

    /// Whether more moves than cameras, lights without surface and materials. Where a file is missing, the frame that needs it says so.
    pub(super) fn moves_surfaces(&self) -> bool {
        self.at(0.0).map_or(true, |pose| !(pose.instances.is_empty() && pose.meshes.is_empty()))
    }

    /// Whether nothing moves.
    pub fn is_empty(&self) -> bool {
        self.movers.is_empty()
    }
}
