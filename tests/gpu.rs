//! Tests the GPU layer on a real device under Vulkan's validation layers: any of their messages fails a test.
mod support;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, Barrier, mpsc};
use std::thread;
use std::time::Duration;
use support::kernels::{far, mix, next};
use support::{assert_silent, hash, words};
use tallow::error::{Error, Result};
use tallow::gpu::{Buffer, DeviceOptions, FrameResources, Gpu, Location, PassTime};
use tallow::layout::{Effects, uvec2, uvec3, uvec4, vec4};

const SIZES: [usize; 5] = [1, 31, 64, 65, 1_000_001];
const WIDTH: u32 = 64;

/// The message of an error about what a caller gave.
fn refused<T>(given: Result<T>) -> String {
    let error = given.err().unwrap();
    assert!(matches!(error, Error::Usage(_)), "{error:?}");
    error.to_string()
}

fn groups(count: usize) -> [u32; 3] {
    [(count as u32).div_ceil(WIDTH), 1, 1]
}

#[test]
fn buffers_return_what_was_written() {
    let gpu = support::gpu();
    for count in SIZES {
        let values = words(count, 1);
        let buffer = Buffer::from_slice(&gpu, "round trip", &values).unwrap();
        assert_eq!((buffer.len(), buffer.raw().size), (count, 4 * count as u64));
        assert!(buffer.read().unwrap() == values, "{count} words");
        buffer.write(count - 1, &[7]).unwrap();
        assert_eq!(*buffer.read().unwrap().last().unwrap(), 7);
        assert!(buffer.read().unwrap() != values, "the comparison tells a changed word");
    }
    assert_silent(&gpu);
}

#[test]
fn absent_data_is_one_zero() {
    let gpu = support::gpu();
    let buffer = Buffer::<uvec3>::from_slice(&gpu, "absent", &[]).unwrap();
    assert_eq!((buffer.len(), buffer.read().unwrap()), (1, vec![[0; 3]]));
    assert_silent(&gpu);
}

#[test]
fn bad_sizes_are_errors_that_name_the_buffer() {
    let gpu = support::gpu();
    let buffer = Buffer::from_slice(&gpu, "small", &[1u32, 2, 3]).unwrap();
    for (offset, count) in [(3, 1), (0, 4), (usize::MAX, 1)] {
        let message = refused(buffer.write(offset, &vec![0; count]));
        assert!(message.contains("small"), "{message}");
    }
    assert!(refused(buffer.read_range(2..4)).contains("small"));
    let other = Buffer::from_slice(&gpu, "other", &[1u32]).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let message = refused(gpu.run(&mut frame, |rec| rec.copy(&buffer, &other)));
    assert!(message.contains("small") && message.contains("other"), "{message}");
    let message = refused(gpu.run(&mut frame, |rec| rec.upload(&buffer, &[(2, &[1, 2])])));
    assert!(message.contains("small"), "{message}");
    for len in [usize::MAX, 1 << 50] {
        let message = Buffer::<u32>::new(&gpu, "huge", len, Location::Device).err().unwrap().to_string();
        assert!(message.contains("huge"), "{message}");
    }
    assert_silent(&gpu);
}

/// Inputs of the kernel `mix` on the host.
struct Inputs {
    wide: Vec<uvec4>,
    narrow: Vec<uvec3>,
    floats: Vec<vec4>,
    scalars: Vec<f32>,
    words: Vec<uvec3>,
    sums: Vec<u32>,
}

/// Finite floats of any bits, so that no unit may quieten a NaN.
fn float(bits: u32) -> f32 {
    f32::from_bits(bits & 0xbf7f_ffff)
}

/// Contents of the uniform block.
const BLOCK: uvec2 = [0x1234_5678, 0x9abc_def0];

impl Inputs {
    fn new(count: usize) -> Self {
        let three = |seed| words(3 * count, seed).chunks_exact(3).map(|w| [w[0], w[1], w[2]]).collect();
        let four = |seed| words(4 * count, seed).chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]]).collect::<Vec<_>>();
        Self {
            wide: four(1),
            narrow: three(2),
            floats: four(3).iter().map(|v| v.map(float)).collect(),
            scalars: words(count, 4).into_iter().map(float).collect(),
            words: three(5),
            sums: words(count, 6),
        }
    }

    /// The CPU twin: (sums, result).
    fn mix(&self, textures: bool, addend: u32, salt: u32) -> (Vec<u32>, Vec<uvec2>) {
        let sum = |i: usize| {
            let first = if textures { self.wide[i][3] } else { 1 };
            self.sums[i].wrapping_add(first).wrapping_add(addend)
        };
        let mixed = |i: usize| {
            let floats = self.floats[i][3].to_bits() ^ self.scalars[i].to_bits();
            hash(self.wide[i][0] ^ self.narrow[i][1] ^ floats ^ self.words[i][2] ^ BLOCK[1] ^ salt)
        };
        let all = 0..self.sums.len();
        (all.clone().map(sum).collect(), all.map(|i| [mixed(i), sum(i)]).collect())
    }
}

/// The same on the device.
fn run_mix(gpu: &Gpu, inputs: &Inputs, constants: mix::Constants, salt: u32) -> (Vec<u32>, Vec<uvec2>) {
    let count = inputs.sums.len();
    let kernel = mix::Kernel::new(gpu, &constants).unwrap();
    let wide = Buffer::from_slice(gpu, "wide", &inputs.wide).unwrap();
    let narrow = Buffer::from_slice(gpu, "narrow", &inputs.narrow).unwrap();
    let floats = Buffer::from_slice(gpu, "floats", &inputs.floats).unwrap();
    let scalars = Buffer::from_slice(gpu, "scalars", &inputs.scalars).unwrap();
    let words = Buffer::from_slice(gpu, "words", &inputs.words).unwrap();
    let sums = Buffer::from_slice(gpu, "sums", &inputs.sums).unwrap();
    let result = Buffer::new(gpu, "result", count, Location::Device).unwrap();
    let block = Buffer::from_slice(gpu, "block", &[[0; 2], BLOCK]).unwrap();
    let mut frame = FrameResources::new(gpu).unwrap();
    let bind = mix::Bind {
        wide: &wide,
        narrow: &narrow,
        floats: &floats,
        scalars: &scalars,
        words: &words,
        sums: &sums,
        result: &result,
        block: &block,
    };
    let push = [count as u32, salt, 0, 0];
    gpu.run(&mut frame, |rec| {
        rec.update(&block, &BLOCK)?;
        rec.dispatch(&kernel, bind, &push, groups(count))
    })
    .unwrap();
    (sums.read().unwrap(), result.read().unwrap())
}

#[test]
fn every_kind_of_binding_agrees_with_the_twin() {
    let gpu = support::gpu();
    for count in SIZES {
        let inputs = Inputs::new(count);
        let constants = mix::Constants { effects: Effects::ALL, addend: 5, local_size_x: WIDTH };
        let (sums, result) = run_mix(&gpu, &inputs, constants, 99);
        assert!((sums.clone(), result.clone()) == inputs.mix(true, 5, 99), "{count} elements");
        assert!((sums, result) != inputs.mix(true, 5, 98), "the comparison tells a changed push constant");
    }
    assert_silent(&gpu);
}

#[test]
fn specialisation_constants_take_effect() {
    let gpu = support::gpu();
    let inputs = Inputs::new(65);
    for (textures, addend, width) in [(false, 0, 1), (true, 7, 32), (false, 7, 128)] {
        let effects = Effects { textures, ..Effects::default() };
        let run = run_mix(&gpu, &inputs, mix::Constants { effects, addend, local_size_x: width }, 0);
        // Workgroups of another width than `groups` assumes cover a known part; the rest keeps its input.
        let reached = 65.min(65usize.div_ceil(WIDTH as usize) * width as usize);
        let twin = inputs.mix(textures, addend, 0);
        assert_eq!(run.0[..reached], twin.0[..reached], "{textures} {addend} {width}");
        assert_eq!(run.0[reached..], inputs.sums[reached..]);
        assert_ne!(run.0[..reached], inputs.mix(!textures, addend, 0).0[..reached], "told apart");
        assert_ne!(run.0[..reached], inputs.mix(textures, addend + 1, 0).0[..reached], "told apart");
    }
    assert_silent(&gpu);
}

/// A chain of passes that each read what the one before wrote: fill, `next` three times, copy.
fn chain(gpu: &Gpu, frame: &mut FrameResources, count: usize, barriers: bool) -> (Vec<u32>, Vec<PassTime>) {
    let kernel = next::Kernel::new(gpu, &Default::default()).unwrap();
    let make = |name| Buffer::<u32>::new(gpu, name, count, Location::Device).unwrap();
    let (a, b, end) = (make("a"), make("b"), make("end"));
    let times = gpu.run(frame, |rec| {
        if !barriers {
            rec.suppress_barriers();
        }
        rec.fill(&a, 5)?;
        for (from, to) in [(&a, &b), (&b, &a), (&a, &b)] {
            rec.dispatch(&kernel, next::Bind { from, to }, &(count as u32), groups(count))?;
        }
        rec.copy(&b, &end)
    });
    (end.read().unwrap(), times.unwrap())
}

#[test]
fn dependent_passes_wait_and_are_timed() {
    let gpu = support::gpu();
    let mut frame = FrameResources::new(&gpu).unwrap();
    for count in SIZES {
        let begun = std::time::Instant::now();
        let (values, times) = chain(&gpu, &mut frame, count, true);
        let elapsed = begun.elapsed().as_nanos() as u64;
        // 5, 16, 49, 148.
        assert!(values == vec![148; count], "{count}");
        assert_eq!(times.iter().map(|t| t.name).collect::<Vec<_>>(), ["fill", "next", "next", "next", "copy"]);
        assert!(times.iter().all(|t| t.begin_ns <= t.end_ns), "{times:?}");
        assert!(times.windows(2).all(|t| t[0].end_ns <= t[1].begin_ns), "one after another: {times:?}");
        assert!(times[4].end_ns - times[0].begin_ns <= elapsed, "{times:?} in {elapsed} ns");
    }
    assert_silent(&gpu);
}

#[test]
fn frames_of_any_length_are_timed_and_reused() {
    let gpu = support::gpu();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let kernel = next::Kernel::new(&gpu, &Default::default()).unwrap();
    let (a, b) = (Buffer::from_slice(&gpu, "a", &[1u32]).unwrap(), Buffer::from_slice(&gpu, "b", &[1u32]).unwrap());
    // Beyond one query pool (512 passes) and several descriptor pools, then few, then many again.
    for passes in [1300, 1, 1300] {
        let times = gpu.run(&mut frame, |rec| {
            (0..passes).try_for_each(|_| rec.dispatch(&kernel, next::Bind { from: &a, to: &b }, &1, [1; 3]))
        });
        assert_eq!(times.unwrap().len(), passes);
        assert_eq!(frame.times().unwrap().len(), passes);
    }
    assert_silent(&gpu);
}

#[test]
fn a_missing_barrier_is_reported() {
    let gpu = support::own_gpu();
    let mut frame = FrameResources::new(&gpu).unwrap();
    chain(&gpu, &mut frame, 64, true);
    assert_silent(&gpu);
    chain(&gpu, &mut frame, 64, false);
    // Old layers write SYNC-HAZARD-READ-AFTER-WRITE, new ones READ_AFTER_WRITE.
    let messages: Vec<_> = gpu.validation_messages().iter().map(|m| m.replace('_', "-")).collect();
    for hazard in ["READ-AFTER-WRITE", "WRITE-AFTER-READ"] {
        assert!(messages.iter().any(|m| m.contains(hazard)), "{hazard} in {messages:#?}");
    }
    assert!(messages.iter().any(|m| m.contains("\"a\"") || m.contains("[a]")), "objects are named: {messages:#?}");
}

#[test]
fn bad_dispatches_are_errors_and_leave_the_frame_usable() {
    let gpu = support::gpu();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let kernel = next::Kernel::new(&gpu, &Default::default()).unwrap();
    let (a, b) = (Buffer::from_slice(&gpu, "a", &[1u32]).unwrap(), Buffer::from_slice(&gpu, "b", &[0u32]).unwrap());
    for (groups, kind) in [([0, 1, 1], 2), ([1, 1, 0], 2), ([1, u32::MAX, 1], 4)] {
        let run = gpu.run(&mut frame, |rec| rec.dispatch(&kernel, next::Bind { from: &a, to: &b }, &1, groups));
        let error = run.unwrap_err();
        assert!(error.to_string().starts_with("next: ") && error.exit_code() == kind, "{error:?}");
    }
    gpu.run(&mut frame, |rec| rec.dispatch(&kernel, next::Bind { from: &a, to: &b }, &1, [1; 3])).unwrap();
    assert_eq!(b.read().unwrap(), [4]);
    assert_silent(&gpu);
}

#[test]
fn recorded_buffers_and_kernels_live_until_the_work_is_done() {
    let gpu = support::gpu();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let end = Buffer::from_slice(&gpu, "end", &[0u32]).unwrap();
    gpu.run(&mut frame, |rec| {
        let kernel = next::Kernel::new(&gpu, &Default::default())?;
        let start = Buffer::from_slice(&gpu, "start", &[1u32])?;
        rec.dispatch(&kernel, next::Bind { from: &start, to: &end }, &1, [1; 3])
    })
    .unwrap();
    assert_eq!(end.read().unwrap(), [4]);
    assert_silent(&gpu);
}

#[test]
fn nothing_is_left_when_the_device_closes() {
    let gpu = support::own_gpu();
    let log = gpu.validation_log();
    let mut frame = FrameResources::new(&gpu).unwrap();
    chain(&gpu, &mut frame, 64, true);
    drop((gpu, frame));
    assert_eq!(*log.lock().unwrap(), Vec::<String>::new());
}

#[test]
fn both_clocks_advance_together() {
    let gpu = support::gpu();
    let Some(before) = gpu.calibrate() else { return println!("no calibrated timestamps here") };
    std::thread::sleep(std::time::Duration::from_millis(50));
    let mut frame = FrameResources::new(&gpu).unwrap();
    let (_, times) = chain(&gpu, &mut frame, 64, true);
    let after = gpu.calibrate().unwrap();
    let (gpu_passed, host_passed) = (after.device_ns - before.device_ns, after.host_ns - before.host_ns);
    assert!((1..5_000_000).contains(&before.deviation_ns), "{before:?}");
    assert!(host_passed >= 50_000_000 && gpu_passed.abs_diff(host_passed) < 5_000_000, "{gpu_passed} {host_passed}");
    assert!(
        times.iter().all(|t| (before.device_ns..after.device_ns).contains(&t.begin_ns)),
        "passes are on that clock"
    );
    assert_silent(&gpu);
}

/// Fetches texel `index` of `texels` on the device.
fn fetch(gpu: &Gpu, texels: &Buffer<uvec4>, index: usize) -> tallow::error::Result<uvec4> {
    let kernel = far::Kernel::new(gpu, &Default::default())?;
    let found = Buffer::from_slice(gpu, "found", &[[0; 4]])?;
    let mut frame = FrameResources::new(gpu)?;
    gpu.run(&mut frame, |rec| rec.dispatch(&kernel, far::Bind { texels, found: &found }, &(index as u32), [1; 3]))?;
    Ok(found.read()?[0])
}

#[test]
fn the_largest_texel_buffer_is_read_to_its_end() {
    let gpu = support::gpu();
    let info = gpu.info();
    let bytes = info.max_buffer_size.min(info.max_allocation).min(info.memory_heap).min(2 << 30);
    let count = info.max_texel_elements.min(bytes / 16) as usize;
    println!("{count} texels of 16 bytes of {info:?}");
    let texels = Buffer::<uvec4>::new(&gpu, "largest", count, Location::Device).unwrap();
    texels.write(count - 2, &[[1, 2, 3, 4], [5, 6, 7, 8]]).unwrap();
    assert_eq!(fetch(&gpu, &texels, count - 1).unwrap(), [5, 6, 7, 8]);
    assert_eq!(fetch(&gpu, &texels, count - 2).unwrap(), [1, 2, 3, 4], "another texel differs");
    assert_silent(&gpu);
}

#[test]
fn a_part_is_bound_read_and_written_in_its_place() {
    let gpu = support::gpu();
    let values: Vec<u32> = (0..1000).collect();
    let all = Buffer::from_slice(&gpu, "all", &values).unwrap();
    let part = all.part(128..1000).unwrap();
    assert_eq!((part.len(), part.raw().offset, part.raw().size), (872, 512, 4 * 872));
    assert_eq!(part.read().unwrap(), values[128..]);
    part.part(64..65).unwrap().write(0, &[7]).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    gpu.run(&mut frame, |rec| rec.fill(&all.part(960..990)?, 5)).unwrap();
    let expected = |i: u32| {
        if i == 192 {
            7
        } else if (960..990).contains(&i) {
            5
        } else {
            i
        }
    };
    assert_eq!(all.read().unwrap(), (0..1000).map(expected).collect::<Vec<_>>());
    for range in [1..64, 64..64, 64..1001] {
        assert!(refused(all.part(range)).contains("\"all\""));
    }
    let texels = Buffer::<uvec4>::new(&gpu, "texels", 200, Location::Device).unwrap();
    let message = refused(fetch(&gpu, &texels.part(64..128).unwrap(), 0));
    assert!(message.contains("a part of it cannot be read as texels"), "{message}");
    assert_silent(&gpu);
}

#[test]
fn a_buffer_too_large_for_its_slot_is_an_error_with_the_limit() {
    let gpu = support::gpu();
    let limit = gpu.info().max_storage_range;
    if limit + 4 > gpu.info().max_buffer_size.min(gpu.info().max_allocation).min(gpu.info().memory_heap) {
        return println!("no buffer can exceed this device's storage range");
    }
    let large = Buffer::<u32>::new(&gpu, "large", (limit / 4) as usize + 1, Location::Device).unwrap();
    let small = Buffer::from_slice(&gpu, "small", &[0u32]).unwrap();
    let kernel = next::Kernel::new(&gpu, &Default::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let bind = next::Bind { from: &small, to: &large };
    let message = gpu.run(&mut frame, |rec| rec.dispatch(&kernel, bind, &1, [1; 3])).unwrap_err().to_string();
    assert!(message.contains("large") && message.contains(&limit.to_string()), "{message}");
    assert_silent(&gpu);
}

#[test]
fn unusable_choices_of_device_say_what_there_is() {
    let all = tallow::gpu::survey().unwrap();
    let open = |device: &str| Gpu::open(&DeviceOptions { device: Some(device.into()), ..DeviceOptions::default() });
    let message = open("no such device").err().unwrap().to_string();
    assert!(all.iter().all(|info| message.contains(&info.name)), "{message}");
    let by_name = open(&all[0].name.to_uppercase()).unwrap();
    assert_eq!((&by_name.info().name, open("0").unwrap().info().name.as_str()), (&all[0].name, &*all[0].name));
    assert!(by_name.info().missing.is_empty() && by_name.info().max_texel_elements >= 65536, "{:?}", by_name.info());
}

#[test]
fn parts_of_another_device_are_refused() {
    let (gpu, other) = (support::gpu(), support::gpu());
    let kernel = next::Kernel::new(&gpu, &Default::default()).unwrap();
    let make = |gpu| Buffer::from_slice(gpu, "buffer", &[1u32]).unwrap();
    let (here, there) = (make(&gpu), make(&other));
    let run = |frame: &Gpu, from, kernel: &next::Kernel| {
        let mut frame = FrameResources::new(frame).unwrap();
        let to = make(&gpu);
        gpu.run(&mut frame, |rec| rec.dispatch(kernel, next::Bind { from, to: &to }, &1, [1; 3])).map(|_| ())
    };
    let foreign = next::Kernel::new(&other, &Default::default()).unwrap();
    for run in [run(&other, &here, &kernel), run(&gpu, &there, &kernel), run(&gpu, &here, &foreign)] {
        assert!(refused(run).contains("another device"));
    }
    run(&gpu, &here, &kernel).unwrap();
    assert_silent(&gpu);
    assert_silent(&other);
}

/// The loader finds a device among all of them when an object is named. The test runs in a process of its own, where the C library
/// fills what is freed, so that whoever reads it crashes.
#[test]
fn objects_are_named_while_other_devices_come_and_go() {
    const FILL: &str = "MALLOC_PERTURB_";
    if std::env::var_os(FILL).is_none() {
        let mut alone = Command::new(std::env::current_exe().unwrap());
        let alone = alone.args(["--exact", "objects_are_named_while_other_devices_come_and_go"]).env(FILL, "165");
        let done = alone.output().unwrap();
        assert!(done.status.success(), "{}: {}", done.status, String::from_utf8_lossy(&done.stdout));
        return;
    }
    let gpu = Gpu::open(&DeviceOptions::default()).unwrap();
    std::thread::scope(|scope| {
        let others = scope.spawn(|| (0..40).for_each(|_| drop(Gpu::open(&DeviceOptions::default()).unwrap())));
        while !others.is_finished() {
            Buffer::<u32>::new(&gpu, "named", 1, Location::Device).unwrap();
        }
    });
}

/// Of four threads that submit what takes milliseconds, one always runs. Each uses what both readers wait for.
#[test]
fn who_reads_gets_through_between_threads_that_submit_without_pause() {
    const MOST: u32 = 100; // submissions of a thread
    let gpu = support::gpu();
    let make = |name| Buffer::from_slice(&gpu, name, &words(1 << 22, 1)).unwrap();
    let buffers = [make("a"), make("b")];
    let ((sender, done), stop) = (mpsc::channel(), Arc::new(AtomicBool::new(false)));
    let begun = Arc::new(Barrier::new(6));
    let submits = || {
        let (gpu, buffers, sender) = (gpu.clone(), buffers.clone(), sender.clone());
        let (stop, begun) = (stop.clone(), begun.clone());
        thread::spawn(move || {
            let mut frame = FrameResources::new(&gpu).unwrap();
            begun.wait();
            for value in (0..MOST).take_while(|_| !stop.load(Relaxed)) {
                gpu.run(&mut frame, |rec| buffers.iter().try_for_each(|buffer| rec.fill(buffer, value))).unwrap();
            }
            sender.send("submitted").unwrap();
            Some(frame)
        })
    };
    let reads = |buffer: &Buffer<u32>| {
        let (buffer, sender, begun) = (buffer.clone(), sender.clone(), begun.clone());
        thread::spawn(move || {
            begun.wait();
            for _ in 0..20 {
                thread::sleep(Duration::from_millis(5)); // others submit meanwhile
                buffer.read_range(0..1).unwrap();
            }
            sender.send("read").unwrap();
            None::<FrameResources>
        })
    };
    let threads: Vec<_> = (0..4).map(|_| submits()).chain(buffers.iter().map(reads)).collect();
    let next = || done.recv_timeout(Duration::from_secs(120)).expect("nobody waits for ever");
    let first = [next(), next()];
    stop.store(true, Relaxed);
    let rest = [(); 4].map(|()| next());
    // Frames go once no thread records: the validation layer 1.3.239 forgets labels of command buffers without a lock.
    let frames: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap()).collect();
    drop(frames);
    assert_eq!((first, rest), (["read"; 2], ["submitted"; 4]));
    assert_silent(&gpu);
}
