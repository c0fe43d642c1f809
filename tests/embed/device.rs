//! Tests the GPU layer with an engine's own instance, device and command buffer: it must give the same bits.
#![allow(unsafe_code, reason = "an engine's side of the contract is raw Vulkan")]
use crate::hooks;
use crate::support;
use crate::support::engine::Engine;
use crate::support::kernels::next;
use ash::vk;
use ash::vk::Handle;
use tallow::gpu::{Buffer, FrameResources, Gpu, Location, RawDevice, Recorder};

/// Two dependent passes; returns the buffers in use, the result last.
fn record(rec: &mut Recorder<'_>, kernel: &next::Kernel, buffers: &[Buffer<u32>; 3]) {
    let [a, b, c] = buffers;
    let (count, groups) = (a.len() as u32, [(a.len() as u32).div_ceil(64), 1, 1]);
    rec.dispatch(kernel, next::Bind { from: a, to: b }, &count, groups).unwrap();
    rec.dispatch(kernel, next::Bind { from: b, to: c }, &count, groups).unwrap();
}

fn buffers(gpu: &Gpu, input: &[u32]) -> [Buffer<u32>; 3] {
    let make = |name| Buffer::new(gpu, name, input.len(), Location::Device).unwrap();
    [Buffer::from_slice(gpu, "a", input).unwrap(), make("b"), make("c")]
}

/// The result on a device that the layer opened itself.
fn own_device(input: &[u32]) -> Vec<u32> {
    let gpu = support::gpu();
    let kernel = next::Kernel::new(&gpu, &Default::default()).unwrap();
    let (buffers, mut frame) = (buffers(&gpu, input), FrameResources::new(&gpu).unwrap());
    gpu.run(&mut frame, |rec| {
        record(rec, &kernel, &buffers);
        Ok(())
    })
    .unwrap();
    support::assert_silent(&gpu);
    buffers[2].read().unwrap()
}

#[test]
fn an_engines_command_buffer_gives_the_same_bits() {
    let engine = Engine::new();
    let input = support::words(10_007, 1);
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let kernel = next::Kernel::new(&gpu, &Default::default()).unwrap();
    let (buffers, mut frame) = (buffers(&gpu, &vec![0; input.len()]), FrameResources::new(&gpu).unwrap());
    // The engine writes the input itself, just before, without a barrier of its own, and copies the result just after.
    let upload = Buffer::from_slice(&gpu, "upload", &input).unwrap();
    let download = Buffer::<u32>::new(&gpu, "download", input.len(), Location::Readback).unwrap();
    for _ in 0..2 {
        engine.run(|commands| unsafe {
            engine_copy(&engine.device, commands, &upload, &buffers[0]);
            let mut rec = Recorder::external(&gpu, &mut frame, commands.as_raw()).unwrap();
            record(&mut rec, &kernel, &buffers);
            drop(rec);
            engine_copy(&engine.device, commands, &buffers[2], &download);
        });
        assert_eq!(frame.times().unwrap().len(), 2);
    }
    let own = own_device(&input);
    assert!(buffers[2].read().unwrap() == own, "the bits are those of the layer's own device");
    assert!(download.read().unwrap() == own, "and the engine's copy sees them");
    assert!(own != input, "the comparison can fail");
    assert_eq!(engine.messages(), Vec::<String>::new());
    drop((gpu, kernel, buffers, frame, upload, download));
}

unsafe fn engine_copy(device: &ash::Device, commands: vk::CommandBuffer, from: &Buffer<u32>, to: &Buffer<u32>) {
    let (from, to) = (from.raw(), to.raw());
    let region = vk::BufferCopy { src_offset: from.offset, dst_offset: to.offset, size: from.size };
    let buffers = (vk::Buffer::from_raw(from.handle), vk::Buffer::from_raw(to.handle));
    unsafe { device.cmd_copy_buffer(commands, buffers.0, buffers.1, &[region]) };
}

/// The engine enables the extension where there is one, as the layer does on a device of its own.
#[test]
fn an_engines_clocks_are_tied_together_where_its_device_can() {
    let engine = Engine::new();
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    assert_eq!(gpu.calibrate().is_some(), support::gpu().calibrate().is_some());
    if let Some(before) = gpu.calibrate() {
        std::thread::sleep(std::time::Duration::from_millis(20));
        let after = gpu.calibrate().unwrap();
        assert!((after.device_ns - before.device_ns).abs_diff(after.host_ns - before.host_ns) < 5_000_000);
    }
    assert_eq!(engine.messages(), Vec::<String>::new());
}

/// The extension is there, and a clock of the device is not among those that it reads.
#[test]
fn a_clock_that_a_device_does_not_read_is_not_asked_for() {
    let engine = Engine::new();
    // SAFETY: the engine's handles are valid and outlive what is made from them.
    let opened = || unsafe { Gpu::from_raw(hooks::between(engine.raw())) }.unwrap();
    let reads_its_own = support::gpu().calibrate().is_some();
    assert_eq!(opened().calibrate().is_some(), reads_its_own, "control: without the hook");
    let hook = hooks::set(&hooks::NO_DEVICE_CLOCK);
    let gpu = opened();
    drop(hook);
    assert_eq!(gpu.calibrate(), None);
    assert_eq!(engine.messages(), Vec::<String>::new());
}

#[test]
fn times_before_the_work_is_done_are_an_error() {
    let engine = Engine::new();
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let kernel = next::Kernel::new(&gpu, &Default::default()).unwrap();
    let (buffers, mut frame) = (buffers(&gpu, &[1]), FrameResources::new(&gpu).unwrap());
    engine.run(|commands| {
        let mut rec = unsafe { Recorder::external(&gpu, &mut frame, commands.as_raw()) }.unwrap();
        record(&mut rec, &kernel, &buffers);
        drop(rec);
        let error = frame.times().unwrap_err();
        assert!(error.to_string().contains("before its work was complete") && error.exit_code() == 2, "{error:?}");
    });
    assert_eq!(frame.times().unwrap().len(), 2);
    assert_eq!(engine.messages(), Vec::<String>::new());
}

#[test]
fn bad_handles_are_errors() {
    let engine = Engine::new();
    for (bad, part) in [
        (RawDevice { device: 0, ..engine.raw() }, "null handle was handed over: give RawDevice::device "),
        (RawDevice { get_instance_proc_addr: std::ptr::null(), ..engine.raw() }, "RawDevice::get_instance_proc_addr "),
        (RawDevice { queue_family: 99, ..engine.raw() }, "99"),
    ] {
        let error = unsafe { Gpu::from_raw(bad) }.err().unwrap();
        assert!(error.to_string().contains(part) && error.exit_code() == 2, "{error:?}");
    }
    let gpu = unsafe { Gpu::from_raw(engine.raw()) }.unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    assert_eq!(unsafe { Recorder::external(&gpu, &mut frame, 0) }.err().unwrap().exit_code(), 2);
}

#[test]
fn an_instance_of_an_older_vulkan_is_refused() {
    for version in [vk::API_VERSION_1_0, vk::API_VERSION_1_1, vk::API_VERSION_1_2] {
        let engine = Engine::of_version(version);
        let error = unsafe { Gpu::from_raw(engine.raw()) }.err().unwrap();
        assert!(error.to_string().contains("set apiVersion to 1.3") && error.exit_code() == 4, "{error}");
        assert_eq!(engine.messages(), Vec::<String>::new());
    }
}
