//! An engine that moves instances, vertices, lights and materials on its own device, with three frames in flight: every frame has
//! the bits of a scene that was loaded in its pose.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
use crate::poses::{MOMENTS, Moment, at, pose};
use crate::support::engine::Engine;
use ash::vk::{self, Handle};
use tallow::gpu::{Buffer, FrameResources, Gpu, Location, Recorder};
use tallow::layout::{Effects, PixelStats};
use tallow::render::{Outputs, Renderer};
use tallow::scene::Change;

const OUTPUTS: Outputs = Outputs { split_light: false, guides: true, counters: false };

/// Copies the film's statistics in the engine's commands.
unsafe fn download(engine: &Engine, commands: vk::CommandBuffer, renderer: &Renderer, to: &Buffer<PixelStats>) {
    let (from, to) = (renderer.film().tiles[0].stats.raw(), to.raw());
    let region = [vk::BufferCopy { src_offset: from.offset, dst_offset: to.offset, size: to.size }];
    let [from, to] = [from.handle, to.handle].map(vk::Buffer::from_raw);
    unsafe { engine.device.cmd_copy_buffer(commands, from, to, &region) };
}

/// Records the update and all steps of a frame.
fn record(
    gpu: &Gpu,
    frame: &mut FrameResources,
    commands: vk::CommandBuffer,
    renderer: &mut Renderer,
    update: Option<(&tallow::scene::Scene, &Change)>,
) {
    // SAFETY: the command buffer is recording, and the frame's earlier work was waited for.
    let mut rec = unsafe { Recorder::external(gpu, frame, commands.as_raw()) }.unwrap();
    if let Some((scene, change)) = update {
        renderer.update(&mut rec, scene, change).unwrap();
    }
    renderer.steps().for_each(|step| renderer.record(&mut rec, &step).unwrap());
}

#[test]
fn an_engine_moves_its_scene_with_three_frames_in_flight() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let mut scene = at(&Moment::default());
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, OUTPUTS).unwrap();
    let effects: Effects = *renderer.effects();
    let pixels = scene.settings.pixels();
    let buffer = || Buffer::<PixelStats>::new(&gpu, "download", pixels, Location::Readback).unwrap();
    let moments: Vec<_> = MOMENTS.iter().chain(MOMENTS.iter().rev()).collect();
    let expected: Vec<_> = moments
        .iter()
        .map(|moment| {
            let (fresh, to, mut frame) = (at(moment), buffer(), FrameResources::new(&gpu).unwrap());
            let mut renderer = Renderer::specialised(&gpu, &fresh, &fresh.settings, OUTPUTS, effects).unwrap();
            engine.run(|commands| {
                record(&gpu, &mut frame, commands, &mut renderer, None);
                // SAFETY: two live buffers.
                unsafe { download(&engine, commands, &renderer, &to) };
            });
            to.read().unwrap()
        })
        .collect();
    assert!(expected.windows(2).take(5).all(|pair| pair[0] != pair[1]), "control");
    let mut slots: Vec<_> = (0..3).map(|_| (FrameResources::new(&gpu).unwrap(), buffer(), None)).collect();
    let mut found = vec![Vec::new(); moments.len()];
    for (number, moment) in moments.iter().enumerate() {
        let (frame, to, in_flight) = &mut slots[number % 3];
        if let Some((earlier, submitted)) = in_flight.take() {
            engine.wait(submitted);
            found[earlier] = to.read().unwrap();
        }
        let pose = pose(&scene, moment, f32::INFINITY);
        let change = scene.apply(&pose).unwrap();
        let submitted = engine.submit(|commands| {
            record(&gpu, frame, commands, &mut renderer, Some((&scene.scene, &change)));
            // SAFETY: two live buffers; the slot's last download was waited for.
            unsafe { download(&engine, commands, &renderer, to) };
        });
        *in_flight = Some((number, submitted));
    }
    for (_, to, in_flight) in &mut slots {
        let (earlier, submitted) = in_flight.take().unwrap();
        engine.wait(submitted);
        found[earlier] = to.read().unwrap();
    }
    for (number, (found, expected)) in found.iter().zip(&expected).enumerate() {
        assert!(found == expected, "frame {number}, {:?}", moments[number]);
    }
    assert_eq!(engine.messages(), Vec::<String>::new());
}
