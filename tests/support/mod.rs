//! Functions that several tests share.
#![allow(dead_code)]
use std::sync::Mutex;
use tallow::gpu::{DeviceOptions, FrameResources, Gpu, Tuning};
use tallow::layout::PixelStats;
pub use tallow::math::hash::pcg as hash;
use tallow::render::{Job, Renderer, Step};

pub mod engine;

/// Generated modules of the kernels of `glsl/test`.
pub mod kernels {
    include!(concat!(env!("OUT_DIR"), "/test_shaders.rs"));
}

/// A device under core and synchronization validation, for one test at a time: the next test finds what this one has compiled. A
/// message fails the test that it was lent to; one of a test that failed is not lent again.
pub struct Lent(Gpu);

static IDLE: Mutex<Vec<Gpu>> = Mutex::new(Vec::new());

/// A device that no other test uses meanwhile.
pub fn gpu() -> Lent {
    let idle = IDLE.lock().unwrap().pop();
    Lent(idle.unwrap_or_else(own_gpu))
}

impl std::ops::Deref for Lent {
    type Target = Gpu;

    fn deref(&self) -> &Gpu {
        &self.0
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_silent(&self.0);
            IDLE.lock().unwrap().push(self.0.clone());
        }
    }
}

/// A device of the test's own, for what is left of it when it closes. `TALLOW_DEVICE` chooses it by index or name.
///
/// # Panics
/// With the remedy when there is no device or the layers are missing: a test that needs a GPU never passes without.
pub fn own_gpu() -> Gpu {
    open(None)
}

/// One that divides work into such sizes.
///
/// # Panics
/// As [`own_gpu`].
pub fn tuned_gpu(tuning: Tuning) -> Gpu {
    open(Some(tuning))
}

fn open(tuning: Option<Tuning>) -> Gpu {
    let device = std::env::var("TALLOW_DEVICE").ok();
    Gpu::open(&DeviceOptions { device, validation: true, tuning, ..DeviceOptions::default() })
        .unwrap_or_else(|e| panic!("this test needs a Vulkan device and the validation layers: {e}"))
}

/// The largest of them, at least 0; infinite where one is no number, which `f32::max` would pass over.
pub fn largest(values: impl IntoIterator<Item = f32>) -> f32 {
    values.into_iter().fold(0.0, |most, v| if v.is_nan() { f32::INFINITY } else { most.max(v) })
}

/// The same of numbers of 64 bits.
pub fn largest_f64(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |most, v| if v.is_nan() { f64::INFINITY } else { most.max(v) })
}

/// # Panics
/// When the validation layers have said anything.
pub fn assert_silent(gpu: &Gpu) {
    assert_eq!(gpu.validation_messages(), Vec::<String>::new());
}

/// Words that depend on nothing but `seed`.
pub fn words(count: usize, seed: u32) -> Vec<u32> {
    (0..count as u32).map(|i| hash(i ^ seed.rotate_left(16))).collect()
}

/// Statistics of all pixels.
pub fn stats(renderer: &Renderer) -> Vec<PixelStats> {
    renderer.film().tiles.iter().flat_map(|tile| tile.stats.read().unwrap()).collect()
}

/// Runs the whole of a render.
pub fn render(gpu: &Gpu, renderer: &Renderer) -> Vec<PixelStats> {
    Job::new(renderer).run_to_end(&mut FrameResources::new(gpu).unwrap()).unwrap();
    whole(renderer)
}

/// Runs steps that are not in the order of a render.
pub fn render_steps(gpu: &Gpu, renderer: &Renderer, steps: &[Step]) -> Vec<PixelStats> {
    let mut frame = FrameResources::new(gpu).unwrap();
    steps.iter().for_each(|step| drop(renderer.run(&mut frame, step).unwrap()));
    whole(renderer)
}

/// # Panics
/// When a sample was no number.
fn whole(renderer: &Renderer) -> Vec<PixelStats> {
    assert_eq!(renderer.broken_samples().unwrap(), None);
    stats(renderer)
}
