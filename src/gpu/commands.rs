//! A command buffer with its pool and fence, which is recorded, submitted and waited for.
use super::turns::Turns;
use super::{At, Gpu, Untyped, explain};
use crate::error::{Error, Result};
use ash::vk;

pub(super) struct Commands {
    gpu: Gpu,
    pool: vk::CommandPool,
    fence: vk::Fence,
    pub buffer: vk::CommandBuffer,
}

impl Commands {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let (pool, fence, buffer) = Default::default();
        // From here on, Drop cleans up if a line below fails; null handles may be destroyed.
        let mut commands = Self { gpu: gpu.clone(), pool, fence, buffer };
        let device = &gpu.0.device;
        let info = vk::CommandPoolCreateInfo::default().queue_family_index(gpu.0.queue_family);
        // SAFETY: complete infos, and handles made just before.
        unsafe {
            commands.pool = device.create_command_pool(&info, None).at("command pool")?;
            commands.fence = device.create_fence(&vk::FenceCreateInfo::default(), None).at("fence")?;
            let info = vk::CommandBufferAllocateInfo::default().command_pool(commands.pool).command_buffer_count(1);
            commands.buffer = device.allocate_command_buffers(&info).at("command buffer")?[0];
        }
        Ok(commands)
    }

    /// Begins a new recording and discards the one before.
    ///
    /// # Errors
    /// The device is out of memory, or was lost before.
    pub fn begin(&self) -> Result<()> {
        self.gpu.0.answers()?;
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is not executing, since every submission is waited for.
        unsafe {
            let device = &self.gpu.0.device;
            device.reset_command_pool(self.pool, vk::CommandPoolResetFlags::empty()).at("command pool")?;
            device.begin_command_buffer(self.buffer, &info).at("command buffer")
        }
    }

    /// Ends and submits the recording, which uses `buffers`, and waits as long as the value of `progress` keeps changing. `last_pass`
    /// names the last pass that started, if it is known, for the message about a lost device.
    ///
    /// # Errors
    /// [`Error::DeviceLost`], [`Error::Device`]. Nothing of the submission runs then, unless the device was abandoned.
    pub fn submit_and_wait<'a>(
        &self,
        buffers: impl IntoIterator<Item = &'a Untyped>,
        progress: impl Fn() -> usize,
        last_pass: impl FnOnce() -> Option<&'static str>,
    ) -> Result<()> {
        // SAFETY: the buffer is recording.
        unsafe { self.gpu.0.device.end_command_buffer(self.buffer) }.at("recording")?;
        let _inside = Turns::submission(buffers.into_iter().map(|buffer| &buffer.turns));
        self.gpu.0.submit_and_wait(self.buffer, self.fence, progress).map_err(|code| {
            match (explain("running", code), last_pass()) {
                (Error::DeviceLost(what), Some(pass)) => {
                    Error::DeviceLost(format!("{what}; the last pass to start was \"{pass}\""))
                }
                (error, _) => error,
            }
        })
    }
}

impl Drop for Commands {
    fn drop(&mut self) {
        // SAFETY: made on this device, not executing, destroyed once. Freeing the pool frees the buffer.
        self.gpu.0.free(|device| unsafe {
            device.destroy_command_pool(self.pool, None);
            device.destroy_fence(self.fence, None);
        });
    }
}
