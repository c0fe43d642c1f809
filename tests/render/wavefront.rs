//! Tests that paths traced by a wavefront have the bits of those that a thread traces from end to end, at sizes that fill neither
//! workgroups nor batches, and where it is used.
use crate::glazed::glazed;
use crate::support::{assert_silent, render_steps, tuned_gpu};
use crate::tuning::{OUTPUTS, bits, film, scene};
use crate::twin::{BULB, SUN, many_lamps_and};
use tallow::gpu::{FrameResources, Gpu, Tuning};
use tallow::layout::{BSDF_DIELECTRIC, MATERIAL_MASKED, Material};
use tallow::profile::work::FrameWork;
use tallow::profile::{Amount, Workload};
use tallow::render::settings::{Sampler, Settings};
use tallow::render::{Job, Outputs, Renderer, traces_paths};
use tallow::scene::Loaded;

/// A bust of smooth glass, where paths take one of two ways, on stone that lets some rays pass.
fn glass() -> Loaded {
    let mut scene = scene("bust/scene.toml", "uniform");
    let (kind, eta, transmission, specular) = (BSDF_DIELECTRIC, [1.5; 3], [0.9, 1.0, 0.8], [1.0; 3]);
    let floor = scene.materials[2];
    scene.materials[0] = Material { kind, eta, transmission, specular, alpha: 0.0, ..floor };
    for stone in &mut scene.materials[1..] {
        (stone.opacity, stone.flags) = (0.6, stone.flags | MATERIAL_MASKED);
    }
    scene.with(|s| s.max_depth = 8)
}

/// A bulb that some places choose most often, and a sun that others do, beside many lamps.
fn key_lights() -> Loaded {
    many_lamps_and(3, &[BULB, SUN].concat())
}

/// Batches of a hundred paths, of which a thread traces up to eight.
fn gpus() -> [Gpu; 2] {
    [false, true].map(|wavefront| tuned_gpu(Tuning { wavefront, paths_in_flight: 100, deals: false, ..Tuning::CPU }))
}

#[test]
fn films_of_any_size_have_the_same_bits() {
    let [whole, wavefront] = gpus();
    for (file, policy) in [("grass/scene.toml", "uniform"), ("bust/scene.toml", "both")] {
        for [width, height] in [[1, 1], [31, 1], [1, 65], [11, 9]] {
            let scene = scene(file, policy).with(|s| (s.width, s.height, s.spp) = (width, height, 3));
            assert!(film(&whole, &scene) == film(&wavefront, &scene), "{file}, {width}x{height}");
        }
    }
    [whole, wavefront].iter().for_each(assert_silent);
}

#[test]
fn settings_of_all_kinds_have_the_same_bits() {
    let [whole, wavefront] = gpus();
    type Change = fn(&mut Settings);
    let changes: [(&str, Change); 5] = [
        ("one edge", |s| s.max_depth = 1),
        ("two edges", |s| s.max_depth = 2),
        ("clamp and early roulette", |s| (s.clamp_indirect, s.roulette_depth, s.max_depth) = (0.5, 1, 12)),
        ("light of some pixels", |s| s.indirect_stride = 2),
        ("independent numbers", |s| s.sampler = Sampler::Independent),
    ];
    let grass = || scene("grass/scene.toml", "uniform");
    let scenes = changes.into_iter().map(|(what, change)| (what, grass().with(change))).chain([
        ("glass and holes", glass()),
        ("panes", glazed(grass())),
        ("key lights", key_lights()),
    ]);
    for (what, scene) in scenes {
        let scene = scene.with(|s| (s.width, s.height, s.spp) = (20, 15, 4));
        assert!(film(&whole, &scene) == film(&wavefront, &scene), "{what}");
    }
    [whole, wavefront].iter().for_each(assert_silent);
}

/// A host that does not read how many pixels were chosen records steps for all of them.
#[test]
fn lists_may_be_short() {
    let scene = scene("grass/scene.toml", "threshold").with(|s| (s.width, s.height, s.spp) = (11, 9, 8));
    let films = gpus().map(|gpu| {
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, OUTPUTS).unwrap();
        let stats = render_steps(&gpu, &renderer, &renderer.steps().collect::<Vec<_>>());
        assert_silent(&gpu);
        (bits(&stats), renderer.counters().unwrap(), stats.iter().map(|s| s.count).sum::<u32>())
    });
    assert!(films[0].2 < 11 * 9 * 8, "control: some pixels were not chosen");
    assert!(films[0] == films[1]);
}

#[test]
fn it_is_used_where_scenes_are_large_and_paths_are_short() {
    let [_, gpu] = gpus();
    let passes = |file: &str, max_depth: u32| {
        let scene = scene(file, "uniform").with(|s| (s.width, s.height, s.spp, s.max_depth) = (4, 4, 1, max_depth));
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
        let times = Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap().times;
        let count = |name: &str| times.iter().filter(|t| t.name == name).count();
        let counts = ["path", "path_generate", "path_extend", "path_shade"].map(count);
        let all = times.iter().filter(|t| traces_paths(t.name)).count();
        assert_eq!(all, counts.iter().sum::<usize>(), "no other pass traces paths");
        counts
    };
    assert_eq!(passes("grass/scene.toml", 32), [0, 1, 32, 32]);
    assert_eq!(passes("grass/scene.toml", 33), [1, 0, 0, 0]);
    assert_eq!(passes("cornell-box/scene.toml", 4), [1, 0, 0, 0], "few nodes");
    assert_silent(&gpu);
}

/// Paths of one edge look for one closest hit each; those of two that leave a surface are written once more.
#[test]
fn a_profile_counts_what_waits() {
    // Two batches that fill their workgroups, whose threads are what a profile knows of paths.
    let gpu = tuned_gpu(Tuning { wavefront: true, paths_in_flight: 128, deals: false, ..Tuning::CPU });
    for max_depth in [1, 2] {
        let scene = scene("grass/scene.toml", "uniform")
            .with(|s| (s.width, s.height, s.spp, s.max_depth) = (16, 8, 2, max_depth));
        let outputs = Outputs { counters: true, ..Outputs::default() };
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
        Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
        let counters = renderer.counters().unwrap();
        let frames = Workload { gpu: &gpu, renderer: &renderer, denoiser: None }.run(1, &mut || {}).unwrap();
        let work = FrameWork { pixels: 128, split_light: false, counters }.of(&frames.timed[0].passes);
        let bytes = |name: &str| work.iter().find(|(pass, _)| pass == name).unwrap().1.bytes;
        let (paths, closest) = (256, counters.closest);
        assert!(if max_depth == 1 { closest == paths } else { closest > paths && closest < 2 * paths }, "{counters:?}");
        let shaded = 112 * closest + 144 * (closest - paths) + 16 * paths;
        assert_eq!(bytes("path_shade"), Amount { count: shaded, is_least: true });
        let traced = 80 * counters.nodes + 40 * counters.rays() + 20 * closest;
        assert_eq!(bytes("path_extend"), Amount { count: traced, is_least: true });
    }
    assert_silent(&gpu);
}
