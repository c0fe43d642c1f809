//! Memory that uploads of a frame go through. It belongs to the frame, so that the host writes it while other frames are in flight.
use super::{Buffer, Gpu, Location};
use crate::error::{Error, Result};
use ash::vk;

/// Words of the smallest buffers. These are kept, so that scenes in which little moves allocate nothing.
const LEAST: usize = 1 << 14;

/// Recordings in a row that do without a larger buffer before it goes.
const UNUSED: u32 = 2;

/// Mapped buffers, each for one upload and for others that it has room for. They are reused by later recordings.
#[derive(Default)]
pub(super) struct Uploads {
    rooms: Vec<Room>,
}

struct Room {
    buffer: Buffer<u32>,
    /// Words that are taken of it.
    taken: usize,
    /// Recordings that have done without it.
    unused: u32,
}

impl Uploads {
    /// Forgets what was uploaded. The work that reads it must be complete.
    pub fn reset(&mut self) {
        for room in &mut self.rooms {
            room.unused = if room.taken > 0 { 0 } else { room.unused + 1 };
            room.taken = 0;
        }
        self.rooms.retain(|room| room.unused < UNUSED || room.buffer.len() == LEAST);
    }

    /// Room for so many words, and the first of them: one buffer has them all.
    fn room(&mut self, gpu: &Gpu, words: usize) -> Result<(Buffer<u32>, usize)> {
        let fits = |&at: &usize| self.rooms[at].buffer.len() - self.rooms[at].taken >= words;
        // The smallest, so that a few words do not keep a large one.
        let smallest = (0..self.rooms.len()).filter(fits).min_by_key(|&at| self.rooms[at].buffer.len());
        let at = match smallest {
            Some(at) => at,
            None => {
                let buffer = Buffer::new(gpu, "uploads", rounded(words), Location::Upload)?;
                self.rooms.push(Room { buffer, taken: 0, unused: 0 });
                self.rooms.len() - 1
            }
        };
        let room = &mut self.rooms[at];
        let first = room.taken;
        room.taken += words;
        Ok((room.buffer.clone(), first))
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
        let mut memory = buffer.bound().buffer.idle();
        let unmapped = || Error::Device("the device has no memory that the host can map".into());
        let all = memory.mapped(vk::MemoryPropertyFlags::empty()).ok_or_else(unmapped)?;
        let mut at = first;
        for part in parts {
            all[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
        drop(memory);
        Ok((buffer, first))
    }
}

/// Words of a buffer for so many: up to a quarter more, so that the next upload finds room even when it is a little longer.
fn rounded(words: usize) -> usize {
    words.next_multiple_of((words.next_power_of_two() / 8).max(1)).max(LEAST)
}
