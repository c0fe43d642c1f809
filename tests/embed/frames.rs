//! The renderer inside an engine: on the engine's device, into the engine's command buffer, with the bits that the
//! command line writes.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
use crate::support::engine::Engine;
use crate::support::largest;
use ash::vk;
use ash::vk::Handle;
use bytemuck::Pod;
use std::path::Path;
use std::process::Command;
use std::time::Duration;
use tallow::denoise::filter::{self, FilterSettings, firefly::Fireflies};
use tallow::denoise::{Demodulation, Denoiser, twin};
use tallow::gpu::{Buffer, FrameResources, Gpu, Location, PixelFormat, Recorder};
use tallow::image::aov::{Aovs, Names};
use tallow::image::{self, Film, Samples};
use tallow::layout::{Camera, Effects, vec3, vec4};
use tallow::plan::FramePacer;
use tallow::render::settings::Settings;
use tallow::render::{Job, Layer, OutputView, Outputs, Renderer, Step};
use tallow::scene::Scene;

/// Of films whose pixels an engine copies one by one: the validation layers remember every copy.
const SIZE: [u32; 2] = [17, 9];
const SPP: u32 = 4;

fn scene_file() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml")
}

/// One that decides nothing, one that apportions, and one whose lists are of a length that only the device knows.
const POLICIES: [&str; 3] = ["uniform", "both", "threshold"];

fn small(s: &mut Settings, [width, height]: [u32; 2], policy: &str) {
    (s.width, s.height, s.spp, s.max_depth) = (width, height, SPP, 4);
    s.allocate.policy = tallow::allocate::policy(policy).unwrap();
}

/// The film that the command line writes for the same settings.
fn command_line(size: [u32; 2], policy: &str) -> Film {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("box.exr");
    let [width, height, spp] = [size[0], size[1], SPP].map(|n| n.to_string());
    let mut command = Command::new(env!("CARGO_BIN_EXE_tallow"));
    command.arg("render").arg(scene_file()).arg("-o").arg(&file).arg("--quiet").args(["--max-depth", "4"]);
    command.args(["--width", &width, "--height", &height, "--spp", &spp, "--allocate", policy]);
    if let Ok(device) = std::env::var("TALLOW_DEVICE") {
        command.args(["--device", &device]);
    }
    assert!(command.status().unwrap().success());
    image::read(&file).unwrap()
}

/// The engine copies every pixel's values out of the strided result, in its own command buffer.
unsafe fn gather<T: Pod>(device: &ash::Device, commands: vk::CommandBuffer, from: OutputView, to: &Buffer<T>) {
    let size = size_of::<T>() as u64;
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
    let scene = Scene::load(&scene_file()).map(|scene| scene.with(|s| small(s, SIZE, policy))).unwrap();
    let outputs = Outputs::FILTERED;
    let mut renderer = Renderer::new(gpu, &scene, &scene.settings, outputs).unwrap();
    let mut frame = FrameResources::new(gpu).unwrap();
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let download = Buffer::<vec3>::new(gpu, "download", pixels, Location::Readback).unwrap();
    let mut record = |renderer: &Renderer| {
        engine.run(|commands| unsafe {
            let mut rec = Recorder::external(gpu, &mut frame, commands.as_raw()).unwrap();
            for step in renderer.steps() {
                renderer.record(&mut rec, &step).unwrap();
            }
            drop(rec);
            gather(&engine.device, commands, renderer.views(Layer::Radiance).unwrap()[0], &download);
        });
        download.read().unwrap()
    };
    let expected = command_line(SIZE, policy).picture(None).unwrap().pixels;
    for _ in 0..3 {
        assert!(record(&renderer) == expected, "{policy}: the engine's pixels are not those of the command line");
    }
    // Control: another camera must change the picture.
    let mut camera = scene.camera(scene.settings.size()).unwrap();
    camera.position[0] += 0.1;
    renderer.set_camera(camera).unwrap();
    assert!(record(&renderer) != expected, "{policy}: the comparison cannot fail");
    let lens = Camera { lens_radius: 0.1, ..camera };
    assert_eq!(renderer.set_camera(lens).unwrap_err().exit_code(), 2, "the kernels were compiled for a pinhole");
    let effects = Effects { lens: true, ..*renderer.effects() };
    Renderer::specialised(gpu, &scene, &scene.settings, outputs, effects).unwrap().set_camera(lens).unwrap();
}

/// The device's own times reach the pacer: it takes all samples where there is room, and one where there is none.
#[test]
fn an_engine_keeps_a_steady_frame_time() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let scene = Scene::load(&scene_file()).map(|scene| scene.with(|s| small(s, SIZE, "uniform"))).unwrap();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let mut chosen_within = |budget: Duration| {
        let (mut pacer, mut chosen) = (FramePacer::new(budget, 8), Vec::new());
        for _ in 0..4 {
            let samples = pacer.samples();
            engine.run(|commands| {
                // SAFETY: the engine's command buffer is in the recording state.
                let mut rec = unsafe { Recorder::external(&gpu, &mut frame, commands.as_raw()).unwrap() };
                renderer.record(&mut rec, &Step::Start).unwrap();
                renderer.samples(0, samples).for_each(|step| renderer.record(&mut rec, &step).unwrap());
            });
            pacer.observe_passes(samples, &frame.times().unwrap());
            chosen.push(samples);
            let counts = renderer.film().tiles[0].stats.read().unwrap();
            assert!(counts.iter().all(|s| s.count == samples), "every pixel has the frame's samples");
        }
        chosen
    };
    // Budgets that no device's times are near.
    assert_eq!(chosen_within(Duration::from_secs(3600)), [1, 8, 8, 8]);
    assert_eq!(chosen_within(Duration::from_nanos(1)), [1, 1, 1, 1]);
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// The layers of the command line's file, as the engine finds them.
#[test]
fn an_engine_gets_every_layer() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let scene = Scene::load(&scene_file()).map(|scene| scene.with(|s| small(s, SIZE, "uniform"))).unwrap();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let vectors = Buffer::<vec3>::new(&gpu, "vectors", pixels, Location::Readback).unwrap();
    let words = Buffer::<u32>::new(&gpu, "words", pixels, Location::Readback).unwrap();
    Job::new(&renderer).run_to_end(&mut frame).unwrap();
    let view = |layer| renderer.views(layer).unwrap()[0];
    let film = command_line(SIZE, "uniform");
    for (layer, name) in [
        (Layer::Radiance, None),
        (Layer::M2, Some("m2")),
        (Layer::Direct, Some("direct")),
        (Layer::Albedo, Some("albedo")),
        (Layer::Normal, Some("N")),
        (Layer::Position, Some("P")),
    ] {
        // SAFETY: the view is of a live buffer, the download of its length.
        engine.run(|commands| unsafe { gather(&engine.device, commands, view(layer), &vectors) });
        assert_eq!(view(layer).format, PixelFormat::R32G32B32Sfloat);
        assert!(vectors.read().unwrap() == film.picture(name).unwrap().pixels, "{layer:?}");
    }
    for (layer, name, format) in [
        (Layer::Samples, "samples", PixelFormat::R32Uint),
        (Layer::Depth, "Z", PixelFormat::R32Sfloat),
        (Layer::Object, "id", PixelFormat::R32Uint),
    ] {
        // SAFETY: as above.
        engine.run(|commands| unsafe { gather(&engine.device, commands, view(layer), &words) });
        assert_eq!(view(layer).format, format);
        let expected = match film.channel(name).unwrap() {
            Samples::U32(values) => values.clone(),
            Samples::F32(values) => values.iter().map(|v| v.to_bits()).collect(),
        };
        assert!(words.read().unwrap() == expected, "{layer:?}");
    }
    // Of one pixel, so that the size of a buffer does not tell whether a layer is kept.
    let one = Scene::load(&scene_file()).map(|scene| scene.with(|s| (s.width, s.height) = (1, 1))).unwrap();
    let plain = Renderer::new(&gpu, &one, &one.settings, Outputs::default()).unwrap();
    assert!(plain.views(Layer::Radiance).is_ok());
    for (layer, output) in [(Layer::Direct, "Outputs::split_light"), (Layer::Depth, "Outputs::guides")] {
        let error = plain.views(layer).unwrap_err();
        assert!(error.to_string().contains(output) && error.exit_code() == 2, "{error}");
    }
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// Steps and filter in one command buffer, against the command line's file taken apart, filtered and put together.
#[test]
fn an_engine_filters_its_frames_where_they_are() {
    let (engine, size) = (Engine::new(), [65, 33]); // a filter needs room
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let scene = Scene::load(&scene_file()).map(|scene| scene.with(|s| small(s, size, "uniform"))).unwrap();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let film = command_line(size, "uniform");
    let aovs = Aovs::find(&film, &Names::new()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let download = Buffer::<vec4>::new(&gpu, "download", film.pixels(), Location::Readback).unwrap();
    let settings = FilterSettings::default().with(|s| {
        s.edge.extent = 5.0;
        s.footprint.radius = 8;
    });
    for (name, demodulation) in [("guided", Demodulation::Light), ("auto", Demodulation::Albedo)] {
        let row = filter::find(name).unwrap();
        let denoiser = Denoiser::new(&gpu, &renderer, row, &settings, demodulation, Fireflies::Off).unwrap();
        for _ in 0..2 {
            engine.run(|commands| unsafe {
                let mut rec = Recorder::external(&gpu, &mut frame, commands.as_raw()).unwrap();
                renderer.steps().for_each(|step| renderer.record(&mut rec, &step).unwrap());
                denoiser.record(&mut rec).unwrap();
                drop(rec);
                gather(&engine.device, commands, denoiser.radiance(), &download);
            });
        }
        assert!(frame.times().unwrap().iter().any(|pass| pass.name == "demodulate"), "the filter's passes are timed");
        let parts = twin::split(&aovs, demodulation, name == "auto");
        let expected = parts.remodulate(&filter::run(&gpu, row, &parts.input, &settings).unwrap().0);
        let off = |(found, expected): (&vec4, &vec3)| {
            largest((0..3).map(|c| (found[c] - expected[c]).abs() / expected[c].abs().max(1e-2)))
        };
        let off = largest(download.read().unwrap().iter().zip(&expected).map(off));
        assert!(off < 1e-3, "{name}: {off}");
        let plain = film.picture(None).unwrap().pixels;
        let moved = expected.iter().zip(&plain).filter(|(a, b)| (a[0] - b[0]).abs() > 1e-2 * b[0].abs()).count();
        assert!(moved > plain.len() / 5, "control: {moved} of {} pixels are filtered", plain.len());
    }
    assert_eq!(engine.messages(), Vec::<String>::new());
}
