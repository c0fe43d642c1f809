//! Compares single hits: of rays from anywhere, and of those through pixel centres.
use crate::support::kernels::traverse as kernel;
use crate::support::{assert_silent, render, words};
use crate::{both, scenes};
use glam::Vec3;
use tallow::gpu::{Buffer, FrameResources, Gpu, Kernel, Location};
use tallow::layout::{Guide, NONE, RayHit, RayQuery, TraversePush};
use tallow::render::{self, DeviceScene, Outputs, Renderer, frame_constants};
use tallow::scene::Loaded;

const RAYS: u32 = 20_000;

/// Rays from in and around the scene, most of them of any length.
fn rays(scene: &Loaded) -> Vec<RayQuery> {
    let [low, high] = scene.bounds.map(Vec3::from);
    let point = |w: &[u32]| Vec3::new(w[0] as f32, w[1] as f32, w[2] as f32) * 2f32.powi(-32);
    let ray = |(i, w): (usize, &[u32])| RayQuery {
        origin: (low + (high - low) * (1.4 * point(w) - 0.2)).into(),
        t_max: if i.is_multiple_of(5) { 0.3 * (high - low).length() } else { 3e38 },
        direction: (point(&w[3..]) - 0.5).normalize().into(),
        mask_seed: (i as u32).wrapping_mul(0x9e3779b9),
        ..Default::default()
    };
    words(6 * RAYS as usize, 5).chunks_exact(6).enumerate().map(ray).collect()
}

/// `behind`: what rays meet that leave their first hits.
fn trace(gpu: &Gpu, scene: &Loaded, rays: &[RayQuery], any_hit: bool, behind: bool) -> Vec<RayHit> {
    let effects = render::called_for(scene, &scene.settings, Outputs::default());
    let s = DeviceScene::new(gpu, scene, &effects).unwrap();
    let mut constants = kernel::Constants { effects, thread: gpu.tuning().thread(), behind, ..Default::default() };
    constants.traverse.stack = scene.stack;
    let kernel = Kernel::<kernel::Bind>::new(gpu, &constants).unwrap();
    let hits = Buffer::new(gpu, "hits", rays.len(), Location::Device).unwrap();
    let rays = Buffer::from_slice(gpu, "rays", rays).unwrap();
    let root = frame_constants(scene, &scene.settings).unwrap().path.root;
    let push = TraversePush { count: RAYS, root, any_hit: any_hit.into(), ..Default::default() };
    let bind = kernel::Bind { scene: s.bind(), ray_query: s.bind_world(), rays: &rays, hits: &hits };
    gpu.run(&mut FrameResources::new(gpu).unwrap(), |rec| rec.dispatch_threads(&kernel, bind, &push, RAYS / 3))
        .unwrap();
    hits.read().unwrap()
}

/// Whether two closest hits are of one point of one surface, or of surfaces that are as near. Where triangles share an edge, either
/// may be the one that is hit.
fn agree(a: &RayHit, b: &RayHit) -> bool {
    let near = |x: f32, y: f32| (x - y).abs() <= 1e-4 * x.abs().max(1e-3);
    let same = (a.triangle, a.instance) == (b.triangle, b.instance);
    let weights = (0..2).all(|i| (a.barycentric[i] - b.barycentric[i]).abs() < 1e-3);
    (a.triangle == NONE) == (b.triangle == NONE) && near(a.t, b.t) && (!same || weights)
}

/// Share of pairs for which `holds` is wrong.
fn share<T>(a: &[T], b: &[T], holds: impl Fn(&T, &T) -> bool) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| !holds(a, b)).count() as f64 / a.len() as f64
}

#[test]
fn rays_from_anywhere_hit_the_same() {
    let gpus = both();
    for (name, scene) in scenes() {
        let rays = rays(&scene);
        let [ours, theirs] = gpus.each_ref().map(|gpu| trace(gpu, &scene, &rays, false, false));
        let hit = ours.iter().filter(|hit| hit.triangle != NONE).count() as f64 / f64::from(RAYS);
        let other = share(&ours, &theirs, |a, b| (a.triangle, a.instance) == (b.triangle, b.instance));
        let off = share(&ours, &theirs, agree);
        println!("{name}: {:.1} % hit, {other:.1e} another surface, {off:.1e} off", 100.0 * hit);
        assert!(hit > 0.1 && other < 1e-3 && off < 1e-3, "{name}: {hit} hit, {other} another surface, {off} off");
        // Control: the comparison tells a ray from the next.
        assert!(share(&ours[1..], &theirs[..theirs.len() - 1], agree) > 0.1, "{name}");
        let [ours, theirs] = gpus.each_ref().map(|gpu| trace(gpu, &scene, &rays, true, false));
        let off = share(&ours, &theirs, blocked_alike);
        assert!(off < 1e-3, "{name}: of rays that look for any hit {off} disagree");
    }
    gpus.iter().for_each(assert_silent);
}

fn blocked_alike(a: &RayHit, b: &RayHit) -> bool {
    (a.triangle == NONE) == (b.triangle == NONE)
}

/// From where they start, they would meet that surface again.
#[test]
fn rays_pass_the_surface_that_they_leave() {
    let gpus = both();
    for (name, scene) in scenes() {
        let rays = rays(&scene);
        let first = trace(&gpus[0], &scene, &rays, false, false);
        let [ours, theirs] = gpus.each_ref().map(|gpu| trace(gpu, &scene, &rays, false, true));
        let off = share(&ours, &theirs, agree);
        println!("{name}: {off:.1e} off");
        assert!(off < 1e-3, "{name}: {off} off");
        assert!(share(&first, &ours, agree) > 0.05, "{name}: control, a ray that meets the same again");
        let [ours, theirs] = gpus.each_ref().map(|gpu| trace(gpu, &scene, &rays, true, true));
        let off = share(&ours, &theirs, blocked_alike);
        assert!(off < 1e-3, "{name}: of rays that look for any hit {off} disagree");
    }
    gpus.iter().for_each(assert_silent);
}

#[test]
fn pixel_centres_see_the_same() {
    let gpus = both();
    let outputs = Outputs { guides: true, ..Outputs::default() };
    for (name, scene) in scenes() {
        let [ours, theirs] = gpus.each_ref().map(|gpu| {
            let renderer = Renderer::new(gpu, &scene, &scene.settings, outputs).unwrap();
            render(gpu, &renderer);
            renderer.film().tiles[0].guide.read().unwrap()
        });
        let alike = |a: &Guide, b: &Guide| {
            let near = |x: f32, y: f32| (x - y).abs() <= 1e-3 * x.abs().max(1.0);
            let parts = a.normal.iter().zip(&b.normal).chain(a.albedo.iter().zip(&b.albedo));
            a.object == b.object
                && a.material == b.material
                && near(a.depth, b.depth)
                && parts.into_iter().all(|(a, b)| near(*a, *b))
        };
        let off = share(&ours, &theirs, alike);
        println!("{name}: {off:.1e} of the pixels off");
        assert!(off <= 2e-3, "{name}: {off} of the pixels differ");
    }
    gpus.iter().for_each(assert_silent);
}
