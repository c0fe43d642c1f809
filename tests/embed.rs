//! The renderer inside an engine: on the engine's device, into the engine's command buffer, with the bits that the
//! command line writes.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
mod support;

use ash::vk;
use ash::vk::Handle;
use std::path::Path;
use std::process::Command;
use support::engine::Engine;
use tallow::gpu::layout::{Camera, Effects, vec3};
use tallow::gpu::{Buffer, FrameResources, Gpu, Location, Recorder};
use tallow::image;
use tallow::renderer::{OutputView, Outputs, Renderer};
use tallow::scene::Scene;
use tallow::settings::Settings;

const WIDTH: u32 = 65;
const HEIGHT: u32 = 33;
const SPP: u32 = 4;

fn scene_file() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml")
}

/// One that decides nothing, one that apportions, and one whose lists are of a length that only the device knows.
const POLICIES: [&str; 3] = ["uniform", "both", "threshold"];

fn small(s: &mut Settings, policy: &str) {
    (s.width, s.height, s.spp, s.max_depth) = (WIDTH, HEIGHT, SPP, 4);
    s.allocate.policy = policy.to_owned();
}

/// The image that the command line writes for the same settings.
fn command_line(policy: &str) -> Vec<[f32; 3]> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("box.exr");
    let [width, height, spp] = [WIDTH, HEIGHT, SPP].map(|n| n.to_string());
    let mut command = Command::new(env!("CARGO_BIN_EXE_tallow"));
    command.arg("render").arg(scene_file()).arg("-o").arg(&file).arg("--quiet").args(["--max-depth", "4"]);
    command.args(["--width", &width, "--height", &height, "--spp", &spp, "--allocate", policy]);
    if let Ok(device) = std::env::var("TALLOW_DEVICE") {
        command.args(["--device", &device]);
    }
    assert!(command.status().unwrap().success());
    image::read(&file).unwrap().picture(None).unwrap().pixels
}

/// The engine copies every pixel's radiance out of the strided result, in its own command buffer.
unsafe fn gather(device: &ash::Device, commands: vk::CommandBuffer, from: OutputView, to: &Buffer<vec3>) {
    let size = 4 * u64::from(from.channels);
    let region = |i: usize| vk::BufferCopy {
        src_offset: from.buffer.offset + from.offset + i as u64 * u64::from(from.stride),
        dst_offset: to.raw().offset + i as u64 * size,
        size,
    };
    let regions: Vec<_> = (0..to.len()).map(region).collect();
    let (from, to) = (vk::Buffer::from_raw(from.buffer.handle), vk::Buffer::from_raw(to.raw().handle));
    unsafe { device.cmd_copy_buffer(commands, from, to, &regions) };
}

#[test]
fn an_engine_gets_the_bits_of_the_command_line_frame_after_frame() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    POLICIES.iter().for_each(|policy| agrees(&engine, &gpu, policy));
    assert_eq!(engine.messages(), Vec::<String>::new());
}

fn agrees(engine: &Engine, gpu: &Gpu, policy: &str) {
    let scene = Scene::load(&scene_file(), &|s| small(s, policy)).unwrap();
    let outputs = Outputs { split_light: true, guides: true, counters: false };
    let mut renderer = Renderer::new(gpu, &scene, outputs).unwrap();
    let mut frame = FrameResources::new(gpu).unwrap();
    let pixels = (WIDTH * HEIGHT) as usize;
    let download = Buffer::<vec3>::new(gpu, "download", pixels, Location::Readback).unwrap();
    let mut record = |renderer: &Renderer| {
        engine.run(|commands| unsafe {
            let mut rec = Recorder::external(gpu, &mut frame, commands.as_raw()).unwrap();
            for step in renderer.steps() {
                renderer.record(&mut rec, &step).unwrap();
            }
            drop(rec);
            gather(&engine.device, commands, renderer.radiance()[0], &download);
        });
        download.read().unwrap()
    };
    let expected = command_line(policy);
    for _ in 0..3 {
        assert!(record(&renderer) == expected, "{policy}: the engine's pixels are not those of the command line");
    }
    // Control: another camera must change the picture.
    let mut camera = scene.camera;
    camera.position[0] += 0.1;
    renderer.set_camera(camera).unwrap();
    assert!(record(&renderer) != expected, "{policy}: the comparison cannot fail");
    let lens = Camera { lens_radius: 0.1, ..camera };
    assert_eq!(renderer.set_camera(lens).unwrap_err().exit_code(), 2, "the kernels were compiled for a pinhole");
    let effects = Effects { lens: true, ..*renderer.effects() };
    Renderer::specialised(gpu, &scene, outputs, effects).unwrap().set_camera(lens).unwrap();
}
