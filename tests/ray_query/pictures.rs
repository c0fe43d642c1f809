//! Compares whole pictures by z-tests: of scenes at rest, and of one that moves.
use crate::alike::alike;
use crate::poses::{MOMENTS, Moment, at, pose};
use crate::support::{assert_silent, render};
use crate::{both, open_tuned, scenes};
use tallow::gpu::{FrameResources, Gpu, Tracing, Tuning};
use tallow::layout::PixelStats;
use tallow::render::{Outputs, Renderer};
use tallow::scene::Loaded;

fn renderer(gpu: &Gpu, scene: &Loaded) -> Renderer {
    Renderer::new(gpu, scene, &scene.settings, Outputs::default()).unwrap()
}

#[test]
fn pictures_are_alike() {
    let gpus = both();
    let all = scenes();
    for (name, scene) in &all {
        let [ours, theirs] = gpus.each_ref().map(|gpu| render(gpu, &renderer(gpu, scene)));
        alike(&ours, &theirs, all.len()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let brighter = |s: &PixelStats| PixelStats { mean: s.mean.map(|v| v * 1.02), ..*s };
        let wrong: Vec<_> = theirs.iter().map(brighter).collect();
        assert!(alike(&ours, &wrong, all.len()).is_err(), "{name}: control");
    }
    gpus.iter().for_each(assert_silent);
}

/// The structures follow instances that move, are mirrored and hidden, and meshes that are deformed and whose triangles get another
/// order.
#[test]
fn pictures_of_what_moves_are_alike() {
    let gpus = both();
    let hidden = Moment { scale: 0.0, ..Moment::default() };
    let moments: Vec<_> = MOMENTS.into_iter().chain([hidden]).collect();
    for rebuild_above in [f32::INFINITY, 0.0] {
        let pictures = gpus.each_ref().map(|gpu| {
            let mut scene = at(&Moment::default()).with(|s| s.spp = 16);
            let (mut renderer, mut frame) = (renderer(gpu, &scene), FrameResources::new(gpu).unwrap());
            let mut at_moment = |moment: &Moment| {
                let pose = pose(&scene, moment, rebuild_above);
                let change = scene.apply(&pose).unwrap();
                gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change)).unwrap();
                render(gpu, &renderer)
            };
            moments.iter().map(&mut at_moment).collect::<Vec<_>>()
        });
        for (number, (ours, theirs)) in pictures[0].iter().zip(&pictures[1]).enumerate() {
            let case = format!("{:?}, built anew above {rebuild_above}", moments[number]);
            alike(ours, theirs, 2 * moments.len()).unwrap_or_else(|e| panic!("{case}: {e}"));
            let before = &pictures[1][(number + moments.len() - 1) % moments.len()];
            assert!(alike(ours, before, 2 * moments.len()).is_err(), "{case}: control");
        }
    }
    gpus.iter().for_each(assert_silent);
}

#[test]
fn a_wavefront_leaves_the_bits_of_pictures() {
    let [_, usual] = both();
    let tuning = Some(Tuning { wavefront: true, ..*usual.tuning() });
    let wavefront = open_tuned(Tracing::RayQuery, tuning).unwrap();
    for (name, scene) in &scenes() {
        let [one, other] = [&usual, &wavefront].map(|gpu| render(gpu, &renderer(gpu, scene)));
        assert!(one == other, "{name}");
    }
    [usual, wavefront].iter().for_each(assert_silent);
}

#[test]
fn nothing_is_left_when_the_device_closes() {
    let [_, gpu] = both();
    let log = gpu.validation_log();
    let scene = at(&Moment::default());
    let renderer = renderer(&gpu, &scene);
    render(&gpu, &renderer);
    let without = renderer.scene().sizes().iter().all(|(part, _)| *part != "acceleration");
    assert!(!without, "the structures count as memory of the scene");
    drop((renderer, gpu));
    assert_eq!(*log.lock().unwrap(), Vec::<String>::new());
}
