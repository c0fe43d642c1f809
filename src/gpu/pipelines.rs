//! The compute pipelines of a device. Kernels with the same code and constants share one, also when the first is gone before the
//! next is made: a second renderer or filter compiles nothing, and drivers that compile on the first dispatch, such as lavapipe,
//! do so once.
use super::At;
use crate::error::{Error, Result};
use crate::spirv::specialise;
use ash::vk;
use std::sync::{Arc, Mutex, PoisonError};

/// Number of pipelines that are kept although no kernel uses them: enough for a renderer and its filter. On lavapipe under the
/// validation layers one of a path tracer takes some 11 MB.
const IDLE: usize = 48;

/// All that a pipeline depends on.
#[derive(Clone, PartialEq)]
pub(super) struct Recipe {
    pub spirv: &'static [u8],
    /// Descriptors of set 0 as (binding number, kind).
    pub bindings: Vec<(u32, vk::DescriptorType)>,
    pub push_bytes: u32,
    /// Specialisation constants as (constant id, value).
    pub constants: Arc<[(u32, u32)]>,
}

/// A pipeline and its layouts. The device's [`Pipelines`] destroy it.
#[derive(Default)]
pub(super) struct Pipeline {
    pub set_layout: vk::DescriptorSetLayout,
    pub layout: vk::PipelineLayout,
    pub raw: vk::Pipeline,
}

/// The pipelines of a device, those that were used last at the end.
#[derive(Default)]
pub(super) struct Pipelines(Mutex<Vec<(Recipe, Arc<Pipeline>)>>);

impl Pipelines {
    /// The pipeline of `recipe`, if there is one.
    pub fn find(&self, recipe: &Recipe) -> Option<Arc<Pipeline>> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let index = all.iter().position(|(made, _)| made == recipe)?;
        let found = all.remove(index);
        let pipeline = found.1.clone();
        all.push(found);
        Some(pipeline)
    }

    /// Adds a pipeline. Returns the one to use, which another thread may have made meanwhile, and those that nobody does, beyond
    /// [`IDLE`], for the caller to destroy.
    pub fn keep(&self, recipe: &Recipe, pipeline: Pipeline) -> (Arc<Pipeline>, Vec<Pipeline>) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, first)) = all.iter().find(|(made, _)| made == recipe) {
            return (first.clone(), vec![pipeline]);
        }
        let pipeline = Arc::new(pipeline);
        all.push((recipe.clone(), pipeline.clone()));
        // Nobody can take one meanwhile: it is found under this lock, and cloned only by those who have it.
        let mut excess = all.iter().filter(|(_, p)| Arc::strong_count(p) == 1).count().saturating_sub(IDLE);
        let idle = all.extract_if(.., |(_, pipeline)| {
            let goes = excess > 0 && Arc::strong_count(pipeline) == 1;
            excess -= usize::from(goes);
            goes
        });
        let idle = idle.filter_map(|(_, pipeline)| Arc::into_inner(pipeline)).collect();
        (pipeline, idle)
    }

    /// # Safety
    /// They were made on `device`, and none of them is in use or used again.
    pub unsafe fn destroy(&mut self, device: &ash::Device) {
        let all = self.0.get_mut().unwrap_or_else(PoisonError::into_inner);
        all.drain(..).for_each(|(_, pipeline)| unsafe { pipeline.destroy(device) });
    }
}

impl Pipeline {
    /// Compiles `recipe`. `name` is told in errors. On failure there may be parts, which are to be destroyed.
    ///
    /// # Errors
    /// [`Error::Device`] when the driver refuses it.
    pub fn create(
        &mut self,
        device: &ash::Device,
        cache: vk::PipelineCache,
        name: &str,
        recipe: &Recipe,
    ) -> Result<()> {
        self.create_layouts(device, recipe).at(name)?;
        self.compile(device, cache, name, recipe)
    }

    fn create_layouts(&mut self, device: &ash::Device, recipe: &Recipe) -> std::result::Result<(), vk::Result> {
        let binding = |&(number, kind): &(u32, vk::DescriptorType)| {
            vk::DescriptorSetLayoutBinding::default()
                .binding(number)
                .descriptor_type(kind)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE)
        };
        let bindings: Vec<_> = recipe.bindings.iter().map(binding).collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let stage_flags = vk::ShaderStageFlags::COMPUTE;
        let push = [vk::PushConstantRange { stage_flags, offset: 0, size: recipe.push_bytes }];
        // SAFETY: complete infos; the build script checked that binding numbers differ and that the push fits.
        unsafe {
            self.set_layout = device.create_descriptor_set_layout(&info, None)?;
            let sets = [self.set_layout];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(&push);
            self.layout = device.create_pipeline_layout(&info, None)?;
        }
        Ok(())
    }

    fn compile(&mut self, device: &ash::Device, cache: vk::PipelineCache, name: &str, recipe: &Recipe) -> Result<()> {
        let words = ash::util::read_spv(&mut std::io::Cursor::new(recipe.spirv))
            .map_err(|e| Error::Device(format!("{name}: its code is damaged ({e}): build again")))?;
        let words = specialise(&words, &recipe.constants);
        // SAFETY: the code was compiled for Vulkan 1.3 by the build script; the module is needed only for this call.
        unsafe {
            let module =
                device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&words), None).at(name)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(c"main");
            let info = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout)];
            let made = device.create_compute_pipelines(cache, &info, None);
            device.destroy_shader_module(module, None);
            self.raw = made.map_err(|(_, code)| code).at(name)?[0];
        }
        Ok(())
    }

    /// # Safety
    /// It was made on `device` and is not in use.
    pub unsafe fn destroy(&self, device: &ash::Device) {
        unsafe {
            device.destroy_pipeline(self.raw, None);
            device.destroy_pipeline_layout(self.layout, None);
            device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ash::vk::Handle;

    fn recipe(value: u32) -> Recipe {
        Recipe { spirv: &[1, 2], bindings: Vec::new(), push_bytes: 4, constants: [(7, value)].into() }
    }

    fn made(number: u64) -> Pipeline {
        Pipeline { raw: vk::Pipeline::from_raw(number), ..Pipeline::default() }
    }

    /// Numbers of those that go when number `n` is kept as recipe `n`.
    fn gone(all: &Pipelines, n: u32) -> Vec<u64> {
        all.keep(&recipe(n), made(n.into())).1.iter().map(|pipeline| pipeline.raw.as_raw()).collect()
    }

    #[test]
    fn a_pipeline_is_found_by_all_that_it_depends_on() {
        let all = Pipelines::default();
        assert!(all.keep(&recipe(5), made(9)).1.is_empty());
        assert_eq!(all.find(&recipe(5)).unwrap().raw.as_raw(), 9);
        let others = [
            recipe(6),
            Recipe { spirv: &[1, 3], ..recipe(5) },
            Recipe { push_bytes: 8, ..recipe(5) },
            Recipe { bindings: vec![(0, vk::DescriptorType::STORAGE_BUFFER)], ..recipe(5) },
            Recipe { constants: [].into(), ..recipe(5) },
        ];
        assert!(others.iter().all(|other| all.find(other).is_none()));
    }

    #[test]
    fn those_that_idle_longest_go_and_used_ones_stay() {
        let all = Pipelines::default();
        let _used = all.keep(&recipe(0), made(0));
        assert!((1..=IDLE as u32).all(|n| gone(&all, n).is_empty()));
        // The one that is added has an owner, and the first has just been used: the second goes.
        all.find(&recipe(1)).unwrap();
        assert_eq!([1, 2].map(|n| gone(&all, IDLE as u32 + n)), [vec![], vec![2]]);
        assert!([0, 1, 3].iter().all(|&n| all.find(&recipe(n)).is_some()));
        assert!(all.find(&recipe(2)).is_none());
    }

    #[test]
    fn threads_that_make_the_same_use_one() {
        let all = Pipelines::default();
        let (first, none) = all.keep(&recipe(5), made(1));
        let (second, gone) = all.keep(&recipe(5), made(2));
        assert!(none.is_empty() && Arc::ptr_eq(&first, &second));
        assert_eq!(gone[0].raw.as_raw(), 2);
    }
}
