//! What the passes that carry samples share.
use super::History;
use crate::layout::{PathConstants, ReprojectPush};
use crate::render::buffers::{DeviceScene, FilmTile};
use std::ops::Range;

/// What hands samples over from frame to frame, and what they are of.
#[derive(Clone, Copy)]
pub struct Handover<'a> {
    /// What the last frame hands on.
    pub history: &'a History,
    /// The scene that both frames show.
    pub scene: &'a DeviceScene,
    /// The film of one frame after the other.
    pub tile: &'a FilmTile,
    /// What the kernels of the frame are told.
    pub constants: &'a PathConstants,
}

impl Handover<'_> {
    /// The pixels of each window of the tile, and what kernels are told of them.
    pub fn windows(&self) -> impl Iterator<Item = (Range<usize>, ReprojectPush)> {
        let push = |w: &Range<u32>| self.history.push(self.constants, w.start, w.end - w.start);
        self.tile.windows().map(move |w| (w.start as usize..w.end as usize, push(&w)))
    }
}
