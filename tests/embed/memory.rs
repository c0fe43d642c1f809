//! Tests what the renderer holds of an engine's memory, and for how long.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
use crate::hooks;
use crate::support::engine::Engine;
use ash::vk::Handle;
use std::path::Path;
use std::sync::atomic::Ordering::SeqCst;
use tallow::error::Error;
use tallow::gpu::{FrameResources, Gpu, Recorder};
use tallow::render::{Job, Outputs, Renderer, Step};
use tallow::scene::description::{Description, EnvironmentTable, Mesh, MeshTable};
use tallow::scene::{Change, Loaded, Scene};

fn scene() -> Loaded {
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml"))
        .map(|scene| scene.with(|s| (s.width, s.height, s.spp) = (160, 120, 1)))
        .unwrap()
}

/// An engine's window changes its size: what is dropped is free when the device is done with it, not when a frame is recorded anew.
#[test]
fn frames_hold_no_memory_of_work_that_is_complete() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let scene = scene();
    let renderer = || Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let mut frames: Vec<_> = (0..2).map(|_| FrameResources::new(&gpu).unwrap()).collect();
    let before = gpu.allocated_bytes();
    let run = renderer();
    run.steps().for_each(|step| drop(run.run(&mut frames[0], &step).unwrap()));
    drop(run);
    assert_eq!(gpu.allocated_bytes(), before, "of runs");
    assert!(frames[0].passes().is_ok_and(|passes| !passes.is_empty()), "what they took is told all the same");
    let mut recorded = renderer();
    for frame in &mut frames {
        engine.run(|commands| {
            // SAFETY: the command buffer is recording, and the engine waits for its submission.
            let mut rec = unsafe { Recorder::external(&gpu, frame, commands.as_raw()) }.unwrap();
            recorded.update(&mut rec, &scene, &Change::everything(&scene)).unwrap();
            recorded.steps().for_each(|step| recorded.record(&mut rec, &step).unwrap());
        });
    }
    drop(recorded);
    assert!(
        gpu.allocated_bytes() > before,
        "control: of submissions of the engine's the frame does not know that they are complete"
    );
    frames.iter_mut().for_each(FrameResources::release);
    assert_eq!(gpu.allocated_bytes(), before, "of submissions");
    assert!(frames.iter().all(|frame| frame.passes().is_ok_and(|passes| !passes.is_empty())));
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// An engine that meets an error drops what it has and makes something smaller: the frame must not hold the rest of it.
#[test]
fn frames_hold_no_memory_of_work_that_failed() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let (scene, mut frame) = (scene(), FrameResources::new(&gpu).unwrap());
    let mut fail = |before_end: &dyn Fn(&Renderer, &mut Recorder) -> Result<(), Error>| {
        let before = gpu.allocated_bytes();
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        let failed = gpu.run(&mut frame, |rec| {
            renderer.steps().try_for_each(|step| renderer.record(rec, &step))?;
            before_end(&renderer, rec)
        });
        hooks::WAIT.store(0, SeqCst);
        assert!(failed.is_err() && gpu.allocated_bytes() > before, "{failed:?}");
        drop(renderer);
        assert_eq!(gpu.allocated_bytes(), before, "{failed:?}");
        frame.times()
    };
    let recording = fail(&|renderer, rec| renderer.record(rec, &Step::Reproject)); // it keeps no history
    assert!(
        recording.is_ok_and(|times| times.is_empty()),
        "nothing was submitted, so that there is nothing to wait for"
    );
    fail(&|_, _| {
        hooks::WAIT.store(ash::vk::Result::ERROR_OUT_OF_HOST_MEMORY.as_raw(), SeqCst);
        Ok(())
    })
    .unwrap();
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// A device whose memory is small has none for large blocks, and one where it is nearly all in use none but for what a buffer needs.
#[test]
fn a_small_render_takes_no_large_block_of_memory() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let scene = scene().with(|s| (s.width, s.height) = (300, 200)); // of more bytes than the smallest block
    let render = || {
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED)?;
        Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu)?)?;
        renderer.picture()
    };
    // With how often the device was asked for memory.
    let within = |most: u64| {
        hooks::take_calls();
        hooks::MOST_BYTES.store(most, SeqCst);
        let picture = render();
        hooks::MOST_BYTES.store(u64::MAX, SeqCst);
        (picture, hooks::take_calls()["vkAllocateMemory"])
    };
    assert!(within(100).0.is_err(), "control: the device gives no more than it is told to");
    let (shared, blocks) = within(32 << 20);
    assert!(blocks < 5, "{blocks} blocks, which buffers share");
    let (alone, buffers) = within(4 << 20);
    assert!(shared.unwrap().pixels == alone.unwrap().pixels);
    assert!(buffers > blocks, "control: {buffers}, of which the device refused some");
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// A grid of triangles above which a sky is.
fn grid(side: u32) -> Loaded {
    let positions = (0..side * side).map(|i| [(i % side) as f32, ((i * i) % 7) as f32, (i / side) as f32]).collect();
    let cells = (0..(side - 1) * (side - 1)).map(|i| i / (side - 1) * side + i % (side - 1));
    let indices = cells.flat_map(|a| [a, a + side, a + 1, a + 1, a + side, a + side + 1]).collect();
    let mesh = MeshTable { data: Some(Mesh { positions, indices, ..Mesh::default() }), ..MeshTable::default() };
    let environment = Some(EnvironmentTable::default());
    let description = Description { mesh: vec![mesh], environment, ..Description::default() };
    Scene::build(&description).unwrap().with(|s| (s.width, s.height, s.spp) = (16, 9, 1))
}

/// Uploads take memory for what they hold, and give it back when the recordings that follow do without.
#[test]
fn a_frame_does_not_keep_the_memory_of_a_large_upload() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let scene = grid(200);
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let arrays: u64 = renderer.scene().sizes().iter().map(|(_, bytes)| bytes).sum();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let without = gpu.allocated_bytes();
    let mut takes = |change: &Change| {
        gpu.run(&mut frame, |rec| renderer.update(rec, &scene, change)).unwrap();
        gpu.allocated_bytes() - without
    };
    let everything = Change::everything(&scene);
    let taken = takes(&everything);
    assert!((arrays / 2..arrays * 5 / 4 + (1 << 20)).contains(&taken), "{taken} bytes for {arrays}");
    assert_eq!([(); 4].map(|()| takes(&everything)), [taken; 4], "what is uploaded again and again finds its memory");
    let few = Change { instances: true, materials: true, ..Change::default() };
    let after = [(); 3].map(|()| takes(&few));
    assert!(after[..2] == [taken; 2] && after[2] < 1 << 20, "{after:?} bytes of {taken}");
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// A scene of which the device has a part would be neither that before nor that after the change.
#[test]
fn after_memory_has_run_out_in_an_update_no_step_is_recorded() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let scene = grid(400);
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let mut picture = |renderer: &Renderer| {
        renderer.steps().try_for_each(|step| renderer.run(&mut frame, &step).map(drop))?;
        renderer.picture()
    };
    let before = picture(&renderer).unwrap();
    let everything = Change::everything(&scene);
    let update = |renderer: &mut Renderer, change: &Change| {
        gpu.run(&mut FrameResources::new(&gpu)?, |rec| renderer.update(rec, &scene, change)).map(drop)
    };
    hooks::MOST_BYTES.store(100, SeqCst);
    let failed = update(&mut renderer, &everything);
    hooks::MOST_BYTES.store(u64::MAX, SeqCst);
    assert!(matches!(failed, Err(Error::OutOfDeviceMemory(_))), "{failed:?}");
    for told in [picture(&renderer).map(drop), update(&mut renderer, &Change::default())] {
        assert!(told.is_err_and(|e| matches!(&e, Error::Usage(what) if what.contains("Change::everything"))));
    }
    update(&mut renderer, &everything).unwrap();
    assert!(picture(&renderer).unwrap().pixels == before.pixels);
    assert_eq!(engine.messages(), Vec::<String>::new());
}
