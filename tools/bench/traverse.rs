//! Compares the rays per second of the traversal kernel with those of obvhs's own traversal on two threads, alternating,
//! over the same tree and the same incoherent rays of Crytek Sponza: on a CPU a quarter of a million, on a GPU four millions.
//!   TALLOW_DATA=../shared cargo run --release --example bench-traverse [ROUNDS] [cpu|gpu] [compute|ray-query]
//! The second word chooses how many rays there are and how they are launched; else the kind of the device does. The third leaves the
//! rays to the device.
#![allow(missing_docs)]
use anyhow::{Context, Result, bail, ensure};
use glam::{Vec3, Vec3A, vec2};
use obvhs::cwbvh::CwBvh;
use obvhs::ray::{Ray, RayHit as HostHit};
use obvhs::rt_triangle::RtTriangle;
use rayon::prelude::*;
use std::path::Path;
use std::time::Instant;
use tallow::gpu::{Buffer, DeviceKind, DeviceOptions, FrameResources, Gpu, Location, Tracing};
use tallow::layout::{self, Effects, NONE, RayHit, RayQuery, TraversePush};
use tallow::math::warp::{basis_from_normal, warp_cosine_hemisphere};
use tallow::profile::{median, wake};
use tallow::render::settings::Settings;
use tallow::render::{Outputs, Renderer};
use tallow::scene::{Loaded, Scene};
use tallow::twins::light::INFINITE_DISTANCE;
use tallow::twins::sampler::{sample_2d, sampler_start};
use tallow::twins::surface::surface_at;
use tallow::twins::traverse::traverse;

/// The kernels of `glsl/test`.
#[allow(dead_code)]
mod kernels {
    include!(concat!(env!("OUT_DIR"), "/test_shaders.rs"));
}

use kernels::traverse::{Bind, Constants, Kernel};

const THREADS: usize = 2;
/// Number of rays that a host thread takes at a time.
const CHUNK: usize = 4096;
/// How rays are launched.
#[derive(Clone, Copy)]
struct Launch {
    /// Rays along each edge of the film that they bounce from.
    side: u32,
    /// Rays that a thread traces one after the other.
    per_thread: u32,
}

/// A CPU has few lanes to keep busy: those that finish a ray early take the next one.
const CPU: Launch = Launch { side: 512, per_thread: 128 };
/// A GPU hides the latency of its memory by hundreds of thousands of threads. Each takes as many as those of `path_extend.comp`.
const GPU: Launch = Launch { side: 2048, per_thread: 8 };

/// A hit: distance and triangle in leaf order, or [`NONE`] on a miss. For any-hit rays a hit can have any values.
type Found = (f32, u32);

/// The bounce of the ray through pixel `i`, from the hall of Sponza towards its far end; `None` if that leaves the scene.
fn bounce(scene: &Loaded, side: u32, i: u32) -> Option<RayQuery> {
    let [low, high] = scene.bounds.map(Vec3::from);
    let eye = low + (high - low) * Vec3::new(0.2, 0.3, 0.5);
    let random = sampler_start(i, 0, 1, true);
    let film = 2.0 * (vec2((i % side) as f32, (i / side) as f32) + 0.5) / side as f32 - vec2(1.0, 1.0);
    let direction = Vec3::new(1.0, -film.y, film.x).normalize();
    let hit = traverse(scene, eye, direction, INFINITE_DISTANCE, false, 0);
    if !hit.any() {
        return None;
    }
    let s = surface_at(scene, &hit);
    let normal = if s.geometric.dot(direction) > 0.0 { -s.geometric } else { s.geometric };
    let direction = basis_from_normal(normal) * warp_cosine_hemisphere(sample_2d(random, 1));
    let origin = s.ray_origin(normal).to_array();
    let direction = direction.normalize().to_array();
    Some(RayQuery { origin, t_max: INFINITE_DISTANCE, direction, mask_seed: 0, ..Default::default() })
}

/// Traversal by obvhs of the nodes that Tallow built with it.
struct Host {
    bvh: CwBvh,
    triangles: Vec<RtTriangle>,
    rays: Vec<Ray>,
    threads: rayon::ThreadPool,
}

impl Host {
    fn new(scene: &Loaded, rays: &[RayQuery]) -> Result<Self> {
        let triangle = |t: &layout::Triangle| RtTriangle::new(t.v0.into(), t.v1.into(), t.v2.into());
        let ray = |r: &RayQuery| Ray::new_inf(Vec3A::from(r.origin), Vec3A::from(r.direction));
        let nodes = scene.nodes.iter().map(|n| bytemuck::cast(*n)).collect();
        Ok(Self {
            bvh: CwBvh { nodes, ..CwBvh::default() },
            triangles: scene.triangles.iter().map(triangle).collect(),
            rays: rays.iter().map(ray).collect(),
            threads: rayon::ThreadPoolBuilder::new().num_threads(THREADS).build()?,
        })
    }

    fn closest(&self, ray: &Ray) -> Found {
        let mut hit = HostHit::none();
        self.bvh.ray_traverse(*ray, &mut hit, |ray, i| self.triangles[i].intersect(ray));
        (hit.t, hit.primitive_id)
    }

    fn any(&self, ray: &Ray) -> Found {
        let miss = self.bvh.ray_traverse_miss(*ray, |ray, i| self.triangles[i].intersect(ray));
        (0.0, if miss { NONE } else { 0 })
    }

    /// Traces all rays and returns the seconds and the hits.
    fn run(&self, any_hit: bool) -> (f64, Vec<Found>) {
        let begun = Instant::now();
        let rays = || self.rays.par_iter().with_min_len(CHUNK);
        let found = self.threads.install(|| match any_hit {
            true => rays().map(|r| self.any(r)).collect(),
            false => rays().map(|r| self.closest(r)).collect(),
        });
        (begun.elapsed().as_secs_f64(), found)
    }
}

/// The traversal kernel and its buffers.
struct Device {
    gpu: Gpu,
    frame: FrameResources,
    kernel: Kernel,
    renderer: Renderer,
    rays: Buffer<RayQuery>,
    hits: Buffer<RayHit>,
    root: u32,
    per_thread: u32,
}

impl Device {
    fn new(gpu: Gpu, scene: &Loaded, rays: &[RayQuery], per_thread: u32) -> Result<Self> {
        // obvhs does not support masks, so neither side tests them.
        let effects = Effects { dealt_triangles: true, ..Effects::default() };
        let traverse = gpu.tuning().traverse(scene.stack);
        let thread = gpu.tuning().thread();
        let constants = Constants { effects, traverse, thread, deal: gpu.deal(), ..Default::default() };
        Ok(Self {
            frame: FrameResources::new(&gpu)?,
            kernel: Kernel::new(&gpu, &constants)?,
            renderer: Renderer::specialised(&gpu, scene, &scene.settings, Outputs::default(), effects)?,
            rays: Buffer::from_slice(&gpu, "rays", rays)?,
            hits: Buffer::new(&gpu, "hits", rays.len(), Location::Device)?,
            root: scene.root,
            per_thread,
            gpu,
        })
    }

    fn threads(&self) -> u32 {
        (self.rays.len() as u32).div_ceil(self.per_thread)
    }

    /// Traces all rays and returns the seconds by the device's timestamps.
    fn trace(&mut self, any_hit: bool) -> Result<f64> {
        let count = self.rays.len() as u32;
        let push = TraversePush { count, root: self.root, any_hit: u32::from(any_hit), ..Default::default() };
        let s = self.renderer.scene();
        let threads = self.threads();
        let times = self.gpu.run(&mut self.frame, |rec| {
            let bind = Bind { scene: s.bind(), ray_query: s.bind_world(), rays: &self.rays, hits: &self.hits };
            rec.dispatch_threads(&self.kernel, bind, &push, threads)
        })?;
        let pass = times.first().context("the device has no timestamps")?;
        Ok(pass.duration_ns() as f64 * 1e-9)
    }

    /// The hits of the last rays.
    fn found(&self) -> Result<Vec<Found>> {
        Ok(self.hits.read()?.iter().map(|h| (h.t, h.triangle)).collect())
    }

    /// Rays per second.
    fn rate(&mut self, any_hit: bool) -> Result<f64> {
        wake(&self.gpu)?;
        Ok(self.rays.len() as f64 / self.trace(any_hit)?)
    }
}

/// Number of rays on which the two sides differ in whether they hit or, for closest hits, in the distance.
fn differing(a: &[Found], b: &[Found], any_hit: bool) -> usize {
    let differs = |(a, b): (&Found, &Found)| {
        let near = any_hit || a.1 == b.1 || (a.0 - b.0).abs() <= 1e-4 * a.0;
        (a.1 == NONE) != (b.1 == NONE) || !near
    };
    a.iter().zip(b).filter(|&pair| differs(pair)).count()
}

/// Prints a row per side and their ratio.
fn compare(name: &str, host: &Host, device: &mut Device, rounds: usize, any_hit: bool) -> Result<()> {
    device.trace(any_hit)?;
    let differ = differing(&host.run(any_hit).1, &device.found()?, any_hit); // the host is warm now
    let share = differ as f64 / host.rays.len() as f64;
    ensure!(share < 1e-3, "{name}: the two sides differ on {differ} rays");
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        theirs.push(host.rays.len() as f64 / host.run(any_hit).0 * 1e-6);
        ours.push(device.rate(any_hit)? * 1e-6);
    }
    let (ours, theirs) = (median(&ours), median(&theirs));
    println!("{name:8} {ours:8.2} Mray/s, obvhs {theirs:8.2} Mray/s, ratio {:.2}; {differ} rays differ", ours / theirs);
    Ok(())
}

fn main() -> Result<()> {
    let Some(data) = std::env::var_os("TALLOW_DATA") else {
        println!("skipped: TALLOW_DATA names no folder of outside data");
        return Ok(());
    };
    let rounds = std::env::args().nth(1).map_or(Ok(7), |n| n.parse()).context("ROUNDS is a number")?;
    let tracing = match std::env::args().nth(3).as_deref() {
        None | Some("compute") => Tracing::Compute,
        Some("ray-query") => Tracing::RayQuery,
        Some(other) => bail!("\"{other}\" is neither compute nor ray-query"),
    };
    let device = std::env::var("TALLOW_DEVICE").ok();
    let gpu = Gpu::open(&DeviceOptions { device, tracing, ..DeviceOptions::default() })?;
    let Launch { side, per_thread } = match std::env::args().nth(2).as_deref() {
        Some("cpu") => CPU,
        Some("gpu") => GPU,
        None if gpu.info().kind == DeviceKind::Cpu => CPU,
        None => GPU,
        Some(other) => bail!("\"{other}\" is neither cpu nor gpu"),
    };
    let small = |s: &mut Settings| (s.width, s.height, s.spp) = (16, 16, 1);
    let scene =
        Scene::load(&Path::new(&data).join("scenes/crytek-sponza/sponza.obj")).map(|scene| scene.with(small))?;
    let rays: Vec<_> = (0..side * side).into_par_iter().filter_map(|i| bounce(&scene, side, i)).collect();
    ensure!(rays.len() as u32 > side * side * 9 / 10, "the camera sees little of the scene");
    let host = Host::new(&scene, &rays)?;
    let mut device = Device::new(gpu, &scene, &rays, per_thread)?;
    let (info, threads) = (device.gpu.info().clone(), device.threads());
    println!("{}: {} triangles, {} rays, median of {rounds}", info.name, host.triangles.len(), rays.len());
    println!(
        "{threads} rays in flight at most, in {} subgroups of {}; each thread traces {per_thread}, one after the other",
        threads.div_ceil(info.subgroup_size),
        info.subgroup_size
    );
    compare("closest", &host, &mut device, rounds, false)?;
    compare("any", &host, &mut device, rounds, true)
}
