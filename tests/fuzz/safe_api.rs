//! Calls the library without `unsafe` and with absurd numbers: it must return errors or pictures, without a signal, a panic or a
//! hang. TALLOW_FUZZ sets the cases of every target (default 100; the slower ones take a part of it).
use proptest::prelude::*;
use std::ops::ControlFlow;
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use tallow::denoise::filter::{FILTERS, FilterInput, FilterSettings, Planes};
use tallow::error::Error;
use tallow::gpu::{Buffer, DeviceOptions, FrameResources, Gpu, Location};
use tallow::image::{Film, Samples, WriteOptions};
use tallow::layout::*;
use tallow::render::pass::choose::Choose;
use tallow::render::pass::sample_list::Batches;
use tallow::render::settings::Settings;
use tallow::render::{
    Batch, Choice, Job, Outputs, PathRange, Plan, Renderer, Share, Status, Step, called_for, frame_constants,
};
use tallow::scene::{Loaded, Scene};
use tallow::shaders::shared;
use tallow::twins::path::{Strategy as Ways, Tracer};

fn number() -> u32 {
    std::env::var("TALLOW_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(100)
}

fn cases(share: u32) -> ProptestConfig {
    let cases = number().div_ceil(share);
    ProptestConfig { cases, failure_persistence: None, max_shrink_iters: 20, ..ProptestConfig::default() }
}

static GPU: LazyLock<Gpu> = LazyLock::new(|| {
    let device = std::env::var("TALLOW_DEVICE").ok();
    Gpu::open(&DeviceOptions { device, validation: true, ..DeviceOptions::default() }).expect("a Vulkan device")
});

fn assert_silent() {
    assert_eq!(GPU.validation_messages(), Vec::<String>::new());
}

const TEXT: &str = "
[film]
width = 5
height = 4
[render]
spp = 2
max_depth = 4
[camera]
position = [1, 2, 6]
target = [0, 0, 0]
[environment]
file = \"sky.exr\"
[[material]]
name = \"wall\"
color_texture = \"checks.png\"
opacity_texture = \"checks.png\"
[[material]]
name = \"lamp\"
emission = [4, 3, 2]
[[mesh]]
name = \"wall\"
shape = \"sphere\"
segments = 8
material = \"wall\"
[[mesh]]
name = \"lamp\"
shape = \"cube\"
material = \"lamp\"
[[instance]]
mesh = \"lamp\"
transform = { translate = [0, 0, 2] }
[[instance]]
mesh = \"lamp\"
transform = { translate = [2, 0, 2] }
[[light]]
type = \"point\"
position = [0, 3, 0]
intensity = 10
";

/// A scene of two levels with every kind of array.
static SCENE: LazyLock<Loaded> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("a folder");
    let mut sky = Film::new(8, 4);
    sky.add("Y", Samples::F32((0..32).map(|i| i as f32).collect()));
    tallow::image::write(&folder.path().join("sky.exr"), &sky, &WriteOptions::default()).expect("written");
    let texel = |x, y| image::Rgba([x as u8 * 60, y as u8 * 60, 7, x as u8 * 80]);
    image::RgbaImage::from_fn(3, 4, texel).save(folder.path().join("checks.png")).expect("written");
    let scene = Scene::parse(&folder.path().join("s.toml"), TEXT).expect("a scene");
    let arrays =
        [scene.nodes.len(), scene.instances.len(), scene.shading.len(), scene.textures.len(), scene.lights.len()];
    assert!(arrays.iter().all(|&len| len > 0) && scene.environment.is_some(), "{arrays:?}");
    scene
});

/// Numbers that are right, nearly right, and far off.
fn word() -> impl Strategy<Value = u32> {
    let special = [NONE, NONE - 1, 1 << 31, i32::MAX as u32, 268_435_455, f32::NAN.to_bits(), f32::INFINITY.to_bits()];
    prop_oneof![
        6 => 0u32..12,
        3 => 0u32..300,
        2 => prop::sample::select(special.to_vec()),
        1 => any::<u32>(),
        1 => any::<f32>().prop_map(f32::to_bits),
    ]
}

/// Of five of which each has a range, seldom all are right by chance.
fn mostly_valid() -> impl Strategy<Value = f32> {
    prop_oneof![9 => 0.01f32..1.0, 1 => any::<f32>()]
}

/// Overwrites a word of an array, or changes its length.
fn scribble<T: bytemuck::Pod>(array: &mut Vec<T>, at: usize, value: u32, resize: bool) {
    if resize {
        array.resize(value as usize % 300, T::zeroed());
    } else if !array.is_empty() {
        let words: &mut [u32] = bytemuck::cast_slice_mut(array);
        let count = words.len();
        words[at % count] = value;
    }
}

/// One edit of what a caller may edit.
fn edit(scene: &mut Loaded, part: u32, at: usize, value: u32, resize: bool) {
    let sky = scene.environment.get_or_insert_default();
    match part % 20 {
        0..=2 => scribble(&mut scene.nodes, at, value, resize),
        3 => scribble(&mut scene.triangles, at, value, resize),
        4 => scribble(&mut scene.shading, at, value, resize),
        5 | 6 => scribble(&mut scene.instances, at, value, resize),
        7 => scribble(&mut scene.materials, at, value, resize),
        8 => scribble(&mut scene.textures, at, value, resize),
        9 => scribble(&mut scene.texels, at, value, resize),
        10 => scribble(&mut scene.lights, at, value, resize),
        11 => scribble(&mut scene.light_table, at, value, resize),
        12 => scribble(&mut sky.table, at, value, resize),
        13 => scribble(&mut sky.texels, at, value, resize),
        14 if resize => sky.width = value,
        14 => sky.height = value,
        15 => scene.root = value,
        16 => scene.stack = value,
        17 => {
            let number = f32::from_bits(value);
            match at % 4 {
                0 => scene.view.near = number,
                1 => scene.view.lens_radius = number,
                2 => scene.view.fov = Some(number.into()),
                _ => scene.view.position = Some([number.into(), 1.0, 2.0]),
            }
        }
        18 => scribble(&mut scene.light_nodes, at, value, resize),
        _ if resize => scene.names = Default::default(),
        _ => scene.settings.max_depth = value,
    }
}

/// Of the scenes that are taken, so many go to the device, which compiles kernels for each.
static RENDERED: AtomicU32 = AtomicU32::new(0);

/// The twin looks every index up in a slice: what it survives leads nowhere else in a kernel either.
fn trace_by_twin(scene: &Loaded) {
    let tracer = Tracer {
        scene,
        frame: frame_constants(scene, &scene.settings).unwrap(),
        effects: Effects::ALL,
        strategy: Ways::Both,
    };
    (0..scene.settings.pixels() as u32).for_each(|pixel| assert!(tracer.sample(pixel, 0).rays > 0));
}

/// Each word of the small arrays in turn becomes an index that leads nowhere.
#[test]
fn no_index_goes_unchecked() {
    let mut refused = 0;
    // The numbers by which `edit` knows instances, materials, textures and lights.
    for (part, at) in [5, 7, 8, 10].into_iter().flat_map(|part| (0..200).map(move |at| (part, at))) {
        let mut scene = SCENE.clone();
        edit(&mut scene, part, at, NONE - 1, false);
        match scene.check() {
            Ok(()) => trace_by_twin(&scene),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 20, "{refused}");
}

fn try_scene(scene: &Loaded) {
    called_for(scene, &scene.settings, Outputs::default());
    let camera = || frame_constants(scene, &scene.settings).map(|_| ());
    let checked = scene.check().and(scene.settings.validate()).and_then(|()| camera());
    if let Err(error) = checked {
        assert!(matches!(error, Error::Scene(_) | Error::Usage(_)) && !error.to_string().contains('\n'), "{error}");
        assert!(Renderer::new(&GPU, scene, &scene.settings, Outputs::default()).is_err());
        return;
    }
    let scene = &scene.clone().with(|s| s.max_depth = s.max_depth.min(4));
    trace_by_twin(scene);
    if RENDERED.fetch_add(1, Relaxed) < number().div_ceil(10) {
        let outputs = Outputs { split_light: true, guides: true, counters: true };
        let renderer = Renderer::new(&GPU, scene, &scene.settings, outputs).expect("a scene that fits");
        let mut frame = FrameResources::new(&GPU).expect("a frame");
        Job::new(&renderer).run_to_end(&mut frame).expect("a device that goes on");
    }
}

fn step() -> impl Strategy<Value = Step> {
    let few = || prop_oneof![4 => 0u32..24, 1 => any::<u32>()];
    let wide = || prop_oneof![4 => 0u64..64, 1 => any::<u64>()];
    let share = prop_oneof![
        Just(Share::Next),
        any::<u64>().prop_map(Share::All),
        (any::<f32>(), any::<u32>()).prop_map(|(threshold, limit)| Share::Need { threshold, limit }),
    ];
    let pixels = || prop_oneof![4 => Just(20u32), 1 => any::<u32>()];
    prop_oneof![
        Just(Step::Start),
        (few(), few(), any::<u32>(), few()).prop_map(|(first_pixel, pixels, first_sample, samples)| {
            Step::Uniform(Batch { first_pixel, pixels, first_sample, samples })
        }),
        (pixels(), wide(), prop::option::of(any::<u32>()), share, few()).prop_map(
            |(pixels, budget, limit, share, rounds)| Step::Allocate(Plan { pixels, budget, limit, share, rounds })
        ),
        (pixels(), any::<u32>(), any::<f32>()).prop_map(|(pixels, round, threshold)| Step::Choose(Choice {
            pixels,
            round,
            threshold
        })),
        (wide(), few(), few(), few()).prop_map(|(first, paths, round, rounds)| Step::Listed(PathRange {
            first,
            paths,
            round,
            rounds
        })),
    ]
}

/// Renderers of three policies, each with the frame that it records into.
fn renderers() -> Vec<Renderer> {
    let made = |policy: &str| {
        let mut scene = SCENE.clone();
        scene.settings.allocate.policy = tallow::allocate::policy(policy).unwrap();
        Renderer::new(&GPU, &scene, &scene.settings, Outputs { split_light: true, guides: true, counters: true })
            .expect("a renderer")
    };
    ["uniform", "both", "threshold"].map(made).into()
}

proptest! {
    #![proptest_config(cases(1))]

    #[test]
    fn edited_scenes(edits in prop::collection::vec((any::<u32>(), any::<usize>(), word(), prop::bool::weighted(0.1)), 1..4)) {
        let mut scene = SCENE.clone();
        edits.iter().for_each(|&(part, at, value, resize)| edit(&mut scene, part, at, value, resize));
        try_scene(&scene);
        assert_silent();
    }

    #[test]
    fn settings(numbers in [word(), word(), word(), word(), word(), word(), word(), word()], floats in [mostly_valid(), mostly_valid(), mostly_valid(), mostly_valid(), mostly_valid()]) {
        let mut scene = SCENE.clone();
        let s = &mut scene.settings;
        // Films of a size that memory holds, or of one that is refused.
        let edge = |n: u32| if n < 100 { n } else { n.max(Settings::MAX_EDGE + 1) };
        (s.width, s.height, s.spp, s.max_depth) = (edge(numbers[0]), edge(numbers[1]), numbers[2], numbers[3]);
        (s.first_sample, s.roulette_depth, s.seed, s.clamp_indirect) = (numbers[4], numbers[5], numbers[6], floats[0]);
        let a = &mut s.allocate;
        (a.min_spp, a.max_spp, a.rounds, a.geometry.window) = (numbers[7], numbers[0], numbers[1], numbers[2]);
        (a.geometry.sigma_normal, a.geometry.sigma_position, a.noise_threshold, a.both.filtered) = (floats[1], floats[2], floats[3], floats[4]);
        a.policy = tallow::allocate::POLICIES[numbers[3] as usize % tallow::allocate::POLICIES.len()];
        let renderer = Renderer::new(&GPU, &scene, &scene.settings, Outputs::default());
        let s = &scene.settings;
        if s.validate().is_err() {
            prop_assert!(renderer.is_err());
        } else if [s.width, s.height, s.spp.max(s.allocate.max_spp), s.max_depth, 1].iter().map(|&n| u64::from(n)).product::<u64>() < 1 << 14 {
            prop_assert!(Job::new(&renderer.unwrap()).run_to_end(&mut FrameResources::new(&GPU).unwrap()).is_ok());
        }
    }

    #[test]
    fn buffers(edits in prop::collection::vec((0u32..5, word(), word(), any::<u32>()), 1..12)) {
        let words: Vec<u32> = (0..200).collect();
        let (buffer, other) = (Buffer::from_slice(&GPU, "one", &words).unwrap(), Buffer::from_slice(&GPU, "other", &words).unwrap());
        let (mut frame, mut twin) = (FrameResources::new(&GPU).unwrap(), words);
        for (what, from, to, value) in edits {
            let (from, to) = (from as usize, to as usize);
            match what {
                0 => {
                    let values = vec![value; to % 300];
                    let fits = from + values.len() <= 200;
                    prop_assert_eq!(buffer.write(from, &values).is_ok(), fits);
                    if fits { twin[from..from + values.len()].fill(value); }
                }
                1 => prop_assert_eq!(buffer.read_range(from..to).ok(), twin.get(from..to).map(<[u32]>::to_vec)),
                2 => if let Ok(part) = buffer.part(from * 64 % 256..to) {
                    gpu_run(&mut frame, |rec| rec.fill(&part, value));
                    twin[from * 64 % 256..to].fill(value);
                },
                3 => {
                    gpu_run(&mut frame, |rec| rec.copy(&buffer, &other));
                    prop_assert_eq!(&other.read().unwrap(), &twin);
                }
                _ => prop_assert!(GPU.run(&mut frame, |rec| rec.copy(&buffer, &buffer)).is_err()),
            }
        }
        prop_assert_eq!(buffer.read().unwrap(), twin);
        assert_silent();
    }
}

fn gpu_run(frame: &mut FrameResources, record: impl FnOnce(&mut tallow::gpu::Recorder) -> tallow::error::Result<()>) {
    GPU.run(frame, record).expect("work that fits");
}

proptest! {
    #![proptest_config(cases(10))]

    #[test]
    fn steps(all in prop::collection::vec(step(), 1..40)) {
        static RENDERERS: LazyLock<Vec<Renderer>> = LazyLock::new(renderers);
        let mut frame = FrameResources::new(&GPU).unwrap();
        for (renderer, step) in RENDERERS.iter().flat_map(|r| all.iter().map(move |step| (r, step))) {
            if let Err(error) = renderer.run(&mut frame, step) {
                prop_assert!(matches!(error, Error::Usage(_)), "{step:?}: {error}");
            }
        }
        prop_assert!(RENDERERS[1].priorities_of(&[], 1).is_err() && RENDERERS[1].look_up(&[], &[], 1).is_err());
        assert_silent();
    }

    /// What is in a renderer's buffers is any caller's to write; kernels follow it to no other memory.
    #[test]
    fn scribbled_buffers(words in prop::collection::vec((0usize..12, any::<usize>(), word()), 1..40)) {
        static RENDERER: LazyLock<Renderer> = LazyLock::new(|| renderers().remove(1));
        let (s, f) = (RENDERER.scene(), RENDERER.film());
        let mut frame = FrameResources::new(&GPU).unwrap();
        let mut scribble = |_: &Status| {
            for &(buffer, at, value) in &words {
                match buffer {
                    0..=3 => poke(&s.nodes, at, value),
                    4 => poke(&s.triangles, at, value),
                    5 => poke(&s.instances, at, value),
                    6 => poke(&s.materials, at, value),
                    7 => poke(&s.textures, at, value),
                    8 => poke(&s.lights, at, value),
                    9 => poke(&s.light_table, at, value),
                    10 => poke(&f.counts.offset, at, value),
                    _ => poke(&f.tiles[0].stats, at, value),
                }
            }
            Ok(ControlFlow::Continue(()))
        };
        prop_assert!(Job::new(&RENDERER).run(&mut frame, &mut scribble).is_ok());
    }

    #[test]
    fn filters(row in 0..FILTERS.len(), size in [0u32..20, 0u32..20], off in 0usize..6, radius in word()) {
        let [width, height] = size;
        let settings = FilterSettings::default().with(|s| s.footprint.radius = radius);
        let Ok(filter) = FILTERS[row].compile(&GPU, &settings, size) else {
            prop_assert!(settings.validate().is_err() || size.contains(&0));
            return Ok(());
        };
        let pixels = (width * height) as usize;
        let input = FilterInput {
            width,
            height,
            radiance: vec![[1.0; 4]; pixels],
            guide: vec![Guide::default(); pixels],
            variance: Some(vec![[0.5; 3]; pixels]),
        };
        let mut planes = Planes::new(&GPU, &input).unwrap();
        let longer = pixels + 1;
        match off {
            0 => planes.size = [u32::MAX; 2],
            1 => planes.size = [width + 1, height],
            2 => planes.radiance = Buffer::new(&GPU, "long", longer, Location::Device).unwrap(),
            3 => planes.guide = Buffer::new(&GPU, "long", longer, Location::Device).unwrap(),
            4 => planes.output = Buffer::new(&GPU, "long", longer, Location::Device).unwrap(),
            _ => {}
        }
        let mut frame = FrameResources::new(&GPU).unwrap();
        let run = GPU.run(&mut frame, |rec| filter.record(rec, &planes));
        prop_assert_eq!(run.is_ok(), off == 5);
        planes.pixels();
        assert_silent();
    }
}

/// Overwrites a word of a buffer.
fn poke<T: bytemuck::Pod>(buffer: &Buffer<T>, at: usize, value: u32) {
    let element = at % buffer.len();
    let mut values = buffer.read_range(element..element + 1).unwrap();
    scribble(&mut values, at, value, false);
    buffer.write(element, &values).unwrap();
}

/// The cases of the report that this file began with.
#[test]
fn stacks_indices_and_cycles_that_were_believed_once() {
    let refused = |name: &str, edit: &dyn Fn(&mut Loaded)| {
        let mut scene = SCENE.clone();
        edit(&mut scene);
        let error = Renderer::new(&GPU, &scene, &scene.settings, Outputs::default()).err();
        assert!(matches!(error, Some(Error::Scene(_))), "{name}: {error:?}");
        assert_eq!(error.unwrap().exit_code(), 3);
    };
    let root = SCENE.root as usize;
    let inner = SCENE.nodes.iter().position(|n| n.e_imask >> 24 != 0).expect("a tree");
    refused("a stack that no device has", &|s| s.stack = 268_435_455);
    refused("a stack too deep for kernels", &|s| s.stack = 33);
    refused("no stack", &|s| s.stack = 0);
    refused("a material that is not there", &|s| s.triangles[0].material = 99);
    refused("an instance's", &|s| s.instances[0].material = 99);
    refused("a root that is not there", &|s| s.root = u32::MAX);
    refused("a root that is its own instance", &|s| s.instances[0].root = s.root);
    refused("a cycle", &|s| s.nodes[inner].child_base = inner as u32);
    refused("children beyond the end", &|s| s.nodes[inner].child_base = u32::MAX);
    refused("triangles beyond the end", &|s| s.nodes.iter_mut().for_each(|n| n.primitive_base += 10_000));
    refused("instances beyond the end", &|s| s.nodes[root].primitive_base = 1);
    refused("a texture that is not there", &|s| s.materials[0].opacity_texture = 1 << 20);
    refused("a texture beyond the texels", &|s| s.textures.iter_mut().for_each(|t| t.first += 1));
    refused("a texture without texels", &|s| s.textures[0].width = 0);
    refused("shading of some triangles", &|s| s.shading.truncate(3));
    refused("a lamp that is not there", &|s| s.lights.iter_mut().for_each(|l| l.triangle = 1 << 20));
    refused("a light of no kind", &|s| s.lights[0].kind = 99);
    refused("an alias that is not there", &|s| s.light_table[0].alias = 1 << 20);
    refused("lights without a table", &|s| s.light_table.clear());
    let tree = |s: &mut Loaded, power, child| {
        s.light_nodes = vec![LightNode { power, child, ..LightNode::default() }; 9];
    };
    refused("a node of lights below itself", &|s| tree(s, 1.0, 4));
    refused("nodes of lights beyond the end", &|s| tree(s, 1.0, 8));
    refused("a light beyond the end", &|s| tree(s, 1.0, LIGHT_LEAF | 99));
    refused("a sky of another size", &|s| s.environment.as_mut().unwrap().width += 1);
    refused("a sky's alias", &|s| s.environment.as_mut().unwrap().table[0].alias = 99);
    refused("a sphere without a radius", &|s| (s.triangles[0].primitive, s.triangles[0].v1) = (SPHERE, [0.0; 3]));
    refused("a coat without its table", &|s| {
        let coat = &mut s.materials[0];
        (coat.kind, coat.alpha, coat.coat_table) = (BSDF_COATED, 0.5, 1 << 30);
    });
    refused("no nodes", &|s| s.nodes.clear());
    let mut nowhere = SCENE.clone();
    nowhere.view.position = Some([f64::NAN; 3]);
    let error = Renderer::new(&GPU, &nowhere, &nowhere.settings, Outputs::default()).err();
    assert!(matches!(error, Some(Error::Usage(_))), "a camera is no array: {error:?}");
    assert!(Renderer::new(&GPU, &SCENE, &SCENE.settings, Outputs::default()).is_ok(), "control");
}

#[test]
fn a_camera_that_no_ray_can_leave_is_refused() {
    let mut renderer = Renderer::new(&GPU, &SCENE, &SCENE.settings, Outputs::default()).unwrap();
    let camera = SCENE.camera([16, 16]).unwrap();
    for (camera, needs) in [
        (Camera { near: f32::INFINITY, ..camera }, "finite numbers"),
        (Camera { forward: [0.0, 0.0, -2.0], ..camera }, "a unit vector"),
        (Camera { forward: [0.0; 3], ..camera }, "a unit vector"),
        (Camera { right: [0.0; 3], ..camera }, "in no plane"),
        (Camera { up: camera.right, ..camera }, "in no plane"),
        (Camera { up: camera.forward.map(|v| v * 1e-3), ..camera }, "in no plane"),
        (Camera { position: [1e20, 0.0, 0.0], ..camera }, "at most 1e12"),
        (Camera { near: 1e20, ..camera }, "at most 1e12"),
        (Camera { near: -1.0, ..camera }, "at least 0"),
        (Camera { lens_radius: -0.1, ..camera }, "at least 0"),
        (Camera { lens_radius: 0.1, focus_distance: 0.0, ..camera }, "a focus_distance above 0"),
    ] {
        let error = renderer.set_camera(camera).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains(needs), "{error}");
    }
    assert!(renderer.set_camera(camera).is_ok());
}

/// Kernels whose numbers would make them overrun what they have, or the device.
#[test]
fn kernels_of_impossible_numbers_are_refused() {
    let choose = |workgroup| Choose::new(&GPU, &shared::thread::Constants { workgroup }.into()).map(drop);
    assert!([0, 1 << 30, u32::MAX].iter().all(|&workgroup| choose(workgroup).is_err()));
    assert!([0, 1025, u32::MAX].iter().all(|&items| Batches::new(&GPU, items).is_err()));
    assert!(choose(64).is_ok() && Batches::new(&GPU, 64).is_ok(), "control");
    assert_silent();
}
