//! Tests rays that the device traces by itself (VK_KHR_ray_query) against those of the kernels. Debian 12's own driver cannot do so:
//! `tools/test` runs these tests on another, and `tools/with-ray-query` brings it.
#[path = "../support/alike.rs"]
mod alike;
#[allow(dead_code)]
#[cfg(feature = "cli")]
#[path = "../support/command.rs"]
mod command;
mod engine;
#[path = "../support/glazed.rs"]
mod glazed;
mod hits;
mod pictures;
#[path = "../support/poses.rs"]
mod poses;
#[path = "../support/statistics.rs"]
mod statistics;
#[path = "../support/mod.rs"]
mod support;

use std::path::Path;
use tallow::error::{Error, Result};
use tallow::gpu::{DeviceOptions, Gpu, Tracing, Tuning};
use tallow::layout::MATERIAL_MASKED;
use tallow::render::settings::Settings;
use tallow::scene::{Loaded, Scene};

fn open(tracing: Tracing) -> Result<Gpu> {
    open_tuned(tracing, None)
}

fn open_tuned(tracing: Tracing, tuning: Option<Tuning>) -> Result<Gpu> {
    let device = std::env::var("TALLOW_DEVICE").ok();
    Gpu::open(&DeviceOptions { device, validation: true, tracing, tuning, ..DeviceOptions::default() })
}

/// A device that traces by its kernels, and one that does so by itself.
fn both() -> [Gpu; 2] {
    [Tracing::Compute, Tracing::RayQuery]
        .map(|tracing| open(tracing).unwrap_or_else(|e| panic!("this test needs tools/with-ray-query: {e}")))
}

/// A scene that the repository ships, on a small film.
fn shipped(file: &str) -> Loaded {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
    let small = |s: &mut Settings| (s.width, s.height, s.spp, s.max_depth) = (48, 32, 16, 4);
    Scene::load(&path).unwrap().with(small)
}

/// The same with surfaces that let some rays pass.
fn masked(mut scene: Loaded) -> Loaded {
    for material in &mut scene.materials {
        material.opacity = 0.6;
        material.flags |= MATERIAL_MASKED;
    }
    scene
}

/// Blocks and balls in turn, which lie mixed in leaf order.
fn balls_among_blocks() -> Loaded {
    let one = |i: u32| {
        let at = format!("translate = [{}, {}, 0], scale = 0.3", i % 6, i / 6);
        let mesh = |shape: &str, z: u32| {
            format!("[[mesh]]\nshape = '{shape}'\ntransform = {{ {at}, rotate = [0, {z}, 0] }}\n")
        };
        mesh(["cube", "sphere"][i as usize % 2], i)
    };
    let text: String = ["[environment]\n".to_owned()].into_iter().chain((0..36).map(one)).collect();
    Scene::parse(Path::new("scene.toml"), &text).unwrap().with(|s| (s.width, s.height, s.spp) = (48, 32, 16))
}

/// One of each kind: a single level, spheres among its triangles, instances with a sphere among them, masks on such, and panes.
fn scenes() -> [(&'static str, Loaded); 7] {
    let moving = || poses::at(&poses::MOMENTS[2]).with(|s| s.spp = 16);
    [
        ("Cornell box", shipped("cornell-box/scene.toml")),
        ("box with a ball", shipped("cornell-box/glass.toml")),
        ("balls among blocks", balls_among_blocks()),
        ("instances", moving()),
        ("masked box", masked(shipped("cornell-box/scene.toml"))),
        ("masked instances", masked(moving())),
        ("panes", glazed::glazed(shipped("grass/scene.toml"))),
    ]
}

#[test]
fn a_device_without_it_says_what_it_lacks() {
    let gpu = open(Tracing::Compute).unwrap();
    assert!(!gpu.traces_by_ray_query());
    assert!(!open(Tracing::Auto).unwrap().traces_by_ray_query(), "not before it was measured");
    match (open(Tracing::RayQuery), &gpu.info().ray_query_lacks[..]) {
        (Ok(rays), []) => assert!(rays.traces_by_ray_query()),
        (Err(Error::Device(text)), lacks @ [first, ..]) => {
            assert!(lacks.iter().all(|name| text.contains(name)), "{text}");
            assert!(text.contains(&gpu.info().name) && text.contains("choose the tracing \"compute\""), "{text}");
            assert!(first.starts_with("VK_KHR_") || gpu.info().kind != tallow::gpu::DeviceKind::Cpu, "{first}");
        }
        (other, lacks) => panic!("{:?}, and it lacks {lacks:?}", other.map(|_| ())),
    }
    support::assert_silent(&gpu);
}

/// The words of the option, and how the program ends.
#[cfg(feature = "cli")]
#[test]
fn the_program_renders_or_says_why_not() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    let small = ["--width", "16", "--height", "16", "--spp", "1", "--quiet", "--validation", "-o", "a.exr"];
    let render = |tracing| command::tallow(&folder, &[&["render", scene, "--tracing", tracing], &small[..]].concat());
    assert!(render("compute").status.success() && render("auto").status.success());
    let by_ray_query = render("ray-query");
    match open(Tracing::RayQuery) {
        Ok(_) => assert!(by_ray_query.status.success(), "{by_ray_query:?}"),
        Err(_) => command::complains(&by_ray_query, 4, &["cannot trace by ray queries", "lacks", "compute"]),
    }
    command::complains(&render("embree"), 2, &["embree", "ray-query"]);
}

/// A measurement tells who traced, and so do the commands that render its points again; one by the kernels is not continued by it.
#[cfg(feature = "cli")]
#[test]
fn a_measurement_tells_who_found_what_rays_meet() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    let words = "--allocate uniform --denoise none --spp 1 --repeats 3 --width 16 --height 16 --reference-spp 64 --quiet -o all";
    let cost = |tracing| {
        let words = ["cost", scene, "--tracing", tracing].into_iter().chain(words.split(' ')).collect::<Vec<_>>();
        let output = command::tallow(&folder, &words);
        assert!(output.status.success(), "{output:?}");
        let text = std::fs::read(folder.path().join("all/cost.json")).unwrap();
        serde_json::from_slice::<tallow::cost::Document>(&text).unwrap()
    };
    let [kernels, queries] = ["compute", "ray-query"].map(cost);
    let told = |document: &tallow::cost::Document| {
        let point = &document.points[0];
        let in_command = point.command.contains("--tracing ray-query");
        assert_eq!(in_command, document.machine.ray_queries, "{:?}", point.command);
        in_command
    };
    assert_eq!([&kernels, &queries].map(told), [false, true]);
    assert_ne!(kernels.measurement.key, queries.measurement.key);
}
