//! The resources that recording a frame needs. They are reused by later frames, so that only the first ones create any.
use super::Gpu;
use super::acceleration::Handles;
use super::access::Hazards;
use super::commands::Commands;
use super::descriptors::Descriptors;
use super::kernel::Compiled;
use super::pipelines::Pipeline;
use super::shape::{Pass, PassObserver, PassShape};
use super::timing::{PassTime, Timer};
use super::upload::Uploads;
use crate::error::Result;
use ash::vk;
use std::sync::Arc;

/// Command buffer, descriptor sets and timestamps of one frame in flight. They grow to what a frame needs and are reused
/// by every recording. The frame also keeps the buffers and kernels of the last recording alive, until its work is known to be
/// complete: [`Gpu::run`] waits for it, of others [`Self::release`] tells.
pub struct FrameResources {
    commands: Commands,
    pub(super) descriptors: Descriptors,
    pub(super) timer: Timer,
    pub(super) hazards: Hazards,
    pub(super) uploads: Uploads,
    pipelines: Vec<Arc<Pipeline>>,
    structures: Vec<Arc<Handles>>,
    /// One for each pass of the last recording.
    pub(super) shapes: Vec<PassShape>,
    observer: Option<PassObserver>,
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
            uploads: Uploads::default(),
            pipelines: Vec::new(),
            structures: Vec::new(),
            shapes: Vec::new(),
            observer: None,
        })
    }

    /// Begin and end of each pass of the last recording, in order; empty if the queue has no timestamps, if passes are not timed, and
    /// after a [`Gpu::run`] that failed.
    ///
    /// # Errors
    /// [`Error::Usage`](crate::error::Error::Usage) when that work is not complete,
    /// [`Error::DeviceLost`](crate::error::Error::DeviceLost) when the device was lost: nothing on it works from then on.
    pub fn times(&self) -> Result<Vec<PassTime>> {
        self.timer.times()
    }

    /// The passes of the last recording, in order, with what they were recorded with; empty if they were not timed.
    ///
    /// # Errors
    /// Those of [`Self::times`], for the same reasons.
    pub fn passes(&self) -> Result<Vec<Pass>> {
        let shapes = self.shapes.iter().cloned();
        Ok(self.times()?.into_iter().zip(shapes).map(|(time, shape)| Pass { time, shape }).collect())
    }

    /// Tells `observer` of the passes of every later [`Gpu::run`] with this frame, once they are complete: the place to hand
    /// them to a profiler of the engine's own. It replaces an earlier observer. What was recorded with
    /// [`super::Recorder::external`] is submitted by the engine, which asks for [`Self::passes`] when it is complete.
    pub fn observe(&mut self, observer: impl FnMut(&[Pass]) + Send + Sync + 'static) {
        self.observer = Some(Box::new(observer));
    }

    /// Whether passes are timed from the next recording on; at first they are. Without timestamps a frame that hangs is not told
    /// from one that is slow: the device's wait limit is that of the whole submission.
    pub fn set_timed(&mut self, timed: bool) {
        self.timer.timed = timed;
    }

    /// Tells the observer, if there is one, that the last recording is complete.
    ///
    /// # Errors
    /// As [`Self::passes`].
    pub(super) fn tell(&mut self) -> Result<()> {
        if let Some(mut observer) = self.observer.take() {
            let passes = self.passes();
            if let Ok(passes) = &passes {
                observer(passes);
            }
            self.observer = Some(observer);
            passes?;
        }
        Ok(())
    }

    /// Lets go of the buffers, kernels and structures of the last recording, and of the memory that its uploads went through, so that what
    /// a dropped renderer or denoiser took is free before another is made. Times and passes stay, and so does what another recording
    /// reuses. What was recorded with [`super::Recorder::external`] must be complete, as for another recording; [`Gpu::run`] lets go
    /// of all but the memory of uploads by itself.
    pub fn release(&mut self) {
        self.let_go();
        self.uploads = Uploads::default();
    }

    /// Forgets what the last recording uses, which is complete.
    pub(super) fn let_go(&mut self) {
        self.hazards.clear();
        self.pipelines.clear();
        self.structures.clear();
    }

    pub(super) fn gpu(&self) -> &Gpu {
        self.timer.gpu()
    }

    /// Prepares for the next recording. The work of the last one is complete: `Gpu::run` waits for it, and the contract of
    /// `Recorder::external` requires it.
    ///
    /// # Errors
    /// The device was lost before.
    pub(super) fn reset(&mut self) -> Result<()> {
        self.gpu().0.answers()?;
        self.forget();
        self.let_go();
        self.uploads.reset();
        self.descriptors.reset()
    }

    /// Forgets the passes of the last recording.
    pub(super) fn forget(&mut self) {
        self.timer.reset();
        self.shapes.clear();
    }

    /// Resets, and starts the frame's own command buffer.
    pub(super) fn begin(&mut self) -> Result<vk::CommandBuffer> {
        self.reset()?;
        self.commands.begin()?;
        Ok(self.commands.buffer)
    }

    pub(super) fn submit_and_wait(&self) -> Result<()> {
        self.commands.submit_and_wait(self.hazards.buffers(), || self.timer.written(), || self.timer.last_started())
    }

    /// Keeps a kernel until the work is complete.
    pub(super) fn keep(&mut self, kernel: &Compiled) {
        if !self.pipelines.iter().any(|kept| Arc::ptr_eq(kept, &kernel.pipeline)) {
            self.pipelines.push(kernel.pipeline.clone());
        }
    }

    /// Keeps acceleration structures until the work is complete.
    pub(super) fn keep_structures(&mut self, handles: &Arc<Handles>) {
        if !self.structures.iter().any(|kept| Arc::ptr_eq(kept, handles)) {
            self.structures.push(handles.clone());
        }
    }
}
