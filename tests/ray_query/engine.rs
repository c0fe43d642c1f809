//! An engine's own device traces by ray queries, where it was made for them.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
use crate::support::engine::Engine;
use crate::support::{render, stats};
use crate::{both, scenes};
use ash::vk::Handle;
use tallow::gpu::{FrameResources, Gpu, RawDevice, Recorder, Tracing};
use tallow::layout::PixelStats;
use tallow::render::{Outputs, Renderer};

fn bits(stats: &[PixelStats]) -> &[u32] {
    bytemuck::cast_slice(stats)
}

#[test]
fn an_engines_device_gives_the_bits_of_our_own() {
    let engine = Engine::tracing(Tracing::RayQuery);
    // SAFETY: the engine's handles are valid and outlive what is made from them, and its device has what ray queries take.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    assert!(gpu.traces_by_ray_query());
    let [_, own] = both();
    for (name, scene) in scenes() {
        let renderer = |gpu| Renderer::new(gpu, &scene, &scene.settings, Outputs::default()).unwrap();
        let (embedded, mut frame) = (renderer(&gpu), FrameResources::new(&gpu).unwrap());
        engine.run(|commands| {
            // SAFETY: the engine's command buffer is recording, and is waited for.
            let mut rec = unsafe { Recorder::external(&gpu, &mut frame, commands.as_raw()) }.unwrap();
            embedded.steps().for_each(|step| embedded.record(&mut rec, &step).unwrap());
        });
        assert!(bits(&stats(&embedded)) == bits(&render(&own, &renderer(&own))), "{name}");
    }
    assert_eq!(engine.messages(), Vec::<String>::new());
}

#[test]
fn a_device_that_was_made_without_it_is_refused() {
    let engine = Engine::new();
    // SAFETY: as above; what the device lacks is what the test is about, and nothing is made on it.
    let refused = unsafe { Gpu::from_raw(RawDevice { tracing: Tracing::RayQuery, ..engine.raw() }) }.err().unwrap();
    let refused = refused.to_string();
    for name in ["VK_KHR_ray_query", "VK_KHR_deferred_host_operations", "rayQuery", "bufferDeviceAddress"] {
        assert!(refused.contains(name), "{name}: {refused}");
    }
    // SAFETY: as above.
    assert!(!unsafe { Gpu::from_raw(engine.raw()) }.unwrap().traces_by_ray_query());
}
