//! Recording of work. Every pass gets its barrier, debug label and timestamps here, and kernels are bound and dispatched.
use super::acceleration::Handles;
use super::kernel::Compiled;
use super::shape::{KernelCode, PassShape};
use super::{
    Acceleration, Access, Bindings, Bound, Buffer, FrameResources, Gpu, Kernel, Location, PassTime, SlotKind, Untyped,
    access,
};
use crate::error::{Error, Result};
use ash::vk;
use ash::vk::Handle;
use bytemuck::Pod;
use std::ffi::CString;
use std::sync::Arc;

/// Records passes, in order, into a frame. Dropping it completes the recording. Kernels, buffers and all else that it is given have to be
/// of its device: what was made on another is refused as [`Error::Usage`].
pub struct Recorder<'a> {
    gpu: &'a Gpu,
    frame: &'a mut FrameResources,
    commands: vk::CommandBuffer,
    barriers: bool,
}

impl Gpu {
    /// Records work with `record`, submits it, waits for it, and returns the times of the passes, in order; there are none if
    /// the queue has no timestamps. Everything that earlier runs wrote is visible to this one, and everything that it writes
    /// is visible to the host.
    ///
    /// # Errors
    /// Those of `record` and [`Error::Usage`] for a frame of another device, in which cases nothing was submitted, and [`Error::Device`] or
    /// [`Error::DeviceLost`] when the device fails. The frame keeps nothing alive then either.
    pub fn run(
        &self,
        frame: &mut FrameResources,
        record: impl FnOnce(&mut Recorder<'_>) -> Result<()>,
    ) -> Result<Vec<PassTime>> {
        let mut recorder = Recorder::own(self, frame)?;
        let recorded = record(&mut recorder);
        drop(recorder);
        let done = recorded.and_then(|()| frame.submit_and_wait());
        frame.let_go(); // Nothing of it runs any more, or the device was given up and frees nothing.
        if let Err(why) = done {
            frame.forget();
            return Err(why);
        }
        frame.tell()?;
        frame.times()
    }
}

impl<'a> Recorder<'a> {
    /// Records into the frame's own command buffer.
    pub(super) fn own(gpu: &'a Gpu, frame: &'a mut FrameResources) -> Result<Self> {
        gpu.owns("the frame", frame.gpu())?;
        let commands = frame.begin()?;
        Ok(Self::start(gpu, frame, commands))
    }

    /// Records into the caller's `VkCommandBuffer`, given as the number that it is in Vulkan's C interface. The passes see
    /// what the caller recorded or submitted before. Once this recorder is dropped, what they write is visible to everything
    /// that follows and to the host. What is bound for compute does not outlast it: the pipeline, all descriptor sets, and the push
    /// constants of all stages. Bind anew what your next dispatch takes.
    ///
    /// # Safety
    /// - The command buffer was made for the device and queue family of `gpu`, is recording outside a render pass, and
    ///   nobody else records into it until the recorder is dropped.
    /// - It is submitted at most once, to a queue of that device.
    /// - `frame` is neither recorded into again nor released nor dropped before that submission is complete: a command buffer with a
    ///   pass of yours between two recordings takes two frames.
    /// - No buffer that it uses is read or written from the submission until it is complete: by [`Buffer::read`],
    ///   [`Buffer::read_range`] or [`Buffer::write`], by [`Gpu::run`], by what calls any of these, or by another such submission,
    ///   unless that goes to the same queue or a semaphore orders the two. What calls them is all that returns what the device has
    ///   found or gives the device what the host has, such as of a [`Renderer`](crate::render::Renderer) `picture`, `counters`,
    ///   `broken_samples`, `apportionment`, `listed`, `priorities_of`, `carriage`, `resume`, `take_up`, `add_history`,
    ///   `keep_history`, `begin_frame`, `look_up` and `run`, every function of a [`Job`](crate::render::Job), of a
    ///   [`Denoiser`](crate::denoise::Denoiser) `scales`, and [`film::read_back`](crate::render::film::read_back),
    ///   [`Noisy`](crate::denoise::Noisy), [`Filtered`](crate::denoise::Filtered) and
    ///   [`Scales`](crate::denoise::filter::Scales) of what that submission uses. All of these are safe functions, and nothing but this
    ///   promise keeps them from memory that the device is writing.
    /// - The recorder is dropped before the command buffer is ended.
    ///
    /// # Errors
    /// [`Error::Usage`] when the handle is null or the frame is of another device, [`Error::Device`] when the device is out of memory,
    /// [`Error::DeviceLost`] when it was lost before.
    pub unsafe fn external(gpu: &'a Gpu, frame: &'a mut FrameResources, command_buffer: u64) -> Result<Self> {
        if command_buffer == 0 {
            return Err(Error::Usage("a null command buffer was handed over".into()));
        }
        gpu.owns("the frame", frame.gpu())?;
        frame.reset()?;
        Ok(Self::start(gpu, frame, vk::CommandBuffer::from_raw(command_buffer)))
    }

    fn start(gpu: &'a Gpu, frame: &'a mut FrameResources, commands: vk::CommandBuffer) -> Self {
        // SAFETY: recording, by the caller's contract or because `begin` has just started it.
        unsafe { access::whole_barrier(&gpu.0.device, commands) };
        Self { gpu, frame, commands, barriers: true }
    }

    /// Runs `kernel` on the buffers in `bind` with at least `threads` threads, which `thread_index()` numbers in the kernel.
    ///
    /// # Errors
    /// As [`Self::dispatch`].
    pub fn dispatch_threads<B: Bindings>(
        &mut self,
        kernel: &Kernel<B>,
        bind: B,
        push: &B::Push,
        threads: u32,
    ) -> Result<()> {
        self.dispatch(kernel, bind, push, kernel.folded_groups(threads))
    }

    /// Runs `kernel` on the buffers in `bind` with `groups` workgroups along x, y and z.
    ///
    /// # Errors
    /// [`Error::Usage`] when a group count is 0, a part of a buffer is bound as texels, a kernel that traces by ray queries is given no
    /// acceleration structures, or something was made on another device; [`Error::Device`] when a group count is over the device's
    /// limit, a buffer is too large for its slot, or memory is out.
    pub fn dispatch<B: Bindings>(
        &mut self,
        kernel: &Kernel<B>,
        bind: B,
        push: &B::Push,
        groups: [u32; 3],
    ) -> Result<()> {
        self.bind(&kernel.compiled, &bind.buffers(), bind.acceleration(), bytemuck::bytes_of(push), groups)
    }

    fn bind(
        &mut self,
        kernel: &Compiled,
        buffers: &[Bound],
        world: Option<&Acceleration>,
        push: &[u8],
        groups: [u32; 3],
    ) -> Result<()> {
        let &Compiled { name, slots, .. } = kernel;
        check_groups(name, groups, self.gpu.0.limits.max_compute_work_group_count)?;
        self.gpu.owns(name, &kernel.gpu)?;
        self.owns(buffers)?;
        let world = self.world(kernel, world)?;
        let set = self.frame.descriptors.set(&kernel.pipeline, slots, buffers, world.map(|(at, w)| (at, w.top)))?;
        let bound = buffers.iter().map(|b| b.buffer).zip(slots.iter().map(|slot| slot.access));
        let accesses: Vec<_> = bound.chain(world.map(|(_, w)| (w.storage.bound().buffer, Access::Trace))).collect();
        self.frame.keep(kernel);
        let (pipeline, layout) = (kernel.pipeline.raw, kernel.pipeline.layout);
        let compute = vk::PipelineBindPoint::COMPUTE;
        let code = KernelCode { spirv: kernel.spirv, constants: kernel.constants.clone() };
        let bytes = slots.iter().zip(buffers).map(|(slot, bound)| bound.bytes(slot.kind == SlotKind::Uniform));
        let shape = PassShape::of_kernel(groups, kernel.local_size, slots, bytes, code);
        // SAFETY: the frame keeps the kernel, the set and every buffer until the work is complete.
        self.pass(name, &accesses, shape, &|device, commands| unsafe {
            device.cmd_bind_pipeline(commands, compute, pipeline);
            device.cmd_bind_descriptor_sets(commands, compute, layout, 0, &[set], &[]);
            device.cmd_push_constants(commands, layout, vk::ShaderStageFlags::COMPUTE, 0, push);
            device.cmd_dispatch(commands, groups[0], groups[1], groups[2]);
        })
    }

    /// What a kernel that traces by ray queries traces through, and the binding for it.
    fn world<'b>(
        &mut self,
        kernel: &Compiled,
        world: Option<&'b Acceleration>,
    ) -> Result<Option<(u32, &'b Arc<Handles>)>> {
        let Some(binding) = kernel.world else { return Ok(None) };
        let none = || Error::Usage(format!("{}: the scene has no acceleration structures", kernel.name));
        let handles = &world.ok_or_else(none)?.handles;
        self.gpu.owns("the acceleration structures", &handles.gpu)?;
        self.frame.keep_structures(handles);
        Ok(Some((binding, handles)))
    }

    /// Copies all of `src` over `dst`, which has the same length.
    ///
    /// # Errors
    /// [`Error::Usage`] when the lengths differ or both are one buffer, [`Error::Device`] when memory is out.
    pub fn copy<T: Pod>(&mut self, src: &Buffer<T>, dst: &Buffer<T>) -> Result<()> {
        let [source, target] = [src.bound(), dst.bound()];
        let (from, to) = (source.buffer, target.buffer);
        if src.len() != dst.len() || Arc::ptr_eq(from, to) {
            let (from, to, m, n) = (&from.name, &to.name, src.len(), dst.len());
            let why = "give two buffers of one length";
            return Err(Error::Usage(format!("\"{from}\" of {m} elements cannot be copied to \"{to}\" of {n}: {why}")));
        }
        self.owns(&[source, target])?;
        let region = [vk::BufferCopy { src_offset: source.offset, dst_offset: target.offset, size: source.size }];
        let accesses = [(from, Access::CopySource), (to, Access::CopyTarget)];
        // SAFETY: two live buffers of one size, kept by the frame.
        let shape = PassShape::of_transfer(&accesses.map(|(_, access)| access), source.size);
        self.pass("copy", &accesses, shape, &|device, commands| unsafe {
            device.cmd_copy_buffer(commands, from.raw, to.raw, &region);
        })
    }

    /// Copies all of `src` to memory that the host reads without another submission, once this one is complete.
    ///
    /// # Errors
    /// [`Error::Device`] when memory is out.
    pub(crate) fn copied<T: Pod>(&mut self, src: &Buffer<T>) -> Result<Buffer<T>> {
        let copy = Buffer::new(self.gpu, "copy for the host", src.len(), Location::Readback)?;
        self.copy(src, &copy)?;
        Ok(copy)
    }

    /// Sets every 32-bit word of `buffer` to `value`.
    ///
    /// # Errors
    /// [`Error::Device`] when memory is out.
    pub fn fill<T: Pod>(&mut self, buffer: &Buffer<T>, value: u32) -> Result<()> {
        self.fill_all(buffer.bound(), value)
    }

    fn fill_all(&mut self, all: Bound, value: u32) -> Result<()> {
        let Bound { buffer: target, offset, size } = all;
        self.owns(&[all])?;
        // SAFETY: a live buffer whose size is a multiple of four, kept by the frame.
        let shape = PassShape::of_transfer(&[Access::CopyTarget], size);
        self.pass("fill", &[(target, Access::CopyTarget)], shape, &|device, commands| unsafe {
            device.cmd_fill_buffer(commands, target.raw, offset, size, value);
        })
    }

    /// Replaces the first element of `buffer`. Passes recorded before it read the old value, later ones the new one.
    ///
    /// # Errors
    /// [`Error::Device`] when memory is out.
    pub fn update<T: Pod>(&mut self, buffer: &Buffer<T>, value: &T) -> Result<()> {
        const { assert!(size_of::<T>() <= 65_536, "the most that an update may have") };
        let Bound { buffer: target, offset, .. } = buffer.bound();
        self.owns(&[buffer.bound()])?;
        // SAFETY: a live buffer of one element or more, whole words, kept by the frame.
        let shape = PassShape::of_transfer(&[Access::CopyTarget], size_of::<T>() as u64);
        self.pass("update", &[(target, Access::CopyTarget)], shape, &|device, commands| unsafe {
            device.cmd_update_buffer(commands, target.raw, offset, bytemuck::bytes_of(value));
        })
    }

    /// Replaces parts of `buffer`, each the elements from an index on, by way of memory of the frame's own: the values are read now,
    /// and may change while the frame is in flight. Passes recorded before it read the old values, later ones the new. Parts of
    /// one call may not overlap.
    ///
    /// # Errors
    /// [`Error::Usage`] when a part exceeds the buffer, [`Error::Device`] when memory is out.
    pub fn upload<T: Pod>(&mut self, buffer: &Buffer<T>, parts: &[(usize, &[T])]) -> Result<()> {
        let parts: Vec<_> = parts.iter().filter(|(_, values)| !values.is_empty()).collect();
        if let Some((at, values)) = parts.iter().find(|(at, v)| at.saturating_add(v.len()) > buffer.len()) {
            let (name, count, len) = (&buffer.bound().buffer.name, values.len(), buffer.len());
            return Err(Error::Usage(format!("buffer \"{name}\": {count} elements at {at} exceed its {len}")));
        }
        if parts.is_empty() {
            return Ok(());
        }
        let Bound { buffer: target, offset, .. } = buffer.bound();
        self.owns(&[buffer.bound()])?;
        let bytes = parts.iter().map(|(_, values)| size_of_val(*values)).sum();
        let slices = parts.iter().map(|(_, values)| bytemuck::cast_slice(values));
        let (staged, first) = self.frame.uploads.write(self.gpu, bytes, slices)?;
        let source = staged.bound().buffer;
        let mut from = first as u64;
        let region = |(at, values): &&(usize, &[T])| {
            let (size, src_offset) = (size_of_val(*values) as u64, from);
            from += size;
            vk::BufferCopy { src_offset, dst_offset: offset + (at * size_of::<T>()) as u64, size }
        };
        let regions: Vec<_> = parts.iter().map(region).collect();
        let accesses = [(source, Access::CopySource), (target, Access::CopyTarget)];
        // SAFETY: two live buffers that hold the regions, kept by the frame.
        let shape = PassShape::of_transfer(&accesses.map(|(_, access)| access), bytes as u64);
        self.pass("upload", &accesses, shape, &|device, commands| unsafe {
            device.cmd_copy_buffer(commands, source.raw, target.raw, &regions);
        })
    }

    /// Omits the barriers between all later passes. Tests plant this fault to prove that validation finds it.
    #[doc(hidden)]
    pub fn suppress_barriers(&mut self) {
        self.barriers = false;
    }

    fn owns(&self, buffers: &[Bound]) -> Result<()> {
        buffers.iter().try_for_each(|bound| self.gpu.owns(&bound.buffer.name, &bound.buffer.gpu))
    }

    pub(crate) fn gpu(&self) -> &Gpu {
        self.gpu
    }

    /// Keeps acceleration structures until the work is done.
    pub(super) fn keep_structures(&mut self, handles: &Arc<Handles>) {
        self.frame.keep_structures(handles);
    }

    /// Records a pass with what must come before and after it.
    pub(super) fn pass(
        &mut self,
        name: &'static str,
        accesses: &[(&Arc<Untyped>, Access)],
        shape: PassShape,
        record: &dyn Fn(&ash::Device, vk::CommandBuffer),
    ) -> Result<()> {
        let times = self.frame.timer.open(name)?;
        self.frame.shapes.push(shape);
        let (inner, commands) = (&self.gpu.0, self.commands);
        // Both timestamps wait for all earlier work, so that a pass is not charged for the end of another.
        let stamp = |offset: u32| {
            if let Some((pool, query)) = times {
                let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
                // SAFETY: the command buffer is recording; the query was reset and is used once.
                unsafe { inner.device.cmd_write_timestamp2(commands, stage, pool, query + offset) };
            }
        };
        if self.frame.hazards.note(accesses) && self.barriers {
            // SAFETY: the command buffer is recording.
            unsafe { access::pass_barrier(&inner.device, commands, self.gpu.traces_by_ray_query()) };
        }
        self.label(name, &|| {
            stamp(0);
            record(&inner.device, commands);
            stamp(1);
        });
        Ok(())
    }

    /// Calls `record` under a debug label for capture tools, if labels are available.
    fn label(&self, name: &str, record: &dyn Fn()) {
        let (Some(debug), Ok(name)) = (&self.gpu.0.debug, CString::new(name)) else { return record() };
        let label = vk::DebugUtilsLabelEXT::default().label_name(&name);
        // SAFETY: the command buffer is recording; the label is closed below.
        unsafe { debug.cmd_begin_debug_utils_label(self.commands, &label) };
        record();
        unsafe { debug.cmd_end_debug_utils_label(self.commands) };
    }
}

impl Drop for Recorder<'_> {
    fn drop(&mut self) {
        // SAFETY: the command buffer is still recording.
        unsafe { access::whole_barrier(&self.gpu.0.device, self.commands) };
    }
}

fn check_groups(name: &str, groups: [u32; 3], limit: [u32; 3]) -> Result<()> {
    if groups.contains(&0) {
        return Err(Error::Usage(format!("{name}: an empty dispatch of {groups:?} workgroups")));
    }
    if groups.iter().zip(limit).any(|(count, most)| *count > most) {
        let what = format!("{name}: {groups:?} workgroups are over the device's limit of {limit:?}");
        return Err(Error::Device(format!("{what}: choose a smaller film")));
    }
    Ok(())
}
