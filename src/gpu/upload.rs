//! Memory that uploads of a frame go through. It belongs to the frame, so that the host writes it while other frames are in flight.
use super::{Buffer, Gpu, Location};
use crate::error::{Error, Result};
use ash::vk;

/// Words of the first buffer; later ones have at least twice what there was.
const LEAST: usize = 1 << 14;

/// Mapped buffers that are filled one after another. They grow to what a frame needs and are reused by every recording.
#[derive(Default)]
pub(super) struct Uploads {
    buffers: Vec<Buffer<u32>>,
    /// Words that are taken of the last buffer.
    taken: usize,
}

impl Uploads {
    /// Forgets what was uploaded; only the largest buffer is kept. The work that reads them must be complete.
    pub fn reset(&mut self) {
        self.buffers.drain(..self.buffers.len().saturating_sub(1));
        self.taken = 0;
    }

    /// Room for so many words, and the first of them: one buffer has them all.
    fn room(&mut self, gpu: &Gpu, words: usize) -> Result<(Buffer<u32>, usize)> {
        let had = self.buffers.last().map_or(0, Buffer::len);
        if had < self.taken + words {
            let size = words.max(2 * had).max(LEAST);
            self.buffers.push(Buffer::new(gpu, "uploads", size, Location::Upload)?);
            self.taken = 0;
        }
        let first = self.taken;
        self.taken += words;
        let buffer = self.buffers.last().ok_or_else(|| Error::Device("uploads have no buffer".into()))?;
        Ok((buffer.clone(), first))
    }

    /// Writes bytes, whole words, into a buffer, and returns it and the first byte.
    ///
    /// # Errors
    /// [`Error::Device`] when memory is out, or cannot be mapped.
    pub fn write<'a>(
        &mut self,
        gpu: &Gpu,
        bytes: usize,
        parts: impl Iterator<Item = &'a [u8]>,
    ) -> Result<(Buffer<u32>, usize)> {
        let (buffer, word) = self.room(gpu, bytes / 4)?;
        let first = 4 * word;
        let copied = buffer.bound().buffer.mapped(vk::MemoryPropertyFlags::empty(), |all| {
            let mut at = first;
            for part in parts {
                all[at..at + part.len()].copy_from_slice(part);
                at += part.len();
            }
        });
        copied.ok_or_else(|| Error::Device("the device has no memory that the host can map".into()))?;
        Ok((buffer, first))
    }
}
