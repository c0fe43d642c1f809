//! Uploads and read-backs. The host accesses mapped memory directly; other memory is copied through a mapped buffer.
use super::commands::Commands;
use super::{Gpu, Location, Untyped, access};
use crate::error::{Error, Result};
use ash::vk;

/// Largest size of the mapped buffer in bytes.
const CHUNK: usize = 64 << 20;

impl Untyped {
    /// Waits for the work on it, then writes `bytes` from byte `offset` on.
    ///
    /// # Errors
    /// Those of the device.
    pub(super) fn write(&self, offset: usize, bytes: &[u8]) -> Result<()> {
        let mut memory = self.idle();
        self.gpu.0.answers()?;
        if let Some(all) = memory.mapped(vk::MemoryPropertyFlags::empty()) {
            all[offset..offset + bytes.len()].copy_from_slice(bytes);
            return Ok(());
        }
        drop(memory); // An upload is a submission, which would wait for this for ever.
        upload(self, offset, bytes)
    }

    /// Waits for the work on it, then reads from byte `offset` on.
    ///
    /// # Errors
    /// Those of the device.
    pub(super) fn read(&self, offset: usize, bytes: &mut [u8]) -> Result<()> {
        let mut memory = self.idle();
        self.gpu.0.answers()?;
        if let Some(all) = memory.mapped(self.for_reading()) {
            bytes.copy_from_slice(&all[offset..offset + bytes.len()]);
            return Ok(());
        }
        drop(memory);
        download(self, offset, bytes)
    }
}

/// Writes `bytes` over `target` from byte `offset` on, and waits.
fn upload(target: &Untyped, offset: usize, bytes: &[u8]) -> Result<()> {
    let staging = Staging::new(&target.gpu, bytes.len(), Location::Upload)?;
    for (index, chunk) in bytes.chunks(CHUNK).enumerate() {
        staging.access(|all| all[..chunk.len()].copy_from_slice(chunk))?;
        staging.copy(&staging.buffer, target, region(0, offset + index * CHUNK, chunk.len()))?;
    }
    Ok(())
}

/// Reads `source` from byte `offset` on.
fn download(source: &Untyped, offset: usize, bytes: &mut [u8]) -> Result<()> {
    let staging = Staging::new(&source.gpu, bytes.len(), Location::Readback)?;
    for (index, chunk) in bytes.chunks_mut(CHUNK).enumerate() {
        staging.copy(source, &staging.buffer, region(offset + index * CHUNK, 0, chunk.len()))?;
        staging.access(|all| chunk.copy_from_slice(&all[..chunk.len()]))?;
    }
    Ok(())
}

/// The mapped buffer and the commands that copy through it.
struct Staging {
    buffer: Untyped,
    commands: Commands,
}

impl Staging {
    fn new(gpu: &Gpu, bytes: usize, location: Location) -> Result<Self> {
        let size = bytes.clamp(1, CHUNK).next_multiple_of(4);
        Ok(Self { buffer: Untyped::new(gpu, "staging", size as u64, [4; 2], location)?, commands: Commands::new(gpu)? })
    }

    fn access(&self, access: impl FnOnce(&mut [u8])) -> Result<()> {
        let mut memory = self.buffer.idle();
        let mapped = memory.mapped(vk::MemoryPropertyFlags::empty());
        mapped.map(access).ok_or_else(|| Error::Device("the device has no memory that the host can map".into()))
    }

    /// Copies one region and waits until the copy is complete.
    fn copy(&self, from: &Untyped, to: &Untyped, region: vk::BufferCopy) -> Result<()> {
        self.commands.begin()?;
        // SAFETY: both buffers live through the submission, which is waited for, and hold the region.
        unsafe {
            let device = &self.buffer.gpu.0.device;
            access::whole_barrier(device, self.commands.buffer);
            device.cmd_copy_buffer(self.commands.buffer, from.raw, to.raw, &[region]);
            access::whole_barrier(device, self.commands.buffer);
        }
        self.commands.submit_and_wait([from, to], || 0, || Some("copy"))
    }
}

fn region(from: usize, to: usize, length: usize) -> vk::BufferCopy {
    vk::BufferCopy { src_offset: from as u64, dst_offset: to as u64, size: length as u64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{Buffer, DeviceOptions};

    /// Called directly, because where the host maps the device's memory nothing is uploaded so, and where that is cached nothing read.
    #[test]
    fn copies_cross_chunks_both_ways() {
        let gpu = Gpu::open(&DeviceOptions { validation: true, ..DeviceOptions::default() }).unwrap();
        for count in [1, 1000, CHUNK / 4 + 3] {
            let values: Vec<u32> = (0..count as u32).map(|i| i.wrapping_mul(2_654_435_761)).collect();
            let buffer = Buffer::from_slice(&gpu, "staged", &vec![7u32; count + 2]).unwrap();
            let untyped = buffer.bound().buffer;
            upload(untyped, 4, bytemuck::cast_slice(&values)).unwrap();
            let mut back = vec![0u32; count + 2];
            download(untyped, 0, bytemuck::cast_slice_mut(&mut back)).unwrap();
            assert!(back[1..=count] == values, "{count} words");
            assert_eq!((back[0], back[count + 1]), (7, 7), "the rest is kept");
            assert!(back == buffer.read().unwrap(), "as the mapped way reads it");
            let mut tail = vec![0u32; count];
            download(untyped, 8, bytemuck::cast_slice_mut(&mut tail)).unwrap();
            assert!(tail == back[2..], "from the third word on");
        }
        assert_eq!(gpu.validation_messages(), Vec::<String>::new());
    }
}
