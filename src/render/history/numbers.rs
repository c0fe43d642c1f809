//! How a scene that has changed numbers what it had before.
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::render::upload::whole;
use crate::scene::Change;

/// By their numbers in the last frame, those of instances and of triangles in this one.
pub struct Numbers {
    /// As [`Change::instance_now`].
    pub instance_now: Buffer<u32>,
    /// As [`Change::triangle_now`].
    pub triangle_now: Buffer<u32>,
    anew: [bool; 2],
}

impl Numbers {
    /// Of a scene that numbers nothing anew.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            instance_now: Buffer::from_slice(gpu, "instances now", &[])?,
            triangle_now: Buffer::from_slice(gpu, "triangles now", &[])?,
            anew: [false; 2],
        })
    }

    /// Those after a change.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn note(&mut self, rec: &mut Recorder, change: &Change) -> Result<()> {
        let now = [&change.instance_now, &change.triangle_now];
        self.anew = now.map(|now| !now.is_empty());
        for (to, now) in [&mut self.instance_now, &mut self.triangle_now].into_iter().zip(now) {
            if !now.is_empty() {
                whole(rec, to, now)?;
            }
        }
        Ok(())
    }

    /// Whether instances and triangles are numbered anew, as [`crate::layout::ReprojectPush`] says it.
    pub fn anew(&self) -> [u32; 2] {
        self.anew.map(u32::from)
    }
}
