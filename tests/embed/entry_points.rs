//! Tests at Vulkan's entry points what the renderer asks of an engine's device.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
use crate::hooks;
use crate::poses::{MOMENTS, Moment, at, pose};
use crate::support::engine::Engine;
use ash::vk;
use ash::vk::Handle;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::sync::mpsc;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tallow::denoise::filter::{self, FilterSettings, firefly::Fireflies};
use tallow::denoise::{Demodulation, Denoiser};
use tallow::error::Error;
use tallow::gpu::{Buffer, FrameResources, Gpu, RawDevice, Recorder};
use tallow::image::Samples;
use tallow::render::settings::Settings;
use tallow::render::{Job, Moves, Outputs, Renderer, Reproject, Step, film};
use tallow::scene::{Loaded, Scene};

/// Counts are asked for, so that every kind of pass takes part.
fn scene() -> Loaded {
    let small = |s: &mut Settings| {
        (s.width, s.height, s.spp) = (33, 17, 4);
        s.allocate.policy = &tallow::allocate::both::ROW;
    };
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml"))
        .map(|scene| scene.with(small))
        .unwrap()
}

#[test]
fn nothing_is_created_after_the_first_frame() {
    let engine = Engine::new();
    let raw = hooks::between(engine.raw());
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(raw) }.unwrap();
    let scene = scene();
    let outputs = Outputs { split_light: true, guides: true, counters: true };
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
    let (row, settings) = (filter::find("auto").unwrap(), FilterSettings::default());
    let denoiser = Denoiser::new(&gpu, &renderer, row, &settings, Demodulation::Light, Fireflies::Usual).unwrap();
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
        let mut calls = hooks::take_calls();
        assert_eq!(calls.remove("vkGetQueryPoolResults"), Some(1), "asks for all times at once, and makes nothing");
        assert!(number == 0 || calls.is_empty(), "frame {number}: {calls:?}");
    }
    // The engine's window changes its size: the renderer's kernels stay, even though nothing holds them meanwhile.
    drop((renderer, denoiser, frame));
    let scene = scene.with(|s| (s.width, s.height) = (48, 20));
    let _resized = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
    let made = hooks::take_calls();
    assert!(made.contains_key("vkCreateBuffer") && !made.contains_key("vkCreateComputePipelines"), "{made:?}");
}

/// Poses, what they upload, and carried samples: the first two frames make room for what they stage, and the rest use it.
#[test]
fn nothing_is_created_while_a_scene_moves() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let mut scene = at(&Moment::default());
    let outputs = Outputs { split_light: true, guides: true, counters: false };
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
    renderer.keep_history(Reproject::default(), Moves::Scene).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    assert!(hooks::take_calls().contains_key("vkCreateComputePipelines"), "control");
    for (number, moment) in MOMENTS.iter().chain(&MOMENTS).enumerate() {
        let pose = pose(&scene, moment, f32::INFINITY);
        let change = scene.apply(&pose).unwrap();
        engine.run(|commands| {
            // SAFETY: recording, on this device.
            let mut rec = unsafe { Recorder::external(&gpu, &mut frame, commands.as_raw()) }.unwrap();
            renderer.update(&mut rec, &scene, &change).unwrap();
            renderer.steps_on().for_each(|step| renderer.record(&mut rec, &step).unwrap());
        });
        assert!(frame.times().is_ok());
        let mut calls = hooks::take_calls();
        assert_eq!(calls.remove("vkGetQueryPoolResults"), Some(1), "asks for all times at once, and makes nothing");
        assert!(number < 2 || calls.is_empty(), "frame {number}: {calls:?}");
    }
}

#[test]
fn a_lost_device_is_one_line_and_exit_code_4() {
    let engine = Engine::new();
    let raw = hooks::between(engine.raw());
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(raw) }.unwrap();
    let scene = scene();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let losing = hooks::set(&hooks::LOSE);
    let lost = renderer.run(&mut frame, &Step::Start).map(drop);
    drop(losing);
    let error = lost.unwrap_err();
    assert!(matches!(error, Error::DeviceLost(_)) && error.exit_code() == 4);
    let line = error.to_string();
    assert!(line.contains("the device was lost") && line.contains("run again") && !line.contains('\n'), "{line}");
    for refused in [renderer.run(&mut frame, &Step::Start).map(drop), renderer.picture().map(drop)] {
        assert!(matches!(refused, Err(Error::DeviceLost(_))), "{refused:?}");
    }
    drop((renderer, frame, gpu));
    assert!(hooks::take_calls().contains_key("vkFreeMemory"), "what is lost is freed all the same");
}

/// An engine that waited for its own submission asks for the times of it.
#[test]
fn times_of_a_lost_device_say_so_and_nothing_is_read_from_it_then() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let scene = scene();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    renderer.run(&mut frame, &Step::Start).unwrap();
    assert!(frame.times().is_ok() && renderer.picture().is_ok(), "control: nothing fails without the hook");
    let losing = hooks::set(&hooks::LOSE);
    let lost = [frame.times().map(drop), frame.passes().map(drop)];
    drop(losing);
    for refused in lost.into_iter().chain([renderer.picture().map(drop)]) {
        assert!(matches!(refused, Err(Error::DeviceLost(_))), "{refused:?}");
    }
}

/// What a driver tells of the times before it says that the device is lost names the pass in the message.
#[test]
fn a_device_that_is_lost_on_the_way_tells_the_last_pass() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let buffer = Buffer::from_slice(&gpu, "filled", &[1u32]).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let (device, losing) = (engine.device.clone(), Arc::new(Mutex::new(None)));
    let lose = losing.clone();
    *hooks::BEFORE_WAIT.lock().unwrap() = Some(Box::new(move || {
        // SAFETY: nobody else uses the engine's device.
        unsafe { device.device_wait_idle() }.unwrap();
        hooks::WAIT.store(vk::Result::ERROR_DEVICE_LOST.as_raw(), SeqCst);
        *lose.lock().unwrap() = Some(hooks::set(&hooks::LOSE));
    }));
    let lost = gpu.run(&mut frame, |rec| rec.update(&buffer, &2).and_then(|()| rec.fill(&buffer, 7)));
    *hooks::BEFORE_WAIT.lock().unwrap() = None;
    hooks::WAIT.store(0, SeqCst);
    drop(losing.lock().unwrap().take());
    let line = lost.unwrap_err().to_string();
    assert!(line.contains("the last pass to start was \"fill\""), "{line}");
}

/// Out of memory says nothing of the work that was submitted: it is over before anything of it is freed.
#[test]
fn a_wait_that_fails_leaves_nothing_in_flight() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let scene = scene();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    hooks::take_calls();
    let mut fail = |code: vk::Result| {
        hooks::WAIT.store(code.as_raw(), SeqCst);
        let failed = renderer.run(&mut frame, &Step::Start).map(drop);
        hooks::WAIT.store(0, SeqCst);
        let calls = hooks::take_calls();
        assert_eq!((calls["vkWaitForFences"], calls.get("vkQueueWaitIdle")), (1, Some(&1)), "{calls:?}");
        let error = failed.unwrap_err();
        assert!(error.exit_code() == 4 && error.to_string().contains("out of memory"), "{error}");
        error
    };
    assert!(matches!(fail(vk::Result::ERROR_OUT_OF_HOST_MEMORY), Error::Memory(_)));
    assert!(matches!(fail(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY), Error::OutOfDeviceMemory(_)));
    assert!(renderer.run(&mut frame, &Step::Start).is_ok(), "the device is as good as before");
    assert_eq!(hooks::take_calls().get("vkQueueWaitIdle"), None, "control: only after a failure");
    drop((renderer, frame, gpu));
    assert!(hooks::take_calls().contains_key("vkFreeMemory"), "control: all is freed in the end");
}

/// What hangs is neither waited for nor freed, since it may go on using what it was given.
#[test]
fn a_device_that_stops_answering_is_given_up_with_all_that_is_on_it() {
    let engine = Engine::new();
    let raw = RawDevice { wait_limit: Some(Duration::from_millis(1)), ..hooks::between(engine.raw()) };
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(raw) }.unwrap();
    let buffer = Buffer::from_slice(&gpu, "kept", &[1u32]).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    hooks::WAIT.store(vk::Result::TIMEOUT.as_raw(), SeqCst);
    // Nothing is recorded, so that nothing goes on, and the engine has nothing to wait for.
    let hung = gpu.run(&mut frame, |_| Ok(())).map(drop);
    hooks::WAIT.store(0, SeqCst);
    hooks::take_calls();
    let error = hung.unwrap_err();
    assert!(matches!(error, Error::DeviceLost(_)) && error.exit_code() == 4);
    let line = error.to_string();
    assert!(line.contains("stopped answering") && line.contains("run again") && !line.contains('\n'), "{line}");
    let again = gpu.run(&mut frame, |rec| rec.fill(&buffer, 0)).map(drop);
    for refused in [again, buffer.read().map(drop), buffer.write(0, &[2])] {
        assert!(matches!(refused, Err(Error::DeviceLost(_))), "{refused:?}");
    }
    drop((frame, buffer, gpu));
    let calls = hooks::take_calls();
    let freed = calls.keys().find(|name| ["Destroy", "Free", "Reset", "Idle"].iter().any(|word| name.contains(word)));
    assert_eq!(freed, None, "{calls:?}");
    assert_eq!(engine.messages(), Vec::<String>::new());
    engine.abandon();
}

/// A device that is slow goes on; passes that begin and end tell it from one that hangs.
#[test]
fn a_device_that_goes_on_is_waited_for() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let buffer = Buffer::from_slice(&gpu, "filled", &[1u32]).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    // Once a pass has ended, the first wait is over time; the second is not.
    let (device, waits) = (engine.device.clone(), AtomicUsize::new(0));
    *hooks::BEFORE_WAIT.lock().unwrap() = Some(Box::new(move || {
        // SAFETY: nobody else uses the engine's device.
        unsafe { device.device_wait_idle() }.unwrap();
        let late = if waits.fetch_add(1, SeqCst) == 0 { vk::Result::TIMEOUT } else { vk::Result::SUCCESS };
        hooks::WAIT.store(late.as_raw(), SeqCst);
    }));
    let times = gpu.run(&mut frame, |rec| rec.fill(&buffer, 7));
    *hooks::BEFORE_WAIT.lock().unwrap() = None;
    assert_eq!((times.unwrap().len(), buffer.read().unwrap()), (1, vec![7]));
}

/// A thread that makes the renderer of another scene does not wait for the one that renders. Where the host cannot write the device's
/// memory, what it writes is brought by a submission, behind those that run.
#[test]
fn a_renderer_is_made_while_a_submission_runs() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let scene = scene();
    let made =
        is_done_meanwhile(&gpu, || drop(Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap()));
    assert!(made || !gpu.info().unified, "it was made while the submission ran");
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// Nor does one that reads a film that nobody renders.
#[test]
fn a_film_is_read_while_a_submission_runs() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let scene = scene();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let job = Job::new(&renderer);
    let status = job.run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
    let read = is_done_meanwhile(&gpu, || drop(job.film(&status).unwrap()));
    assert!(read || !gpu.info().unified, "it was read while the submission ran");
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// Whether `work` ends on another thread while a submission is held back, for 10 s at most.
fn is_done_meanwhile(gpu: &Gpu, work: impl FnOnce() + Send) -> bool {
    let buffer = Buffer::from_slice(gpu, "in use", &[1u32]).unwrap();
    let mut frame = FrameResources::new(gpu).unwrap();
    let ((running, runs), (done, does)) = (mpsc::channel(), mpsc::channel());
    let seen = Arc::new(AtomicBool::new(false));
    let was_seen = seen.clone();
    *hooks::BEFORE_WAIT.lock().unwrap() = Some(Box::new(move || {
        running.send(()).unwrap();
        was_seen.store(does.recv_timeout(Duration::from_secs(10)).is_ok(), SeqCst);
    }));
    std::thread::scope(|scope| {
        scope.spawn(move || {
            runs.recv().unwrap();
            work();
            let _ = done.send(());
        });
        gpu.run(&mut frame, |rec| rec.fill(&buffer, 7)).unwrap();
    });
    *hooks::BEFORE_WAIT.lock().unwrap() = None;
    seen.load(SeqCst)
}

/// What the host does not read where it lies is copied, all parts of a film by one submission.
#[test]
fn a_film_that_is_copied_takes_one_submission() {
    let engine = Engine::new();
    let scene = scene();
    let film = |uncached: bool| {
        let hook = uncached.then(|| hooks::set(&hooks::UNCACHED));
        // SAFETY: the engine's handles are valid and outlive what is made from them.
        let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
        drop(hook);
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
        hooks::take_calls();
        let film = film::read_back(&renderer).unwrap();
        let submitted = hooks::take_calls().remove("vkQueueSubmit2").unwrap_or(0);
        assert_eq!(submitted, usize::from(uncached || !gpu.info().unified));
        film.channels.into_iter().map(|c| (c.name, bits(&c.samples))).collect::<Vec<_>>()
    };
    assert!(film(true) == film(false), "the bits are the same");
    assert_eq!(engine.messages(), Vec::<String>::new());
}

fn bits(samples: &Samples) -> Vec<u32> {
    match samples {
        Samples::F32(values) => values.iter().map(|v| v.to_bits()).collect(),
        Samples::U32(values) => values.clone(),
    }
}

/// Memory that the host maps is not touched while a submission that may use it runs, whoever asks.
#[test]
fn a_buffer_is_read_and_written_between_submissions() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let gpu = unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let buffer = Buffer::from_slice(&gpu, "shared", &[1u32]).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let (running, runs) = mpsc::channel();
    let (done, seen) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
    let (is_done, was_seen) = (done.clone(), seen.clone());
    *hooks::BEFORE_WAIT.lock().unwrap() = Some(Box::new(move || {
        running.send(()).unwrap();
        std::thread::sleep(Duration::from_millis(100)); // time enough for who does not wait
        was_seen.store(is_done.load(SeqCst), SeqCst);
    }));
    std::thread::scope(|scope| {
        let (buffer, done) = (&buffer, &done);
        scope.spawn(move || {
            runs.recv().unwrap();
            assert_eq!(buffer.read().unwrap(), [7]);
            done.store(true, SeqCst);
        });
        gpu.run(&mut frame, |rec| rec.fill(buffer, 7)).unwrap();
    });
    *hooks::BEFORE_WAIT.lock().unwrap() = None;
    assert!(done.load(SeqCst) && !seen.load(SeqCst), "it was read while the submission ran");
}
