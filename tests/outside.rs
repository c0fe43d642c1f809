//! Every OBJ and glTF file below TALLOW_DATA/scenes loads with its textures and renders.
mod support;

use glam::Vec3;
use std::path::{Path, PathBuf};
use tallow::gpu::Gpu;
use tallow::layout::{Effect, Effects};
use tallow::render::settings::Settings;
use tallow::render::{Outputs, Renderer, all_effects, called_for};
use tallow::scene::{Loaded, Scene};

/// # Panics
/// When there is none: these tests are ignored unless asked for.
fn data() -> PathBuf {
    let found = std::env::var_os("TALLOW_DATA").expect("TALLOW_DATA must name the folder of the outside data");
    found.into()
}

fn files(directory: &Path, kinds: &[&str], found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(directory).expect("a readable directory").flatten() {
        match entry.path() {
            path if path.is_dir() => files(&path, kinds, found),
            path if path.extension().is_some_and(|e| kinds.iter().any(|kind| e == *kind)) => found.push(path),
            _ => {}
        }
    }
}

fn tiny(s: &mut Settings) {
    (s.width, s.height, s.spp) = (8, 8, 1);
}

/// Loads it. All scenes get one depth of the stack, so that those with the same effects share their kernels: nearly all of the time
/// is spent compiling them.
fn loaded(path: &Path) -> Loaded {
    let mut scene = Scene::load(path).map(|scene| scene.with(tiny)).unwrap_or_else(|e| panic!("{e}"));
    scene.stack = scene.stack.max(16);
    scene
}

/// Renders it; bytes on the device but for pictures (of textures and of the sky), and whether any light is seen.
fn rendered(gpu: &Gpu, scene: &Loaded, effects: Effects, name: &str) -> (u64, bool) {
    let (settings, outputs) = (&scene.settings, Outputs::default());
    let made = Renderer::specialised(gpu, scene, settings, outputs, effects);
    let renderer = made.unwrap_or_else(|e| panic!("{name}: {e}"));
    let sizes = renderer.scene().sizes();
    let bytes =
        sizes.iter().filter(|(part, _)| !["texels", "environment"].contains(part)).map(|(_, bytes)| bytes).sum();
    let stats = support::render(gpu, &renderer);
    assert!(stats.iter().all(|s| s.count == 1 && s.mean.iter().all(|v| v.is_finite())), "{name}: broken pixels");
    (bytes, stats.iter().any(|s| s.mean != [0.0; 3]))
}

#[test]
#[ignore = "needs TALLOW_DATA"]
fn every_obj_loads_and_renders() {
    let (data, gpu) = (data(), support::gpu());
    let mut paths = Vec::new();
    files(&data.join("scenes"), &["obj"], &mut paths);
    assert!(paths.len() >= 50, "only {} OBJ files below {}", paths.len(), data.display());
    paths.sort();
    let (mut seen, mut dark) = (Vec::new(), Vec::new());
    for path in paths {
        let scene = loaded(&path);
        let n = scene.triangles.len();
        let name = path.strip_prefix(&data).unwrap_or(&path).display().to_string();
        assert!(!scene.triangles.is_empty() && !scene.lights.is_empty(), "{name}");
        let missing = scene.warnings.iter().find(|w| w.contains("no such file") || w.contains("not found"));
        assert!(missing.is_none() || name.contains("gltf"), "{missing:?}");
        assert!(scene.shading.is_empty() || scene.shading.len() == n);
        // Of the poses of an animation, which a number tells apart, one is enough.
        let mesh = (name.replace(|c: char| c.is_ascii_digit(), ""), n);
        if seen.contains(&mesh) {
            continue;
        }
        seen.push(mesh);
        let effects = called_for(&scene, &scene.settings, Outputs::default());
        let (bytes, lit) = rendered(&gpu, &scene, effects, &name);
        // Two triangles have a node, materials, a light and arrays that are empty as well, many lamps a tree.
        assert!(bytes <= (200 * n + 64 * scene.lights.len() + 288) as u64, "{name}: {bytes} bytes");
        dark.extend((!lit).then_some(name));
    }
    // Rooms that are closed, and lit inside.
    println!("of {} scenes, no light leaves {dark:?}", seen.len());
    assert!(seen.len() >= 40 && dark.len() <= 4, "{} scenes, {dark:?}", seen.len());
    support::assert_silent(&gpu);
}

/// Warnings about what the renderer leaves out of a material or a mesh, of extensions, clips and primitives without a surface: all
/// others tell of a loader that reads a good file wrongly.
fn is_expected(line: &str) -> bool {
    ["in material", "in mesh", "not rendered", "is orthographic", "not played"].iter().any(|part| line.contains(part))
}

/// What a model of glTF may call for. Nearly every one has effects of its own, whose kernels would take two seconds each.
///
/// # Panics
/// When it calls for something else.
fn effects_of_gltf(scene: &Loaded, name: &str) -> Effects {
    let called_for = called_for(scene, &scene.settings, Outputs::default());
    // A few of them are lit by one sort of lamps that no other has.
    if scene.weighed_lights || scene.large_lamps && scene.has_light_tree() {
        return called_for;
    }
    let others = [
        Effect::bump_maps,
        Effect::hdr_textures,
        Effect::conductor,
        Effect::dielectric,
        Effect::coated,
        Effect::beckmann,
        Effect::spheres,
        Effect::environment_map,
        Effect::lens,
        Effect::orthographic,
        Effect::roulette,
        Effect::clamp,
        Effect::pixel_filter,
        Effect::split_light,
        Effect::counters,
        Effect::adaptive,
    ];
    let mut effects = all_effects(scene, &scene.settings);
    others.into_iter().for_each(|effect| *effects.switch(effect) = false);
    assert_eq!(effects.or(called_for), effects, "{name} calls for more");
    effects
}

#[test]
#[ignore = "needs TALLOW_DATA"]
fn every_gltf_loads_and_renders() {
    let data = data();
    let mut paths = Vec::new();
    files(&data.join("scenes"), &["gltf", "glb"], &mut paths);
    assert!(paths.len() >= 65, "only {} glTF files below {}", paths.len(), data.display());
    let gpu = support::gpu();
    let (send, loads) = std::sync::mpsc::sync_channel(1);
    let mut dark = Vec::new();
    std::thread::scope(|scope| {
        // One thread reads files, the other compiles kernels.
        scope.spawn(move || paths.into_iter().try_for_each(|path| send.send((loaded(&path), path)).ok()));
        for (scene, path) in loads {
            let name = path.strip_prefix(&data).unwrap_or(&path).display().to_string();
            let unexpected: Vec<_> = scene.warnings.iter().filter(|line| !is_expected(line)).collect();
            assert!(unexpected.is_empty() && !scene.triangles.is_empty(), "{name}: {unexpected:?}");
            let (_, lit) = rendered(&gpu, &scene, effects_of_gltf(&scene, &name), &name);
            dark.extend((!lit).then_some(name));
        }
    });
    // A camera stands within a pine of a dense forest, where no one of 64 paths may find the sky.
    assert!(dark.len() <= 1, "black: {dark:?}");
    support::assert_silent(&gpu);
}

/// The frames of `animation/fox_run` were skinned by another program, in metres where the file has centimetres.
#[test]
#[ignore = "needs TALLOW_DATA"]
fn a_skinned_fox_runs_as_another_program_has_it() {
    let scenes = data().join("scenes");
    let text = "[[mesh]]\nfile = 'gltf/Fox/Fox.glb'\nclip = 'Run'\n";
    let fox = Scene::parse(&scenes.join("scene.toml"), text).unwrap();
    // The largest distance of a corner from the nearest one of the other, in centimetres.
    let distance = |frame: u32, seconds: f64| {
        let text = std::fs::read_to_string(scenes.join(format!("animation/fox_run/fox_{frame:02}.obj"))).unwrap();
        let numbers = |line: &str| line.split(' ').filter_map(|v| v.parse::<f32>().ok()).collect::<Vec<_>>();
        let corner = |line: &str| Vec3::from_slice(&numbers(line)) * 100.0;
        let theirs: Vec<_> = text.lines().filter(|line| line.starts_with("v ")).map(corner).collect();
        let pose = fox.animation.at(seconds).unwrap();
        let ours = pose.meshes[0].1.positions.iter().map(|p| Vec3::from(*p));
        let nearest = |p: Vec3| theirs.iter().map(|q| p.distance(*q)).fold(f32::INFINITY, f32::min);
        assert_eq!((theirs.len(), pose.meshes.len()), (290, 1));
        ours.map(nearest).fold(0.0, |most, d| if d < f32::INFINITY { d.max(most) } else { f32::INFINITY })
    };
    let time = |frame: u32| f64::from(frame) / 16.0 * fox.animation.end();
    for frame in 0..16 {
        assert!(distance(frame, time(frame)) < 0.01, "frame {frame}: {} cm", distance(frame, time(frame)));
    }
    assert!(distance(4, time(5)) > 1.0, "control: another time");
}
