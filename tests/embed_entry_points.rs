//! What the renderer asks of an engine's device, seen at Vulkan's entry points.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
#[path = "support/hooks.rs"]
mod hooks;
mod support;

use ash::vk::Handle;
use std::path::Path;
use std::sync::atomic::Ordering::SeqCst;
use support::engine::Engine;
use tallow::composition::Demodulation;
use tallow::denoiser::Denoiser;
use tallow::error::Error;
use tallow::filter::{self, FilterSettings};
use tallow::gpu::{FrameResources, Gpu, Recorder};
use tallow::renderer::{Outputs, Renderer, Step};
use tallow::scene::Scene;
use tallow::settings::Settings;

/// Counts are asked for, so that every kind of pass takes part.
fn scene() -> Scene {
    let small = |s: &mut Settings| {
        (s.width, s.height, s.spp) = (33, 17, 4);
        s.allocate.policy = "both".into();
    };
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml"), &small).unwrap()
}

#[test]
fn nothing_is_created_after_the_first_frame() {
    let engine = Engine::new();
    let raw = hooks::between(engine.raw());
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(raw) }.unwrap();
    let scene = scene();
    let outputs = Outputs { split_light: true, guides: true, counters: true };
    let renderer = Renderer::new(&gpu, &scene, outputs).unwrap();
    let (row, settings) = (filter::find("auto").unwrap(), FilterSettings::default());
    let denoiser = Denoiser::new(&gpu, &renderer, row, &settings, Demodulation::Light).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let made = hooks::take_calls();
    for name in ["vkCreateBuffer", "vkAllocateMemory", "vkCreateComputePipelines"] {
        assert!(made.contains_key(name), "control: {name} is seen when the renderer is made: {made:?}");
    }
    for number in 0..3 {
        engine.run(|commands| {
            // SAFETY: recording, on this device.
            let mut rec = unsafe { Recorder::external(&gpu, &mut frame, commands.as_raw()) }.unwrap();
            renderer.steps().for_each(|step| renderer.record(&mut rec, &step).unwrap());
            denoiser.record(&mut rec).unwrap();
        });
        assert!(frame.times().is_ok());
        let calls = hooks::take_calls();
        assert!(number == 0 || calls.is_empty(), "frame {number}: {calls:?}");
    }
}

#[test]
fn a_lost_device_is_one_line_and_exit_code_4() {
    let engine = Engine::new();
    let raw = hooks::between(engine.raw());
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(raw) }.unwrap();
    let renderer = Renderer::new(&gpu, &scene(), Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    hooks::LOSE.store(true, SeqCst);
    let lost = renderer.run(&mut frame, &Step::Start).map(drop);
    hooks::LOSE.store(false, SeqCst);
    let error = lost.unwrap_err();
    assert!(matches!(error, Error::DeviceLost(_)) && error.exit_code() == 4);
    let line = error.to_string();
    assert!(line.contains("the device was lost") && line.contains("run again") && !line.contains('\n'), "{line}");
    assert!(renderer.run(&mut frame, &Step::Start).is_ok(), "control: nothing fails without the hook");
}
