//! The descriptor sets of one frame. Their pools are reset and reused by the next recording.
use super::pipelines::Pipeline;
use super::{At, Bound, Gpu, Slot, SlotKind};
use crate::error::Result;
use ash::vk;

/// Number of sets per pool, and average number of descriptors of each kind per set.
const SETS: u32 = 128;
const PER_SET: u32 = 8;

pub(super) struct Descriptors {
    gpu: Gpu,
    pools: Vec<vk::DescriptorPool>,
    /// Pools before this one are used up.
    current: usize,
}

/// The resource bound to a slot. The arrays have one element because Vulkan takes slices.
enum Resource {
    Buffer([vk::DescriptorBufferInfo; 1]),
    Texels([vk::BufferView; 1]),
}

impl Descriptors {
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), pools: Vec::new(), current: 0 }
    }

    /// Returns all sets to their pools. The work that used them must be complete.
    ///
    /// # Errors
    /// Those that the specification allows; no known driver fails here.
    pub fn reset(&mut self) -> Result<()> {
        let flags = vk::DescriptorPoolResetFlags::empty();
        for pool in &self.pools {
            // SAFETY: no set of it is in use.
            unsafe { self.gpu.0.device.reset_descriptor_pool(*pool, flags) }.at("descriptors")?;
        }
        self.current = 0;
        Ok(())
    }

    /// Allocates a descriptor set of `pipeline` and writes `buffers` into it, one for each of `slots`, and what rays are traced through
    /// into the binding beside it.
    ///
    /// # Errors
    /// When a buffer is too large to be bound in its slot, or memory is out.
    pub fn set(
        &mut self,
        pipeline: &Pipeline,
        slots: &[Slot],
        buffers: &[Bound],
        world: Option<(u32, vk::AccelerationStructureKHR)>,
    ) -> Result<vk::DescriptorSet> {
        let resource = |(slot, bound): (&Slot, &Bound)| {
            Ok(match slot.kind {
                SlotKind::Storage => Resource::Buffer([bound.storage()?]),
                SlotKind::Uniform => Resource::Buffer([bound.uniform()]),
                kind => Resource::Texels([bound.texels(kind == SlotKind::FloatTexels)?]),
            })
        };
        let resources = slots.iter().zip(buffers).map(resource).collect::<Result<Vec<_>>>()?;
        let set = self.allocate(pipeline.set_layout)?;
        let structures: Vec<_> = world.iter().map(|(_, structure)| *structure).collect();
        let mut traced = vk::WriteDescriptorSetAccelerationStructureKHR::default().acceleration_structures(&structures);
        let mut writes: Vec<_> = slots
            .iter()
            .zip(&resources)
            .map(|(slot, resource)| {
                let write = vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(slot.binding)
                    .descriptor_type(slot.kind.descriptor());
                match resource {
                    Resource::Buffer(info) => write.buffer_info(info),
                    Resource::Texels(view) => write.texel_buffer_view(view).descriptor_count(1),
                }
            })
            .collect();
        if let Some((binding, _)) = world {
            let write = vk::WriteDescriptorSet::default()
                .dst_set(set)
                .dst_binding(binding)
                .descriptor_type(vk::DescriptorType::ACCELERATION_STRUCTURE_KHR)
                .descriptor_count(1);
            writes.push(write.push_next(&mut traced));
        }
        // SAFETY: a fresh set; the buffers and the structure are kept by the frame that owns this.
        unsafe { self.gpu.0.device.update_descriptor_sets(&writes, &[]) };
        Ok(set)
    }

    fn allocate(&mut self, layout: vk::DescriptorSetLayout) -> Result<vk::DescriptorSet> {
        let layouts = [layout];
        loop {
            let fresh = self.current == self.pools.len();
            if fresh {
                self.pools.push(create_pool(&self.gpu)?);
            }
            let info = vk::DescriptorSetAllocateInfo::default()
                .descriptor_pool(self.pools[self.current])
                .set_layouts(&layouts);
            // SAFETY: a live pool of this thread and a live layout.
            match unsafe { self.gpu.0.device.allocate_descriptor_sets(&info) } {
                Ok(sets) => return Ok(sets[0]),
                Err(vk::Result::ERROR_OUT_OF_POOL_MEMORY | vk::Result::ERROR_FRAGMENTED_POOL) if !fresh => {
                    self.current += 1;
                }
                Err(code) => return Err(code).at("descriptors"),
            }
        }
    }
}

impl Drop for Descriptors {
    fn drop(&mut self) {
        // SAFETY: made on this device, not in use (the frame's contract), destroyed once.
        self.gpu.0.free(|device| {
            self.pools.iter().for_each(|pool| unsafe { device.destroy_descriptor_pool(*pool, None) });
        });
    }
}

fn create_pool(gpu: &Gpu) -> Result<vk::DescriptorPool> {
    let size = |ty| vk::DescriptorPoolSize { ty, descriptor_count: SETS * PER_SET };
    let structures = vk::DescriptorPoolSize {
        ty: vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
        descriptor_count: SETS, // one a set at most
    };
    let sizes = [
        size(vk::DescriptorType::STORAGE_BUFFER),
        size(vk::DescriptorType::UNIFORM_TEXEL_BUFFER),
        size(vk::DescriptorType::UNIFORM_BUFFER),
        structures,
    ];
    let sizes = if gpu.traces_by_ray_query() { &sizes[..] } else { &sizes[..3] };
    let info = vk::DescriptorPoolCreateInfo::default().max_sets(SETS).pool_sizes(sizes);
    // SAFETY: a complete info.
    unsafe { gpu.0.device.create_descriptor_pool(&info, None) }.at("descriptors")
}
