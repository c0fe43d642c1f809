//! A compiled compute pipeline, and the interface that generated code gives every kernel: bindings, push constants and
//! specialisation constants.
use super::access::Access;
use super::pipelines::{Pipeline, Recipe};
use super::{Acceleration, Bound, Gpu};
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::marker::PhantomData;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How a kernel sees a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotKind {
    /// Storage buffer, bound as a whole or in part.
    Storage,
    /// Texel buffer of unsigned integers (`usamplerBuffer`).
    UintTexels,
    /// Texel buffer of floats (`samplerBuffer`).
    FloatTexels,
    /// Uniform block, which holds the first element of the buffer.
    Uniform,
}

impl SlotKind {
    pub(super) fn descriptor(self) -> vk::DescriptorType {
        match self {
            Self::Storage => vk::DescriptorType::STORAGE_BUFFER,
            Self::UintTexels | Self::FloatTexels => vk::DescriptorType::UNIFORM_TEXEL_BUFFER,
            Self::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
        }
    }
}

/// One binding of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Its name in the GLSL source.
    pub name: &'static str,
    /// Binding number in set 0.
    pub binding: u32,
    /// How the kernel sees the buffer.
    pub kind: SlotKind,
    /// How the kernel accesses the buffer.
    pub access: Access,
}

/// The interface of a kernel. The build script implements it for the `Bind` struct of every kernel.
///
/// # Safety
/// - [`Self::SPIRV`] is valid code for Vulkan 1.3 and the features in [`super::REQUIRED_FEATURES`], with an entry point `main` for
///   compute; its subgroups shuffle only where a specialisation constant asks for it. [`Self::SLOTS`] are its descriptors, all
///   in set 0, with numbers that differ. [`Self::RAY_QUERY`] is the same with VK_KHR_ray_query, and has an acceleration structure as
///   one more descriptor.
/// - [`Self::Push`] is its push constants: at most 128 bytes, a multiple of 4. Elements of [`SlotKind::Uniform`] have at most
///   16384 bytes.
/// - [`Self::buffers`] returns one buffer per slot.
/// - Whatever buffers, push constants and specialisation constants the owner of the type lets others choose, the kernel
///   accesses nothing but its buffers. Accesses beyond their ends are allowed on devices with robust buffer access; those
///   beyond the ends of its own arrays are not.
///
/// Safe code cannot implement it:
/// ```compile_fail,E0200
/// # use tallow::gpu::{Bindings, Bound, Slot};
/// struct Mine;
/// impl Bindings for Mine {
///     type Push = u32;
///     type Constants = ();
///     const NAME: &'static str = "mine";
///     const SPIRV: &'static [u8] = &[0; 64];
///     const SLOTS: &'static [Slot] = &[];
///     fn buffers(&self) -> Vec<Bound<'_>> {
///         Vec::new()
///     }
/// }
/// ```
/// Unsafe code that guarantees the above can:
/// ```
/// # use tallow::gpu::{Bindings, Bound, Slot};
/// struct Mine;
/// unsafe impl Bindings for Mine {
///     type Push = u32;
///     type Constants = ();
///     const NAME: &'static str = "mine";
///     const SPIRV: &'static [u8] = &[0; 64];
///     const SLOTS: &'static [Slot] = &[];
///     fn buffers(&self) -> Vec<Bound<'_>> {
///         Vec::new()
///     }
/// }
/// ```
pub unsafe trait Bindings {
    /// The push constants, at most 128 bytes.
    type Push: Pod;
    /// The specialisation constants, fixed when the kernel is compiled.
    type Constants: Specialise;
    /// Basename of the GLSL file, which is also the label of the pass.
    const NAME: &'static str;
    /// The compiled code of the kernel.
    const SPIRV: &'static [u8];
    /// The code for devices that trace by ray queries; none for a kernel that traces no rays.
    const RAY_QUERY: Option<RayQueryCode> = None;
    /// The slots, in the order of the fields of the `Bind` struct.
    const SLOTS: &'static [Slot];
    /// The buffers to bind, one for each of [`Self::SLOTS`].
    fn buffers(&self) -> Vec<Bound<'_>>;
    /// What the code of [`Self::RAY_QUERY`] traces rays through.
    fn acceleration(&self) -> Option<&Acceleration> {
        None
    }
}

/// The form of a kernel that traces by ray queries.
#[derive(Clone, Copy, Debug)]
pub struct RayQueryCode {
    /// The compiled code.
    pub spirv: &'static [u8],
    /// Number of its binding of an acceleration structure.
    pub binding: u32,
}

/// Specialisation constants. The build script implements it for the `Constants` struct of every kernel.
pub trait Specialise {
    /// All constants as (constant id, value).
    fn entries(&self) -> Vec<(u32, u32)>;
    /// Number of threads in a workgroup along x and y.
    fn local_size(&self) -> [u32; 2];
}

/// A kernel without constants has workgroups of one thread.
impl Specialise for () {
    fn entries(&self) -> Vec<(u32, u32)> {
        Vec::new()
    }

    fn local_size(&self) -> [u32; 2] {
        [1, 1]
    }
}

/// Number of workgroups along one axis that every Vulkan device supports.
pub const MAX_GROUPS: u32 = 65_535;

/// A compiled kernel, specialised by its constants. `B` is the kernel's `Bind` struct.
pub struct Kernel<B> {
    pub(super) compiled: Box<Compiled>,
    /// Covariant, so that a kernel kept as `Kernel<Bind<'static>>` takes shorter borrows.
    of: PhantomData<fn() -> B>,
}

/// A kernel of any type, so that what makes and records kernels is compiled once and not for each.
pub(super) struct Compiled {
    pub name: &'static str,
    pub slots: &'static [Slot],
    pub gpu: Gpu,
    pub pipeline: Arc<Pipeline>,
    pub spirv: &'static [u8],
    pub constants: Arc<[(u32, u32)]>,
    compile_time: Duration,
    pub local_size: [u32; 2],
    /// The binding of what rays are traced through, if they are traced by ray queries.
    pub world: Option<u32>,
}

/// The parts of [`Bindings`] that are no types.
struct Interface {
    name: &'static str,
    spirv: &'static [u8],
    ray_query: Option<RayQueryCode>,
    slots: &'static [Slot],
    push_bytes: usize,
}

impl Compiled {
    fn new(gpu: &Gpu, interface: &Interface, constants: Vec<(u32, u32)>, local_size: [u32; 2]) -> Result<Self> {
        let begun = Instant::now();
        let &Interface { name, slots, push_bytes, .. } = interface;
        check_workgroup(name, local_size, &gpu.0.limits)?;
        check_slots(name, slots, &gpu.0.limits)?;
        let ray_query = interface.ray_query.filter(|_| gpu.traces_by_ray_query());
        let (spirv, world) = ray_query.map_or((interface.spirv, None), |code| (code.spirv, Some(code.binding)));
        let constants: Arc<[_]> = constants.into();
        let traced = world.map(|binding| (binding, vk::DescriptorType::ACCELERATION_STRUCTURE_KHR));
        let bindings = slots.iter().map(|slot| (slot.binding, slot.kind.descriptor())).chain(traced).collect();
        let recipe = Recipe { spirv, bindings, push_bytes: push_bytes as u32, constants: constants.clone() };
        let pipeline = pipeline(gpu, name, &recipe)?;
        let compile_time = begun.elapsed();
        Ok(Self { name, slots, gpu: gpu.clone(), pipeline, spirv, constants, compile_time, local_size, world })
    }
}

impl<B: Bindings> Kernel<B> {
    /// Compiles the kernel for these constants. The device keeps what was compiled: making the same kernel again takes no time, even
    /// when the first is dropped.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver refuses it, or its workgroups or its buffers exceed the device's limits.
    pub fn new(gpu: &Gpu, constants: &B::Constants) -> Result<Self> {
        let interface = Interface {
            name: B::NAME,
            spirv: B::SPIRV,
            ray_query: B::RAY_QUERY,
            slots: B::SLOTS,
            push_bytes: size_of::<B::Push>(),
        };
        let compiled = Compiled::new(gpu, &interface, constants.entries(), constants.local_size())?;
        Ok(Self { compiled: Box::new(compiled), of: PhantomData })
    }

    /// Time that creating the pipeline took. Some drivers, such as lavapipe, compile more on the first dispatch.
    pub fn compile_time(&self) -> Duration {
        self.compiled.compile_time
    }

    /// Number of workgroups that cover a grid of x times y threads.
    pub fn groups(&self, [x, y]: [u32; 2]) -> [u32; 3] {
        let [across, down] = self.compiled.local_size;
        [x.div_ceil(across), y.div_ceil(down), 1]
    }

    /// Number of workgroups that cover a row of threads. A row too long for the device is folded into several rows of groups,
    /// which `thread_index()` in `glsl/shared/thread.glsl` unfolds.
    pub fn folded_groups(&self, threads: u32) -> [u32; 3] {
        folded(threads.div_ceil(self.compiled.local_size[0]))
    }
}

/// Returns the pipeline of `recipe`, which is compiled if the device does not have it.
fn pipeline(gpu: &Gpu, name: &str, recipe: &Recipe) -> Result<Arc<Pipeline>> {
    let device = &*gpu.0;
    if let Some(found) = device.pipelines.find(recipe) {
        return Ok(found);
    }
    let mut pipeline = Pipeline::default();
    if let Err(error) = pipeline.create(&device.device, device.cache.raw, name, recipe) {
        // SAFETY: nobody else has it; null handles may be destroyed.
        device.free(|device| unsafe { pipeline.destroy(device) });
        return Err(error);
    }
    device.name(pipeline.raw, name);
    let (pipeline, idle) = device.pipelines.keep(recipe, pipeline);
    idle.into_iter().for_each(|idle| {
        // SAFETY: neither a kernel nor a frame has it.
        device.free(|device| unsafe { idle.destroy(device) });
    });
    Ok(pipeline)
}

fn folded(groups: u32) -> [u32; 3] {
    [groups.min(MAX_GROUPS), groups.div_ceil(MAX_GROUPS), 1]
}

fn check_workgroup(kernel: &str, [x, y]: [u32; 2], limits: &vk::PhysicalDeviceLimits) -> Result<()> {
    let [most_x, most_y, _] = limits.max_compute_work_group_size;
    let most = most_x.min(limits.max_compute_work_group_invocations);
    if (1..=most).contains(&x.saturating_mul(y)) && y <= most_y {
        return Ok(());
    }
    Err(Error::Device(format!("{kernel}: a workgroup of {x} x {y} threads: choose 1 to {most}, and {most_y} down")))
}

/// Vulkan promises room for 4 storage buffers, 16 texel buffers and 12 uniform blocks in a kernel, and some kernels need
/// more. Their shared memory stays within the 16 KiB that it promises.
fn check_slots(kernel: &str, slots: &[Slot], limits: &vk::PhysicalDeviceLimits) -> Result<()> {
    use vk::DescriptorType as Type;
    let kinds = [
        (Type::STORAGE_BUFFER, "StorageBuffers", limits.max_per_stage_descriptor_storage_buffers),
        (Type::UNIFORM_TEXEL_BUFFER, "SampledImages", limits.max_per_stage_descriptor_sampled_images),
        (Type::UNIFORM_BUFFER, "UniformBuffers", limits.max_per_stage_descriptor_uniform_buffers),
    ];
    for (kind, limit, most) in kinds {
        let count = slots.iter().filter(|slot| slot.kind.descriptor() == kind).count();
        if count > most as usize {
            return Err(Error::Device(format!(
                "{kernel}: it binds {count} buffers that count as maxPerStageDescriptor{limit}, of which this device \
                 has {most}: choose another device"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_kernel_that_a_device_has_no_room_for_is_refused_with_the_limit() {
        use crate::gpu::Bindings;
        use crate::shaders::{gather, path_shade};
        let least = ash::vk::PhysicalDeviceLimits {
            max_per_stage_descriptor_storage_buffers: 4,
            max_per_stage_descriptor_sampled_images: 12,
            max_per_stage_descriptor_uniform_buffers: 12,
            max_compute_work_group_size: [128, 4, 1],
            max_compute_work_group_invocations: 128,
            ..Default::default()
        };
        let why = super::check_slots("path_shade", path_shade::Bind::SLOTS, &least).unwrap_err().to_string();
        assert!(
            why.contains("path_shade: it binds 5") && why.contains("StorageBuffers, of which this device has 4"),
            "{why}"
        );
        let why = super::check_slots("gather", gather::Bind::SLOTS, &least).unwrap_err().to_string();
        assert!(
            why.contains("gather: it binds 13") && why.contains("SampledImages, of which this device has 12"),
            "{why}"
        );
        let more = ash::vk::PhysicalDeviceLimits { max_per_stage_descriptor_sampled_images: 13, ..least };
        super::check_slots("gather", gather::Bind::SLOTS, &more).unwrap();
        super::check_workgroup("auto_cells", [8, 4], &least).unwrap();
        super::check_workgroup("auto_cells", [8, 8], &least).unwrap_err();
    }

    #[test]
    fn large_dispatches_fold_into_rows() {
        assert_eq!(super::folded(2), [2, 1, 1]);
        assert_eq!(super::folded(65_535), [65_535, 1, 1]);
        assert_eq!(super::folded(65_536), [65_535, 2, 1]);
    }

    /// Whether code declares a capability, which takes two words: opcode 17 with its length, and the number.
    fn declares(spirv: &[u8], capability: u32) -> bool {
        let words: Vec<_> = spirv.chunks_exact(4).map(|w| u32::from_le_bytes([w[0], w[1], w[2], w[3]])).collect();
        words.windows(2).any(|pair| pair == [2 << 16 | 17, capability])
    }

    #[test]
    fn code_runs_where_subgroups_cannot_shuffle_unless_triangles_are_dealt() {
        use crate::layout::Effects;
        use crate::shaders::{path, shared::deal};
        const GROUP_NON_UNIFORM: u32 = 61;
        const SHUFFLE: u32 = 65;
        let code: Vec<u32> = bytemuck::pod_collect_to_vec(path::SPIRV);
        let [alone, dealt] = [0, 8].map(|lanes| {
            let deal = deal::Constants { lanes };
            let constants = path::Constants { effects: Effects::ALL, deal, ..Default::default() };
            let code = crate::spirv::specialise(&code, &constants.entries());
            bytemuck::cast_slice::<u32, u8>(&code).to_vec()
        });
        assert!(declares(&dealt, GROUP_NON_UNIFORM) && declares(&dealt, SHUFFLE));
        assert!(!declares(&alone, GROUP_NON_UNIFORM) && !declares(&alone, SHUFFLE));
        assert!(declares(&alone, 1), "control: every kernel declares Shader");
    }

    #[test]
    fn only_code_for_ray_queries_declares_them() {
        use crate::gpu::Bindings;
        use crate::shaders::{accumulate, path};
        const RAY_QUERY: u32 = 4472;
        let code = <path::Bind as Bindings>::RAY_QUERY.unwrap().spirv;
        assert!(declares(code, RAY_QUERY));
        assert!(!declares(path::SPIRV, RAY_QUERY));
        assert!(<accumulate::Bind as Bindings>::RAY_QUERY.is_none(), "it traces no rays");
    }
}
