//! The resources that recording a frame needs. They are reused by later frames, so that only the first ones create any.
use super::access::Hazards;
use super::commands::Commands;
use super::descriptors::Descriptors;
use super::kernel::Parts;
use super::timing::{PassTime, Timer};
use super::{Gpu, Kernel};
use crate::error::Result;
use ash::vk;
use std::sync::Arc;

/// Command buffer, descriptor sets and timestamps of one frame in flight. They grow to what a frame needs and are reused
/// by every recording. The frame also keeps the buffers and kernels of the last recording alive.
pub struct FrameResources {
    commands: Commands,
    pub(super) descriptors: Descriptors,
    pub(super) timer: Timer,
    pub(super) hazards: Hazards,
    kernels: Vec<Arc<Parts>>,
}

impl FrameResources {
    /// # Errors
    /// The device is out of memory.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            commands: Commands::new(gpu)?,
            descriptors: Descriptors::new(gpu),
            timer: Timer::new(gpu),
            hazards: Hazards::default(),
            kernels: Vec::new(),
        })
    }

    /// Begin and end of each pass of the last recording, in order; empty if the queue has no timestamps.
    ///
    /// # Errors
    /// When that work is not complete.
    pub fn times(&self) -> Result<Vec<PassTime>> {
        self.timer.times()
    }

    pub(super) fn gpu(&self) -> &Gpu {
        self.timer.gpu()
    }

    /// Prepares for the next recording. The work of the last one is complete: `Gpu::run` waits for it, and the contract of
    /// `Recorder::external` requires it.
    ///
    /// # Errors
    /// The device was abandoned, with the work on it.
    pub(super) fn reset(&mut self) -> Result<()> {
        self.gpu().0.answers()?;
        self.timer.reset();
        self.hazards.clear();
        self.kernels.clear();
        self.descriptors.reset()
    }

    /// Resets, and starts the frame's own command buffer.
    pub(super) fn begin(&mut self) -> Result<vk::CommandBuffer> {
        self.reset()?;
        self.commands.begin()?;
        Ok(self.commands.buffer)
    }

    pub(super) fn submit_and_wait(&self) -> Result<()> {
        self.commands.submit_and_wait(|| self.timer.written(), || self.timer.last_started())
    }

    /// Keeps a kernel until the next reset.
    pub(super) fn keep<B>(&mut self, kernel: &Kernel<B>) {
        if !self.kernels.iter().any(|kept| Arc::ptr_eq(kept, &kernel.parts)) {
            self.kernels.push(kernel.parts.clone());
        }
    }
}
