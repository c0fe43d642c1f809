//! Typed, named buffers in device memory: allocation, binding, and element access from the host.
use super::turns::{Host, Turns};
use super::{At, DeviceKind, Gpu, LESS_MEMORY, explain};
use crate::error::{Error, Result};
use ash::vk;
use ash::vk::Handle;
use bytemuck::Pod;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};
use gpu_allocator::{AllocationError, MemoryLocation};
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A part of a buffer begins at a multiple of this many elements. An element has at least 4 bytes, so the offset is a
/// multiple of 256 bytes, the largest alignment that Vulkan lets a device require.
pub const PART: usize = 64;

/// The memory that holds a buffer. On devices with unified memory all three are the same mapped memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Location {
    /// The memory that kernels access fastest.
    Device,
    /// Written by the host, read by kernels or copies.
    Upload,
    /// Written by kernels or copies, read by the host.
    Readback,
}

/// A range of a Vulkan buffer, for code that binds it itself. The buffer was made with `VK_BUFFER_USAGE_STORAGE_BUFFER_BIT`,
/// `UNIFORM_BUFFER`, `UNIFORM_TEXEL_BUFFER`, `TRANSFER_SRC` and `TRANSFER_DST`, and with `VK_SHARING_MODE_EXCLUSIVE`: a queue of
/// another family than that of the `Gpu` reads it only between two transfers of its ownership, there and back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawBuffer {
    /// The `VkBuffer` handle.
    pub handle: u64,
    /// Bytes from the start of the buffer.
    pub offset: u64,
    /// Size of the range in bytes.
    pub size: u64,
}

/// How the values of one pixel are laid out in memory. `as i32` gives the `VkFormat` of the same name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
#[repr(i32)]
pub enum PixelFormat {
    /// One unsigned 32-bit integer.
    R32Uint = vk::Format::R32_UINT.as_raw(),
    /// One 32-bit float.
    R32Sfloat = vk::Format::R32_SFLOAT.as_raw(),
    /// Three 32-bit floats without padding.
    R32G32B32Sfloat = vk::Format::R32G32B32_SFLOAT.as_raw(),
    /// Four 32-bit floats.
    R32G32B32A32Sfloat = vk::Format::R32G32B32A32_SFLOAT.as_raw(),
}

/// A buffer of `len` values of `T`. Kernels can bind it as storage, as texels or as a uniform block, and it can be copied.
pub struct Buffer<T> {
    untyped: Arc<Untyped>,
    /// Index of the first element within the memory; 0 unless this is a part.
    first: usize,
    len: usize,
    of: PhantomData<fn() -> T>,
}

/// A clone is another handle to the same memory.
impl<T> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        Self { untyped: self.untyped.clone(), first: self.first, len: self.len, of: PhantomData }
    }
}

/// The range of a buffer that a kernel binds. It is public only for generated code.
#[doc(hidden)]
#[derive(Clone, Copy)]
pub struct Bound<'a> {
    pub(super) buffer: &'a Arc<Untyped>,
    /// Offset of the first element in bytes.
    pub(super) offset: u64,
    pub(super) size: u64,
}

/// A buffer without its element type. It is public only for generated code.
#[doc(hidden)]
pub struct Untyped {
    pub(super) gpu: Gpu,
    pub(super) name: String,
    pub(super) raw: vk::Buffer,
    /// Size in bytes, a multiple of 4.
    pub(super) size: u64,
    /// Bytes that views of its texels show, those beyond `size` being 0.
    shown: u64,
    pub(super) location: Location,
    /// Bytes of one element.
    stride: u64,
    /// Bytes of one texel, for kernels that read it so.
    texel: u64,
    /// `None` only during construction.
    memory: Mutex<Option<Allocation>>,
    /// Who may access the memory.
    pub(super) turns: Turns,
    views: Mutex<Vec<(vk::Format, vk::BufferView)>>,
}

impl<T: Pod> Buffer<T> {
    /// Allocates room for `len` values, each of one or more 32-bit words, with undefined contents. `name` appears in messages
    /// and captures. A length of 0 becomes 1, because Vulkan has no empty buffers.
    ///
    /// # Errors
    /// [`Error::Device`] with the name, the size and the limit when the device cannot hold it.
    pub fn new(gpu: &Gpu, name: &str, len: usize, location: Location) -> Result<Self> {
        Self::with_texels(gpu, name, len, location, texel_bytes(size_of::<T>()))
    }

    fn with_texels(gpu: &Gpu, name: &str, len: usize, location: Location, texel: u64) -> Result<Self> {
        const { assert!(size_of::<T>() > 0 && size_of::<T>().is_multiple_of(4), "elements are whole words") };
        let len = len.max(1);
        let bytes = len.checked_mul(size_of::<T>()).and_then(|bytes| (bytes as u64).checked_next_multiple_of(texel));
        let too_many = || Error::Device(format!("buffer \"{name}\": {len} elements are more than memory can hold"));
        let size = bytes.ok_or_else(too_many)?;
        let untyped = Arc::new(Untyped::new(gpu, name, size, [size_of::<T>() as u64, texel], location)?);
        Ok(Self { untyped, first: 0, len, of: PhantomData })
    }

    /// Returns the elements in `range`, in the same memory, for a storage binding that could not hold all of them. The range
    /// must begin at a multiple of [`PART`].
    ///
    /// # Errors
    /// [`Error::Usage`] when there is no such part.
    pub fn part(&self, range: Range<usize>) -> Result<Self> {
        if !range.start.is_multiple_of(PART) || range.is_empty() || range.end > self.len {
            return Err(self.no_part(&range));
        }
        Ok(Self { first: self.first + range.start, len: range.len(), ..self.clone() })
    }

    /// Makes a [`Location::Device`] buffer that holds `values`. An empty slice becomes a single zero, so that absent data can
    /// be bound like any other. Where host and device share one memory it waits for no work that runs.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_slice(gpu: &Gpu, name: &str, values: &[T]) -> Result<Self> {
        Self::new(gpu, name, values.len(), Location::Device)?.holding(values)
    }

    fn holding(self, values: &[T]) -> Result<Self> {
        let zero = [T::zeroed()];
        self.write(0, if values.is_empty() { &zero } else { values })?;
        Ok(self)
    }

    /// As [`Self::from_slice`], for data that kernels read as texels: the device's limit is checked before the upload.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_texels(gpu: &Gpu, name: &str, values: &[T]) -> Result<Self> {
        Self::for_texels(gpu, name, values.len(), texel_bytes(size_of::<T>()))?.holding(values)
    }

    /// As [`Self::from_texels`], for kernels that read 16 bytes at a time whatever the size of an element: a view holds more so.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_wide_texels(gpu: &Gpu, name: &str, values: &[T]) -> Result<Self> {
        Self::for_texels(gpu, name, values.len(), 16)?.holding(values)
    }

    /// Makes a [`Location::Device`] buffer of `len` elements with undefined contents, with this one's name and as wide texels.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn larger(&self, len: usize) -> Result<Self> {
        let Untyped { gpu, name, texel, .. } = &*self.untyped;
        Self::for_texels(gpu, name, len, *texel)
    }

    fn for_texels(gpu: &Gpu, name: &str, len: usize, texel: u64) -> Result<Self> {
        check_texels(name, len.saturating_mul(size_of::<T>()) as u64, texel, gpu.0.info.max_texel_elements)?;
        Self::with_texels(gpu, name, len, Location::Device, texel)
    }

    /// Number of elements, at least 1.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Waits for the work on this buffer that [`Gpu::run`] submitted, then replaces the elements from `offset` on. For work recorded
    /// with [`super::Recorder::external`], see its safety section.
    ///
    /// # Errors
    /// [`Error::Usage`] when they do not fit, [`Error::Device`] when the copy fails.
    pub fn write(&self, offset: usize, values: &[T]) -> Result<()> {
        self.untyped.write(self.place(offset, values.len())?, bytemuck::cast_slice(values))
    }

    /// Bytes from the start of the memory to so many elements from `offset` on, where they fit.
    fn place(&self, offset: usize, count: usize) -> Result<usize> {
        if offset.checked_add(count).is_none_or(|end| end > self.len) {
            let (name, len) = (&self.untyped.name, self.len);
            return Err(Error::Usage(format!("buffer \"{name}\": {count} elements at {offset} exceed its {len}")));
        }
        Ok((self.first + offset) * size_of::<T>())
    }

    /// Waits for the work on this buffer that [`Gpu::run`] submitted, then returns all elements. For work recorded with
    /// [`super::Recorder::external`], see its safety section.
    ///
    /// # Errors
    /// [`Error::Device`] when the copy fails.
    pub fn read(&self) -> Result<Vec<T>> {
        self.read_range(0..self.len)
    }

    /// Returns the elements in `range`; otherwise as [`Self::read`].
    ///
    /// # Errors
    /// [`Error::Usage`] when the range exceeds the buffer, [`Error::Device`] when the copy fails.
    pub fn read_range(&self, range: Range<usize>) -> Result<Vec<T>> {
        if range.start > range.end || range.end > self.len {
            return Err(self.no_part(&range));
        }
        let mut values = vec![T::zeroed(); range.len()];
        self.untyped.read((self.first + range.start) * size_of::<T>(), bytemuck::cast_slice_mut(&mut values))?;
        Ok(values)
    }

    /// Whether [`Self::read`] takes no submission. This waits for no work that runs.
    pub(crate) fn is_read_in_place(&self) -> bool {
        mapped(&mut self.untyped.lock(), self.untyped.for_reading()).is_some()
    }

    fn no_part(&self, range: &Range<usize>) -> Error {
        let (name, len) = (&self.untyped.name, self.len);
        Error::Usage(format!("buffer \"{name}\": {range:?} is no part of its {len} elements"))
    }

    /// The Vulkan buffer behind this one. It lives as long as this handle or a clone of it.
    pub fn raw(&self) -> RawBuffer {
        let Bound { buffer, offset, size } = self.bound();
        RawBuffer { handle: buffer.raw.as_raw(), offset, size }
    }
}

impl<T> Buffer<T> {
    /// The range to bind. It is public only for generated code.
    #[doc(hidden)]
    pub fn bound(&self) -> Bound<'_> {
        let bytes = |elements: usize| elements as u64 * self.untyped.stride;
        Bound { buffer: &self.untyped, offset: bytes(self.first), size: bytes(self.len) }
    }
}

impl Bound<'_> {
    /// # Errors
    /// When it is larger than one storage binding may be.
    pub(super) fn storage(&self) -> Result<vk::DescriptorBufferInfo> {
        let (Untyped { name, raw, .. }, limit) = (&**self.buffer, self.buffer.gpu.0.info.max_storage_range);
        if self.size > limit {
            return Err(too_big(name, self.size, "bytes", limit, "of one storage binding"));
        }
        Ok(vk::DescriptorBufferInfo::default().buffer(*raw).offset(self.offset).range(self.size))
    }

    /// The first element. By the contract of `Bindings` its size is within every device's limit.
    pub(super) fn uniform(&self) -> vk::DescriptorBufferInfo {
        let range = self.buffer.stride;
        vk::DescriptorBufferInfo::default().buffer(self.buffer.raw).offset(self.offset).range(range)
    }

    /// Bytes that a kernel is shown: of a uniform block the first element, else all.
    pub(super) fn bytes(&self, uniform: bool) -> u64 {
        if uniform { self.buffer.stride } else { self.size }
    }

    /// Returns a view of its texels. A view is made once and then kept.
    ///
    /// # Errors
    /// When the buffer has more texels than one view may have, or this is only a part of it.
    pub(super) fn texels(&self, floats: bool) -> Result<vk::BufferView> {
        let whole = &**self.buffer;
        if self.offset > 0 || self.size.next_multiple_of(whole.texel) < whole.size {
            return Err(Error::Usage(format!("buffer \"{}\": a part of it cannot be read as texels", whole.name)));
        }
        let format = match (floats, whole.texel) {
            (true, 16) => vk::Format::R32G32B32A32_SFLOAT,
            (true, 8) => vk::Format::R32G32_SFLOAT,
            (true, _) => vk::Format::R32_SFLOAT,
            (false, 16) => vk::Format::R32G32B32A32_UINT,
            (false, 8) => vk::Format::R32G32_UINT,
            (false, _) => vk::Format::R32_UINT,
        };
        check_texels(&whole.name, whole.size, whole.texel, whole.gpu.0.info.max_texel_elements)?;
        let mut views = whole.views.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, view)) = views.iter().find(|(made, _)| *made == format) {
            return Ok(*view);
        }
        let shown = whole.shown.min(whole.gpu.0.info.max_texel_elements * whole.texel);
        let info = vk::BufferViewCreateInfo::default().buffer(whole.raw).format(format).range(shown);
        // SAFETY: a live buffer with texel usage; every device supports these formats for it.
        let view = unsafe { whole.gpu.0.device.create_buffer_view(&info, None) }.at(&whole.name)?;
        views.push((format, view));
        Ok(view)
    }
}

impl Untyped {
    pub(super) fn new(gpu: &Gpu, name: &str, size: u64, [stride, texel]: [u64; 2], location: Location) -> Result<Self> {
        let limit = gpu.0.info.max_buffer_size.min(gpu.0.info.max_allocation);
        if size > limit {
            return Err(too_big(name, size, "bytes", limit, "of one buffer"));
        }
        let [shown, made] = shown_and_made(size, limit, gpu.0.info.kind);
        let info = vk::BufferCreateInfo::default().size(made).usage(usage(gpu, location));
        let what = format!("buffer \"{name}\" of {size} bytes");
        // SAFETY: `info` is complete; the device outlives every buffer.
        let raw = unsafe { gpu.0.device.create_buffer(&info, None) }.at(&what)?;
        gpu.0.name(raw, name);
        let (memory, turns, views) = Default::default();
        // From here on, Drop cleans up if a line below fails.
        let (name, gpu) = (name.to_owned(), gpu.clone());
        let buffer = Self { gpu, name, raw, size, shown, location, stride, texel, memory, turns, views };
        buffer.allocate(location, &what)?;
        if let Some(bytes) = buffer.idle().mapped(vk::MemoryPropertyFlags::empty()) {
            bytes[size as usize..shown as usize].fill(0);
        }
        Ok(buffer)
    }

    fn allocate(&self, location: Location, what: &str) -> Result<()> {
        let device = &self.gpu.0.device;
        // SAFETY: a live buffer of this device.
        let requirements = unsafe { device.get_buffer_memory_requirements(self.raw) };
        let location = match location {
            // There is only one memory: ask for it mapped.
            Location::Device if self.gpu.0.info.unified => MemoryLocation::CpuToGpu,
            Location::Device => MemoryLocation::GpuOnly,
            Location::Upload => MemoryLocation::CpuToGpu,
            Location::Readback => MemoryLocation::GpuToCpu,
        };
        let mut allocator = self.gpu.0.lock_allocator();
        let closing = || Error::Device(format!("{what}: the device is closing"));
        let allocator = allocator.as_mut().ok_or_else(closing)?;
        let (name, linear) = (self.name.as_str(), true);
        let mut allocate = |allocation_scheme| {
            allocator.allocate(&AllocationCreateDesc { name, requirements, location, linear, allocation_scheme })
        };
        let allocated = allocate(AllocationScheme::GpuAllocatorManaged).or_else(|error| match error {
            // Where there is no room for one more block, there may be for the buffer alone.
            AllocationError::OutOfMemory => allocate(AllocationScheme::DedicatedBuffer(self.raw)),
            other => Err(other),
        });
        let memory = allocated.map_err(|error| match error {
            AllocationError::OutOfMemory => explain(what, vk::Result::ERROR_OUT_OF_DEVICE_MEMORY),
            other => Error::Device(format!("{what}: {other}: {LESS_MEMORY}")),
        })?;
        // SAFETY: fresh memory that fits the requirements, kept until the buffer is destroyed.
        let bound = unsafe { device.bind_buffer_memory(self.raw, memory.memory(), memory.offset()) };
        *self.lock() = Some(memory);
        bound.at(what)
    }

    fn lock(&self) -> MutexGuard<'_, Option<Allocation>> {
        self.memory.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until no submission uses it. None that does begins until what is returned is dropped; meanwhile this thread may neither
    /// submit nor ask this of another buffer.
    pub(super) fn idle(&self) -> Idle<'_> {
        let host = self.turns.host();
        Idle { memory: self.lock(), _host: host }
    }

    /// What its memory must be for the host to read it where it lies. Integrated GPUs can map uncached memory, which is fast to write but
    /// slow to read; a copy of a buffer for reading would lie in memory of the same kind.
    pub(super) fn for_reading(&self) -> vk::MemoryPropertyFlags {
        match self.location {
            Location::Readback => vk::MemoryPropertyFlags::empty(),
            Location::Device | Location::Upload => vk::MemoryPropertyFlags::HOST_CACHED,
        }
    }
}

/// The mapped bytes of `memory`; `None` if it is not mapped, not coherent, or lacks a property in `also`.
fn mapped(memory: &mut Option<Allocation>, also: vk::MemoryPropertyFlags) -> Option<&mut [u8]> {
    let memory = memory.as_mut()?;
    let fits = memory.memory_properties().contains(vk::MemoryPropertyFlags::HOST_COHERENT | also);
    memory.mapped_slice_mut().filter(|_| fits)
}

/// The memory of a buffer that no submission uses. The lock is given back before others are let in, who would wait for it.
pub(super) struct Idle<'a> {
    memory: MutexGuard<'a, Option<Allocation>>,
    _host: Host<'a>,
}

impl Idle<'_> {
    /// As [`mapped`].
    pub fn mapped(&mut self, also: vk::MemoryPropertyFlags) -> Option<&mut [u8]> {
        mapped(&mut self.memory, also)
    }
}

impl Drop for Untyped {
    fn drop(&mut self) {
        let views = std::mem::take(self.views.get_mut().unwrap_or_else(PoisonError::into_inner));
        let memory = self.memory.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        self.gpu.0.free(|device| {
            // SAFETY: not in use, since whoever records a buffer keeps it until the work is complete; destroyed once.
            unsafe {
                views.iter().for_each(|(_, view)| device.destroy_buffer_view(*view, None));
                device.destroy_buffer(self.raw, None);
            }
            if let (Some(memory), Some(allocator)) = (memory, self.gpu.0.lock_allocator().as_mut()) {
                // Freeing fails only for memory of another allocator.
                let _ = allocator.free(memory);
            }
        });
    }
}

/// Bytes that views of a buffer of `size` bytes show, and bytes that it is made with, both at most `limit`. On a CPU they are more than
/// `size`, so that buffers of all sizes are alike to llvmpipe. That of Mesa 22.3, but not of 25.0, compiles a kernel anew for other
/// values of two bits of each buffer that the kernel reads by texels, though they mean something for pictures alone: whether the
/// size of the buffer is a power of two, and whether bits 8 to 15 of the view's are 0, where pictures have their number of levels.
fn shown_and_made(size: u64, limit: u64, kind: DeviceKind) -> [u64; 2] {
    if kind != DeviceKind::Cpu {
        return [size; 2];
    }
    let shown = if size >> 8 & 0xff == 0 { size + 256 } else { size }.min(limit);
    let made = if shown.is_power_of_two() { shown + 16 } else { shown }.min(limit);
    [shown, made]
}

/// All that kernels and copies may do with a buffer. Where rays are traced by ray queries, those in device memory may also be what
/// acceleration structures are built of and lie in.
fn usage(gpu: &Gpu, location: Location) -> vk::BufferUsageFlags {
    use vk::BufferUsageFlags as Usage;
    let usual = Usage::STORAGE_BUFFER
        | Usage::UNIFORM_TEXEL_BUFFER
        | Usage::UNIFORM_BUFFER
        | Usage::TRANSFER_SRC
        | Usage::TRANSFER_DST;
    let built = Usage::SHADER_DEVICE_ADDRESS
        | Usage::ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_KHR
        | Usage::ACCELERATION_STRUCTURE_STORAGE_KHR;
    match location {
        Location::Device if gpu.traces_by_ray_query() => usual | built,
        _ => usual,
    }
}

/// Bytes per texel in a view of elements of `stride` bytes: the widest texels that elements are whole numbers of.
fn texel_bytes(stride: usize) -> u64 {
    match stride {
        n if n.is_multiple_of(16) => 16,
        n if n.is_multiple_of(8) => 8,
        _ => 4,
    }
}

fn check_texels(name: &str, size: u64, texel: u64, limit: u64) -> Result<()> {
    match size / texel {
        texels if texels > limit => Err(too_big(name, texels, "texels", limit, "of one texel buffer")),
        _ => Ok(()),
    }
}

fn too_big(name: &str, size: u64, unit: &str, limit: u64, of: &str) -> Error {
    Error::Device(format!(
        "buffer \"{name}\" has {size} {unit}, over the device's limit {of}, {limit}: choose a smaller film or scene, or \
         another device"
    ))
}

#[cfg(test)]
mod tests {
    use super::{check_texels, shown_and_made, texel_bytes};
    use crate::gpu::DeviceKind;

    #[test]
    fn buffers_of_all_sizes_are_alike_to_llvmpipe() {
        for size in [4, 16, 240, 256, 260, 512, 1 << 16, (1 << 16) + 128, 640 * 360 * 16, 1 << 22] {
            let [shown, made] = shown_and_made(size, 1 << 30, DeviceKind::Cpu);
            assert!(size <= shown && shown <= made && made <= size + 272, "{size}: {shown}, {made}");
            assert!(shown >> 8 & 0xff != 0 && !made.is_power_of_two(), "{size}: {shown}, {made}");
            assert!((shown - size).is_multiple_of(16), "whole texels");
            assert_eq!(shown_and_made(size, 1 << 30, DeviceKind::DiscreteGpu), [size; 2]);
        }
        assert_eq!(shown_and_made(1 << 20, 1 << 20, DeviceKind::Cpu), [1 << 20; 2], "the largest");
    }

    #[test]
    fn texels_are_as_wide_as_elements_allow() {
        // Elements of 48, 24 and 12 bytes are read 16, 8 and 4 at a time.
        for (stride, texels) in [(48, 6), (24, 12), (12, 24)] {
            let texel = texel_bytes(stride);
            assert!(check_texels("a", 96, texel, texels).is_ok());
            let line = check_texels("a", 96, texel, texels - 1).unwrap_err().to_string();
            assert!(line.contains(&format!("{texels} texels")) && line.contains("choose"), "{line}");
        }
    }
}
