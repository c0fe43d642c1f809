//! Compares the kernels on the device with their CPU twins. Rounding sends a few paths another way (a ray that meets or misses an
//! edge), and a driver's arc tangent moves lookups beside a small sun: nearly all samples must agree closely, but none has to.
use crate::support::kernels::{accumulate as fold_kernel, traverse as traverse_kernel};
use crate::support::{self, assert_silent, gpu};
use crate::twin::{
    Aim, BALL, BULB, MIRRORS, PATTERNS, Random, SUN, Workplace, aimed_at_seam, ball, instanced_ball, many_lamps_and,
    patterned_lamp, under_a_panel,
};
use glam::{Vec3, Vec4};
use rayon::prelude::*;
use std::path::Path;
use tallow::gpu::{Buffer, DeviceKind, FrameResources, Gpu, Kernel, Location};
use tallow::layout::*;
use tallow::render::settings::{PixelFilter, Settings, Split};
use tallow::render::{Batch, DeviceScene, Outputs, Renderer, Step, all_effects, called_for, frame_constants};
use tallow::scene::{Loaded, Scene};
use tallow::shaders::shared;
use tallow::shaders::shared::sample_marks::{ALL_ASTRAY, ALL_PASSED_OVER, ASTRAY, PASSED_OVER, SOME_BARE};
use tallow::twins::accumulate::fold;
use tallow::twins::path::{PathSample, Strategy, Tracer};
use tallow::twins::primary_hit::{guide, seen, through_lens};
use tallow::twins::texture::mask_bits;
use tallow::twins::traverse::traverse;

const SIDE: u32 = 48;
const SAMPLES: u32 = 3;

/// Scenes of the repository that between them use every effect that needs no picture file, and one that is all pictures.
const SCENES: [&str; 9] = [
    "cornell-box/scene.toml",
    "cornell-box/glossy.toml",
    "cornell-box/mirror.toml",
    "cornell-box/glass.toml",
    "cornell-box/point.toml",
    "cornell-box/directional.toml",
    "veach-mis/scene.toml",
    "grass/scene.toml",
    "bust/scene.toml",
];

pub fn small(s: &mut Settings) {
    (s.width, s.height, s.spp, s.max_depth) = (SIDE, SIDE, SAMPLES, s.max_depth.min(4));
}

pub fn shipped(file: &str) -> Loaded {
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file))
        .map(|scene| scene.with(small))
        .unwrap()
}

/// Textures of every use, masks (of the lamp too, which shines from behind), a normal map, an environment image, a spot light, a
/// lens, a mirrored instance, roulette and a clamp.
pub fn pictures() -> Loaded {
    let checks = |x: u32, y: u32| if (x / 4 + y / 4).is_multiple_of(2) { [230, 120, 40] } else { [60, 150, 220] };
    let bumps = |x: u32, y: u32| [128 + (x * 7 % 60) as u8, 128 + (y * 5 % 60) as u8, 235];
    let place = Workplace::new()
        .sky("sky.exr", 32, 16, |x, y| if (x, y) == (20, 3) { 60.0 } else { 0.4 + 0.01 * x as f32 })
        .picture("checks.png", 32, checks)
        .picture("bumps.png", 32, bumps);
    let mut scene = place.scene(
        "[camera]\nposition = [0.0, 1.4, 5.0]\ntarget = [0.0, 0.7, 0.0]\nfov = 45.0\nlens_radius = 0.05\n\
         focus_distance = 5.0\n[render]\nmax_depth = 4\nroulette_depth = 2\nclamp_indirect = 1.0\n\
         [environment]\nfile = 'sky.exr'\nrotation = 40.0\n\
         [[light]]\ntype = 'spot'\nposition = [-0.5, 3.5, 3.0]\ntarget = [0.0, 0.5, 0.0]\n\
         intensity = [90.0, 60.0, 30.0]\ncone = 15.0\ncutoff = 40.0\n\
         [[material]]\nname = 'floor'\ncolor_texture = 'checks.png'\nbump = 'checks.png'\nbump_scale = 0.05\n\
         [[material]]\nname = 'ball'\ntype = 'coated'\nalpha = 0.3\nroughness_texture = 'checks.png'\n\
         normal_map = 'bumps.png'\nspecular_texture = 'checks.png'\n\
         [[material]]\nname = 'leaf'\nopacity = 0.6\nopacity_texture = 'checks.png'\n\
         [[material]]\nname = 'lamp'\nemission = 100.0\nemission_texture = 'checks.png'\n\
         emission_two_sided = true\nopacity = 0.8\nopacity_texture = 'checks.png'\n\
         [[mesh]]\nname = 'floor'\nshape = 'rectangle'\nmaterial = 'floor'\n\
         transform = { rotate = [-90.0, 0.0, 0.0], scale = 4.0 }\n\
         [[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 32\nmaterial = 'ball'\n\
         [[mesh]]\nname = 'leaf'\nshape = 'rectangle'\nmaterial = 'leaf'\ntransform = { translate = [0.0, 1.2, 1.2] }\n\
         [[mesh]]\nname = 'lamp'\nshape = 'rectangle'\nmaterial = 'lamp'\n\
         transform = { translate = [0.0, 3.0, 0.5], rotate = [-90.0, 0.0, 0.0], scale = 0.6 }\n\
         [[instance]]\nmesh = 'ball'\ntransform = { translate = [-1.2, 0.7, 0.0], scale = [0.7, 0.7, -0.7] }\n\
         [[instance]]\nmesh = 'ball'\ntransform = { translate = [1.2, 0.8, -0.5], rotate = [20.0, 50.0, 0.0], scale = 0.8 }\n",
    );
    scene.settings.filter = PixelFilter::Gaussian;
    (scene.textures[0].scale, scene.textures[0].offset) = ([2.0, -0.7], [0.3, 0.1]);
    small(&mut scene.settings);
    scene
}

/// A ball under a sky whose columns need more than 16 bits to count.
fn wide_sky() -> Loaded {
    let mut scene = Workplace::new().sky("sky.exr", 70_000, 2, |x, _| if x < 20_000 { 3.0 } else { 0.1 }).scene(
        "[camera]\nposition = [0.0, 0.0, 4.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 45.0\n[environment]\nfile = 'sky.exr'\n\
         [[mesh]]\nshape = 'sphere'\nsegments = 16\n",
    );
    small(&mut scene.settings);
    scene
}

/// Exact spheres of every kind: of glass, masked, with maps, as lamps, mirrored and stretched instances.
fn spheres() -> Loaded {
    let bumps = |x: u32, y: u32| [128 + (x * 7 % 60) as u8, 128 + (y * 5 % 60) as u8, 235];
    let place = Workplace::new()
        .picture(
            "checks.png",
            32,
            |x, y| if (x / 4 + y / 4).is_multiple_of(2) { [230, 120, 40] } else { [60, 150, 220] },
        )
        .picture("bumps.png", 32, bumps);
    let mut scene = place.scene(
        "[camera]\nposition = [0.0, 1.4, 5.0]\ntarget = [0.0, 0.7, 0.0]\nfov = 45.0\n[render]\nmax_depth = 4\n\
         [environment]\nradiance = 0.3\n[[material]]\nname = 'lamp'\nemission = 9.0\nemission_two_sided = true\n\
         type = 'metallic-roughness'\nclearcoat = 1.0\n[[material]]\nname = 'glass'\n\
         type = 'dielectric'\n[[material]]\nname = 'bumpy'\ntype = 'coated'\nalpha = 0.2\n\
         color_texture = 'checks.png'\nbump = 'checks.png'\nbump_scale = 0.05\n\
         [[material]]\nname = 'mapped'\nnormal_map = 'bumps.png'\nopacity = 0.8\nopacity_texture = 'checks.png'\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 4.0 }\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'lamp'\ntransform = { scale = 0.2, translate = [0.4, 1.8, 1.0] }\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'glass'\ntransform = { scale = 0.5, translate = [1.3, 0.5, 1.0] }\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'mapped'\ntransform = { scale = 0.5, translate = [-0.2, 0.5, 1.2] }\n\
         [[mesh]]\nshape = 'sphere'\nflip_normals = true\ntransform = { scale = 30.0 }\n\
         [[mesh]]\nname = 'ball'\nshape = 'sphere'\nmaterial = 'bumpy'\ntransform = { rotate = [0.0, 30.0, 10.0] }\n\
         [[instance]]\nmesh = 'ball'\ntransform = { translate = [-1.2, 0.7, 0.0], scale = [0.7, 0.7, -0.7] }\n\
         [[instance]]\nmesh = 'ball'\ntransform = { translate = [0.4, 0.8, -0.9], rotate = [20.0, 50.0, 0.0], scale = [0.5, 0.8, 1.0] }\n\
         [[instance]]\nmesh = 'ball'\nmaterial = 'lamp'\ntransform = { translate = [2.5, 2.6, -0.5], scale = 0.1 }\n",
    );
    assert!(scene.triangles.len() == 7 && scene.lights.iter().filter(|l| l.kind == LIGHT_SPHERE).count() == 2);
    small(&mut scene.settings);
    scene
}

/// Everything that a render leaves behind, and the twin's answers to the same questions.
pub struct Pair {
    pub samples: [Vec<Vec3>; 2],
    guides: [Vec<Guide>; 2],
    /// What smooth surfaces or the lens show; nothing in scenes without.
    seen: [Vec<Guide>; 2],
    /// How far the lens blurs that.
    blur: [Vec<f32>; 2],
    stats: [Vec<PixelStats>; 2],
    light: [Vec<PixelLight>; 2],
}

/// The albedo of a sample, or what cannot be one where it has `marks`: those of `glsl/shared/sample_marks.glsl`.
fn marked(albedo: Vec3, marks: u32) -> Vec3 {
    albedo - 4.0 * marks as f32
}

fn marks(sample: &PathSample) -> u32 {
    (u32::from(sample.astray) * ASTRAY) | (u32::from(sample.passed_over) * PASSED_OVER)
}

/// Direct light, indirect light and albedo of the twin's samples one after the other, and the rays that it traced.
pub fn twin_samples(scene: &Loaded, effects: Effects) -> (Vec<Vec3>, u32) {
    let frame = frame_constants(scene, &scene.settings).unwrap();
    let (tracer, pixels) = (Tracer { scene, frame, effects, strategy: Strategy::Both }, SIDE * SIDE);
    let sample = |i: u32| tracer.sample(i % pixels, i / pixels);
    let samples: Vec<_> = (0..pixels * SAMPLES).into_par_iter().map(sample).collect();
    let all = samples.iter().flat_map(|s| [s.direct, s.indirect, marked(s.albedo, marks(s))]).collect();
    (all, samples.iter().map(|s| s.rays).sum())
}

/// With every effect, in a kernel that scenes of all depths share: it takes many seconds to compile.
pub fn run_with_all_effects(gpu: &Gpu, scene: &Loaded) -> Pair {
    let mut scene = scene.clone();
    scene.stack = scene.stack.max(16);
    run(gpu, &scene, all_effects(&scene, &scene.settings))
}

pub fn run(gpu: &Gpu, scene: &Loaded, effects: Effects) -> Pair {
    let renderer = Renderer::specialised(gpu, scene, &scene.settings, Outputs::FILTERED, effects).unwrap();
    let mut frame = FrameResources::new(gpu).unwrap();
    let pixels = SIDE * SIDE;
    let batch = Batch { first_pixel: 0, pixels, first_sample: 0, samples: SAMPLES };
    [Step::Start, Step::Uniform(batch)].iter().for_each(|step| drop(renderer.run(&mut frame, step).unwrap()));
    let film = renderer.film();
    let words = film.samples.read().unwrap();
    let tile = &film.tiles[0];
    let words = &words[..3 * (pixels * SAMPLES) as usize];
    let read = |(i, &v): (usize, &vec4)| marked(Vec4::from(v).truncate(), if i % 3 == 2 { v[3] as u32 } else { 0 });
    let device: Vec<_> = words.iter().enumerate().map(read).collect();
    let rays: f32 = words.iter().step_by(3).map(|v| v[3]).sum();

    let frame = frame_constants(scene, &scene.settings).unwrap();
    let (host, traced) = twin_samples(scene, *renderer.effects());
    assert!((rays / traced as f32 - 1.0).abs() < 0.01, "the device traced {rays} rays, the twin {traced}");
    let (mut stats, mut light) =
        (vec![PixelStats::default(); pixels as usize], vec![PixelLight::default(); pixels as usize]);
    let push_fold = FoldPush { pixels, samples: SAMPLES, ..FoldPush::default() };
    fold(&push_fold, true, words, &mut stats, &mut light); // of the device's samples: only rounding may differ
    let shown = if tile.has_seen() { tile.seen.read().unwrap() } else { Vec::new() };
    let blur = if tile.has_blur() { tile.blur.read().unwrap() } else { Vec::new() };
    let lens = renderer.effects().lens;
    assert_eq!(tile.has_blur(), lens);
    assert!(tile.has_seen() || !(lens || renderer.effects().dielectric));
    let show = |p| if lens { through_lens(scene, &frame, p) } else { (seen(scene, &frame, p), 0.0) };
    let (seen, mut blurred): (Vec<_>, Vec<_>) = (0..shown.len() as u32).into_par_iter().map(show).unzip();
    blurred.truncate(blur.len());
    Pair {
        samples: [device, host],
        seen: [shown, seen],
        blur: [blur, blurred],
        guides: [tile.guide.read().unwrap(), (0..pixels).into_par_iter().map(|p| guide(scene, &frame, p)).collect()],
        stats: [tile.stats.read().unwrap(), stats],
        light: [tile.light.read().unwrap(), light],
    }
}

fn near(a: impl Into<Vec3>, b: impl Into<Vec3>, tolerance: f32) -> bool {
    let (a, b): (Vec3, Vec3) = (a.into(), b.into());
    (a - b).abs().cmple(Vec3::splat(tolerance * (1.0 + b.abs().max_element()))).all()
}

/// Share of samples whose direct and indirect light and albedo agree.
pub fn agreement(samples: &[Vec<Vec3>; 2]) -> f64 {
    let pairs = samples[0].chunks(3).zip(samples[1].chunks(3));
    let agree = pairs.filter(|(a, b)| a.iter().zip(*b).all(|(a, b)| near(*a, *b, 2e-3))).count();
    agree as f64 / (samples[0].len() / 3) as f64
}

fn guides_agree(a: &Guide, b: &Guide) -> bool {
    // Without a rest: a field that is added must be compared, too.
    let Guide {
        #[cfg(feature = "dummy-fields")]
            dummy: _,
        normal,
        depth,
        position,
        object,
        albedo,
        material,
    } = *b;
    a.object == object
        && a.material == material
        && near(a.normal, normal, 1e-3)
        && near(a.position, position, 1e-4)
        && near(a.albedo, albedo, 1e-2)
        && (a.depth - depth).abs() <= 1e-4 * (1.0 + a.depth)
}

pub fn check(name: &str, pair: &Pair) {
    let share = agreement(&pair.samples);
    // Rounding decides a lobe, a texel or an edge here and there; bumps at full texture resolution magnify it most. Sines of GPUs are
    // good to six digits, and each further surface magnifies what is left: .88 of the Cornell box's samples agree on an H200.
    let least = if gpu().info().kind == DeviceKind::Cpu { 0.98 } else { 0.8 };
    assert!(share > least, "{name}: {share} of samples agree");
    let [device, host] = &pair.samples;
    let sums = [device, host].map(|s| s.iter().map(|v| f64::from(v.element_sum())).sum::<f64>());
    assert!((sums[0] / sums[1] - 1.0).abs() < 0.01, "{name}: {sums:?}");

    let wrong = pair.guides[0].iter().zip(&pair.guides[1]).filter(|(a, b)| !guides_agree(a, b)).count();
    assert!(wrong <= pair.guides[0].len() / 500, "{name}: {wrong} guides differ");
    // Each surface on the way magnifies what rounding makes of its normal.
    let wrong = pair.seen[0].iter().zip(&pair.seen[1]).filter(|(a, b)| !guides_agree(a, b)).count();
    assert!(wrong <= pair.seen[0].len() / 50, "{name}: {wrong} guides of what is seen differ");

    let right = pair.blur[0].iter().zip(&pair.blur[1]).filter(|(a, b)| (*a - *b).abs() <= 1e-3).count();
    let wrong = pair.blur[0].len() - right;
    assert!(wrong <= pair.blur[0].len() / 50, "{name}: the lens blurs {wrong} pixels otherwise");

    for (a, b) in pair.stats[0].iter().zip(&pair.stats[1]) {
        assert!(a.count == b.count && near(a.mean, b.mean, 1e-5) && near(a.m2, b.m2, 1e-4), "{name}: {a:?} {b:?}");
    }
    for (a, b) in pair.light[0].iter().zip(&pair.light[1]) {
        assert!(near(a.direct, b.direct, 1e-5) && near(a.albedo, b.albedo, 1e-5), "{name}: {a:?} {b:?}");
        let [m2, expected] = [a, b].map(|l| Vec3::splat(l.indirect_m2));
        assert!(near(m2, expected, 1e-4), "{name}: {a:?} {b:?}");
    }
}

#[test]
fn renders_agree_with_their_twins() {
    let gpu = gpu();
    let outputs = Outputs::FILTERED;
    for file in SCENES {
        let scene = shipped(file);
        check(file, &run(&gpu, &scene, called_for(&scene, &scene.settings, outputs)));
    }
    let sky = wide_sky();
    check("wide sky", &run(&gpu, &sky, called_for(&sky, &sky.settings, outputs)));
    let mut panel = under_a_panel();
    small(&mut panel.settings);
    for (points, more) in [(3, [BULB, SUN].concat()), (40, SUN.to_owned())] {
        let mut lamps = many_lamps_and(points, &more);
        small(&mut lamps.settings);
        assert!(lamps.has_light_tree() && lamps.weighed_lights == (points < 33));
        let pair = run(&gpu, &lamps, called_for(&lamps, &lamps.settings, outputs));
        check("many lamps", &pair);
        let of_others = pair.samples[0].iter().filter(|v| v.max_element() < -4.0 * ASTRAY as f32).count();
        assert!(of_others > 200, "control: {of_others} samples pass over the key light");
    }
    check("panel", &run(&gpu, &panel, called_for(&panel, &panel.settings, outputs)));
    let balls = spheres();
    check("spheres", &run(&gpu, &balls, called_for(&balls, &balls.settings, outputs)));
    // Its point, spot and area lights and its sky are told apart.
    let scene = pictures();
    let effects = called_for(&scene, &scene.settings, outputs);
    assert!(effects.soft_light);
    check("pictures", &run(&gpu, &scene, effects));
    check("pictures, all effects", &run_with_all_effects(&gpu, &scene));
    let scene = scene.with(|s| s.split = Split::Indirect);
    let mut pair = run(&gpu, &scene, called_for(&scene, &scene.settings, outputs));
    check("pictures, indirect light apart", &pair);
    for samples in &pair.samples {
        let largest = samples.chunks(3).map(|s| s[1].max_element()).fold(0.0, f32::max);
        assert!((largest - 1.0).abs() < 1e-5, "indirect light of {largest}, clamped to 1");
    }
    for split in [Split::Soft, Split::Indirect] {
        let sparse = scene.clone().with(|s| (s.split, s.indirect_stride) = (split, 3));
        check("pictures, sparse", &run(&gpu, &sparse, called_for(&sparse, &sparse.settings, outputs)));
    }
    // Control: the twin's samples of the neighbouring pixels.
    pair.samples[1].rotate_right(3);
    assert!(agreement(&pair.samples) < 0.5, "control: other samples are told apart");
    pair.guides[1].rotate_right(1);
    assert!(!pair.guides[0].iter().zip(&pair.guides[1]).all(|(a, b)| guides_agree(a, b)));
    assert_silent(&gpu);
}

#[test]
fn renders_of_mirrored_lamps_agree_with_their_twins() {
    let gpu = gpu();
    for [material, mesh] in PATTERNS {
        let mut lamp = patterned_lamp(material, &format!("{mesh}\n{}", MIRRORS[0]));
        small(&mut lamp.settings);
        check(material, &run(&gpu, &lamp, called_for(&lamp, &lamp.settings, Outputs::FILTERED)));
    }
    assert_silent(&gpu);
}

/// Pixels whose samples repeat every so many.
const REPEATED: u32 = 8;
const PERIOD: u32 = 1 << 15;

/// Sample `k` of a pixel: mostly dark with now and then a bright one, or all nearly alike; (direct, indirect, albedo).
fn repeated(pixel: u32, k: u32) -> [vec4; 3] {
    let unit = |salt: u32| support::hash((k * REPEATED + pixel) * 4 + salt) as f32 / 4_294_967_296.0;
    let value = |salt: u32| match pixel % 2 {
        0 if unit(salt) < 0.9 => 0.0,
        0 => 10.0 * unit(3 - salt),
        _ => 1.0 + 0.01 * unit(salt),
    };
    [[value(0), value(0), 0.3, 2.0], [0.5 * value(1), 0.1, 0.25 * value(1), 0.0], [0.5, 0.5, 0.2 + 0.1 * unit(2), 0.0]]
}

/// Statistics after `times` times all repeated samples, in batches of `depth` samples a pixel.
fn folded(gpu: &Gpu, samples: &[vec4], depth: u32, times: u32) -> (Vec<PixelStats>, Vec<PixelLight>) {
    let effects = Effects {
        split_light: true,
        many_samples: true,
        smooth_interface: true,
        soft_light: true,
        point_lights: true,
        ..Effects::default()
    };
    let thread = gpu.tuning().thread();
    let kernel = Kernel::new(gpu, &fold_kernel::Constants { effects, thread }).unwrap();
    let stats = Buffer::from_slice(gpu, "stats", &[PixelStats::default(); REPEATED as usize]).unwrap();
    let light = Buffer::from_slice(gpu, "light", &[PixelLight::default(); REPEATED as usize]).unwrap();
    let broken = Buffer::from_slice(gpu, "broken", &[BrokenTally::default()]).unwrap();
    let offset = Buffer::from_slice(gpu, "offset", &[[0, 0]]).unwrap();
    let batches = samples.chunks((3 * REPEATED * depth) as usize);
    let batches: Vec<_> = batches.map(|part| Buffer::from_slice(gpu, "samples", part).unwrap()).collect();
    let mut frame = FrameResources::new(gpu).unwrap();
    for samples in (0..times).flat_map(|_| &batches) {
        let bind = fold_kernel::Bind {
            samples,
            stats: &stats,
            light: &light,
            offset: &offset,
            folded_stats: &stats,
            folded_light: &light,
            broken: &broken,
        };
        let push = FoldPush { pixels: REPEATED, samples: samples.len() as u32 / (3 * REPEATED), ..FoldPush::default() };
        gpu.run(&mut frame, |rec| rec.dispatch_threads(&kernel, bind, &push, REPEATED)).unwrap();
    }
    (stats.read().unwrap(), light.read().unwrap())
}

/// Mean of `of` over one pixel's samples, in double precision.
fn exact(samples: &[vec4], pixel: u32, of: impl Fn(&[vec4]) -> f64) -> f64 {
    let own = samples.chunks(3).skip(pixel as usize).step_by(REPEATED as usize);
    own.map(of).sum::<f64>() / f64::from(PERIOD)
}

/// Of eight pixels one has samples that all have a mark, one no such sample, the others some, first, between or last.
#[test]
fn marked_samples_are_folded_as_by_the_twin() {
    let gpu = gpu();
    const MARKED: [u32; REPEATED as usize] = [0b1111, 0, 1, 0b11, 0b1000, 0b1010, 0b0111, 0b110];
    let sample = |k: u32, pixel: u32| {
        let mut sample = repeated(pixel, k);
        // The next pixel's samples pass over the key light.
        let [astray, passed_over] = [pixel, (pixel + 1) % REPEATED].map(|p| MARKED[p as usize] >> k & 1);
        // One shows the sky, before one that passes over the key light, whose albedo is less than that of the mean.
        let albedo = if pixel == 3 { [1.0, 1.0, 0.0, 0.5][k as usize] } else { 1.0 };
        sample[2][..3].iter_mut().for_each(|v| *v *= albedo);
        sample[2][3] = ((astray * ASTRAY) | (passed_over * PASSED_OVER)) as f32;
        sample
    };
    let samples: Vec<vec4> = (0..4).flat_map(|k| (0..REPEATED).flat_map(move |pixel| sample(k, pixel))).collect();
    let push = FoldPush { pixels: REPEATED, samples: 4, ..FoldPush::default() };
    let (mut stats, mut light) = (vec![PixelStats::default(); 8], vec![PixelLight::default(); 8]);
    fold(&push, true, &samples, &mut stats, &mut light);
    for depth in [1, 3, 4] {
        let (_, found) = folded(&gpu, &samples, depth, 1);
        for (pixel, (a, b)) in found.iter().zip(&light).enumerate() {
            let alike = near(a.albedo, b.albedo, 1e-6) && near(a.direct, b.direct, 1e-6) && a.remainder == b.remainder;
            let squares = (a.indirect_m2 - b.indirect_m2).abs() <= 1e-5 * b.indirect_m2;
            assert!(alike && squares, "{depth}, {pixel}: {a:?}, {b:?}");
        }
    }
    let all = |mark: u32| light.iter().map(move |l| l.remainder & mark != 0).collect::<Vec<_>>();
    let mut marked = MARKED.map(|bits| bits == 0b1111);
    assert_eq!(all(ALL_ASTRAY), marked, "control");
    marked.rotate_left(1);
    assert_eq!(all(ALL_PASSED_OVER), marked, "control");
    assert_eq!(all(SOME_BARE), (0..REPEATED).map(|pixel| pixel == 3).collect::<Vec<_>>(), "control");
    assert_silent(&gpu);
}

#[test]
fn means_of_millions_of_samples_are_exact() {
    let gpu = gpu();
    let samples: Vec<vec4> =
        (0..PERIOD).flat_map(|k| (0..REPEATED).flat_map(move |pixel| repeated(pixel, k))).collect();
    const TIMES: u32 = 1 << 7; // 2^22 samples, of the twin, which takes longer, 2^20
    const TIMES_OF_TWIN: u32 = 1 << 5;
    let (stats, light) = folded(&gpu, &samples, PERIOD, TIMES);
    let push = FoldPush { pixels: REPEATED, samples: PERIOD, ..FoldPush::default() };
    let (mut twin, mut twin_light) = ([PixelStats::default(); 8], [PixelLight::default(); 8]);
    for _ in 0..TIMES_OF_TWIN {
        fold(&push, true, &samples, &mut twin, &mut twin_light);
    }
    for (name, times, stats, light) in
        [("kernel", TIMES, &stats[..], &light[..]), ("twin", TIMES_OF_TWIN, &twin, &twin_light)]
    {
        for pixel in 0..REPEATED {
            let (s, l) = (&stats[pixel as usize], &light[pixel as usize]);
            let off =
                |found: f32, of: &dyn Fn(&[vec4]) -> f64| (f64::from(found) / exact(&samples, pixel, of) - 1.0).abs();
            let radiance = off(s.mean[0], &|r| f64::from(r[0][0]) + f64::from(r[1][0]));
            assert!(
                s.count == times * PERIOD && radiance < 1e-6,
                "{name}, pixel {pixel}: radiance off by {radiance:.1e}"
            );
            let direct = off(l.direct[1], &|r| f64::from(r[0][1]));
            let albedo = off(l.albedo[2], &|r| f64::from(r[2][2]));
            assert!(direct.max(albedo) < 1e-5, "{name}, pixel {pixel}: {direct:.1e} {albedo:.1e}");
        }
    }
    // However they are cut into batches, also across the sample from which more bits are kept.
    let cut = |depth| folded(&gpu, &samples, depth, 1);
    let [whole, parts] = [PERIOD, 96].map(cut);
    assert!(whole == parts && whole.0.iter().any(|s| s.remainder != 0), "the bits depend on batches");
    assert_silent(&gpu);
}

/// Light as strong as numbers go.
#[test]
fn squares_of_the_brightest_samples_stay_finite() {
    let gpu = gpu();
    let bright = |k: u32| if k.is_multiple_of(2) { 3e38 } else { 0.0 };
    let sample = |k: u32| [[0.0, bright(k), 0.0, 2.0], [bright(k), 0.0, 1e30, 0.0], [1e-5, 1.0, 0.5, 0.0]];
    let samples: Vec<vec4> = (0..64).flat_map(|k| (0..REPEATED).flat_map(move |_| sample(k))).collect();
    let (stats, light) = folded(&gpu, &samples, 64, 1);
    let push = FoldPush { pixels: REPEATED, samples: 64, ..FoldPush::default() };
    let (mut twin, mut twin_light) = ([PixelStats::default(); 8], [PixelLight::default(); 8]);
    fold(&push, true, &samples, &mut twin, &mut twin_light);
    for (s, l) in stats.iter().zip(&light).chain(twin.iter().zip(&twin_light)) {
        let all = s.mean.iter().chain(&s.m2).chain(&l.direct).chain(&l.albedo).chain([&l.indirect_m2]);
        assert!(all.into_iter().all(|v| v.is_finite()), "{s:?} {l:?}");
        // Sums of them over pixels stay finite too.
        assert!(s.m2.iter().chain([&l.indirect_m2]).all(|&v| v <= 1e35), "{s:?} {l:?}");
        assert!(s.m2[0] > 1e34 && l.indirect_m2 > 1e34, "control: {s:?} {l:?}");
    }
    assert_silent(&gpu);
}

/// The kernel that traces given rays, and a scene for it.
pub struct Traversal {
    gpu: Gpu,
    scene: DeviceScene,
    kernel: Kernel<traverse_kernel::Bind<'static>>,
    root: u32,
}

impl Traversal {
    pub fn new(gpu: &Gpu, scene: &Loaded, effects: Effects) -> Self {
        Self::with(gpu, scene, effects, false)
    }

    /// For what rays meet that leave their first hits.
    pub fn behind(gpu: &Gpu, scene: &Loaded, effects: Effects) -> Self {
        Self::with(gpu, scene, effects, true)
    }

    fn with(gpu: &Gpu, scene: &Loaded, effects: Effects, behind: bool) -> Self {
        let traverse = gpu.tuning().traverse(scene.stack);
        let thread = shared::thread::Constants { workgroup: 32 };
        let constants = traverse_kernel::Constants { effects, thread, traverse, deal: dealing(gpu), behind };
        let kernel = Kernel::new(gpu, &constants).unwrap();
        let root = frame_constants(scene, &scene.settings).unwrap().path.root;
        Self { gpu: gpu.clone(), scene: DeviceScene::new(gpu, scene, &effects).unwrap(), kernel, root }
    }

    /// Hits that the kernel finds.
    pub fn hits(&self, rays: &[RayQuery], any_hit: bool) -> Vec<RayHit> {
        let Self { gpu, scene, kernel, root } = self;
        let queries = Buffer::from_slice(gpu, "rays", rays).unwrap();
        let hits = Buffer::new(gpu, "hits", rays.len(), Location::Device).unwrap();
        let (count, any_hit) = (rays.len() as u32, u32::from(any_hit));
        let push = TraversePush { count, root: *root, any_hit, ..Default::default() };
        gpu.run(&mut FrameResources::new(gpu).unwrap(), |rec| {
            let bind = traverse_kernel::Bind {
                scene: scene.bind(),
                ray_query: scene.bind_world(),
                rays: &queries,
                hits: &hits,
            };
            rec.dispatch_threads(kernel, bind, &push, count.div_ceil(3)) // some threads have fewer than 3
        })
        .unwrap();
        hits.read().unwrap()
    }
}

/// All lanes of this device's subgroups, whether or not it gains from dealing triangles to them; none where it may part them.
pub fn dealing(gpu: &Gpu) -> shared::deal::Constants {
    let info = gpu.info();
    let together = info.kind == DeviceKind::Cpu && info.subgroup_shuffle && info.subgroup_size_fixed;
    let able = together && matches!(info.subgroup_size, 4 | 8 | 16 | 32);
    shared::deal::Constants { lanes: if able { info.subgroup_size } else { 0 } }
}

pub fn queries(scene: &Loaded, count: usize) -> Vec<RayQuery> {
    let [low, high] = scene.bounds.map(Vec3::from);
    let mut random = Random::stream(11);
    let mut query = |i: usize| {
        let origin = low + (high - low) * (0.5 + 0.7 * random.point());
        let axis = [Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z][i % 3];
        let direction = if i.is_multiple_of(4) { axis } else { random.point().normalize() };
        let t_max = if i.is_multiple_of(5) { 0.3 * (high - low).length() } else { 3e38 };
        RayQuery {
            origin: origin.into(),
            t_max,
            direction: direction.into(),
            mask_seed: (i as u32).wrapping_mul(0x9e3779b9),
            ..Default::default()
        }
    };
    (0..count).map(&mut query).collect()
}

/// Rays on which kernel and twin differ.
fn differing(scene: &Loaded, rays: &[RayQuery], hits: &[RayHit], any_hit: bool) -> usize {
    let differs = |(ray, hit): (&RayQuery, &RayHit)| {
        let seed = if any_hit { ray.mask_seed } else { mask_bits(ray.mask_seed) };
        let twin = traverse(scene, ray.origin.into(), ray.direction.into(), ray.t_max, any_hit, seed);
        if any_hit {
            return (twin.triangle == NONE) != (hit.triangle == NONE); // of several triangles any may stop a ray
        }
        let same = twin.triangle == hit.triangle && twin.instance == hit.instance;
        let near = |a: f32, b: f32, scale: f32| (a - b).abs() <= 1e-4 * scale;
        let [u, v] = hit.barycentric;
        !(same && near(twin.t, hit.t, twin.t) && near(twin.barycentric.x, u, 1.0) && near(twin.barycentric.y, v, 1.0))
    };
    rays.iter().zip(hits).filter(|&pair| differs(pair)).count()
}

#[test]
fn traversal_agrees_with_its_twin() {
    let gpu = gpu();
    let mut scenes = SCENES.map(|file| (file, shipped(file))).to_vec();
    scenes.extend([("pictures", pictures()), ("spheres", spheres())]);
    for (name, scene) in &scenes {
        let rays = queries(scene, 5000);
        let own = called_for(scene, &scene.settings, Outputs::default());
        let all = all_effects(scene, &scene.settings);
        let effects = if ["pictures", "spheres"].contains(name) { vec![own, all] } else { vec![own] };
        for effects in effects {
            let kernel = Traversal::new(&gpu, scene, effects);
            for any_hit in [false, true] {
                let mut hits = kernel.hits(&rays, any_hit);
                let found = hits.iter().filter(|h| h.triangle != NONE).count();
                let wrong = differing(scene, &rays, &hits, any_hit);
                assert!(wrong <= 10 && found > 300, "{name} any_hit {any_hit}: {wrong} differ, {found} hit");
                hits.rotate_right(1);
                assert!(differing(scene, &rays, &hits, any_hit) > 300, "{name} control: other rays' hits");
            }
        }
    }
    assert_silent(&gpu);
}

/// Rays at shared vertices and edges of a ball: from inside, from the centre along the axes too, and from as far as the
/// twin lets none through.
fn aims(scene: &Loaded) -> Vec<Aim> {
    type From = fn(&mut Random) -> Vec3;
    let from: [(usize, From); 4] = [
        (100_000, |r| BALL + 0.5 * r.point()),
        (20_000, |_| BALL),
        (100_000, |r| BALL + 10.0 * r.point().normalize()),
        (200_000, |r| BALL + 100.0 * r.point().normalize()),
    ];
    let aim = |(count, from): (usize, From)| (0..count).filter_map(move |i| aimed_at_seam(scene, i, from));
    from.into_iter().flat_map(aim).collect()
}

/// Those that the kernel lets through, on the way to the closest hit or to any before an end behind the surface.
fn leaks(gpu: &Gpu, scene: &Loaded, aims: &[Aim], any_hit: bool) -> Vec<Aim> {
    let query = |a: &Aim| {
        let t_max = if any_hit { a.distance + 0.2 } else { 3e38 };
        RayQuery { origin: a.origin.into(), t_max, direction: a.direction.into(), mask_seed: 0, ..Default::default() }
    };
    let queries: Vec<_> = aims.iter().map(query).collect();
    let kernel = Traversal::new(gpu, scene, called_for(scene, &scene.settings, Outputs::default()));
    let mut hits = kernel.hits(&queries, any_hit).into_iter();
    let through = |a: &&Aim| hits.next().is_some_and(|hit| hit.triangle == NONE || hit.t > a.distance + 0.2);
    aims.iter().filter(through).copied().collect()
}

#[test]
fn closed_meshes_do_not_leak() {
    let gpu = gpu();
    for (name, mut scene) in [("ball", ball()), ("instance", instanced_ball())] {
        let aims = aims(&scene);
        for any_hit in [false, true] {
            let leaks = leaks(&gpu, &scene, &aims, any_hit);
            assert!(leaks.is_empty(), "{name} any_hit {any_hit}: {} leaks, {:?}", leaks.len(), leaks[0]);
        }
        let hole = scene.triangles[1234].v0;
        scene.triangles[1234].v1 = hole;
        assert!(!leaks(&gpu, &scene, &aims, false).is_empty(), "control: a missing triangle leaks");
    }
    assert_silent(&gpu);
}

/// A lamp, a point light, a sky, a smooth ball twice (one is an instance), a coat and glass, all `scale` times as large.
fn scaled(scale: f64) -> Loaded {
    let v = |x: f64, y: f64, z: f64| format!("[{:e}, {:e}, {:e}]", x * scale, y * scale, z * scale);
    let mut scene = Workplace::new().scene(&format!(
        "[camera]\nposition = {}\ntarget = {}\nfov = 45.0\n[render]\nmax_depth = 4\n[environment]\nradiance = 0.2\n\
         [[light]]\ntype = 'point'\nposition = {}\nintensity = {:e}\n\
         [[material]]\nname = 'coat'\ntype = 'coated'\nalpha = 0.2\n[[material]]\nname = 'glass'\ntype = 'dielectric'\n\
         [[material]]\nname = 'lamp'\nemission = 9.0\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = {:e} }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
         transform = {{ rotate = [75.0, 0.0, 0.0], scale = {:e}, translate = {} }}\n\
         [[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 24\nmaterial = 'coat'\n\
         [[instance]]\nmesh = 'ball'\ntransform = {{ rotate = [30.0, 0.0, 0.0], scale = {:e}, translate = {} }}\n\
         [[instance]]\nmesh = 'ball'\nmaterial = 'glass'\ntransform = {{ scale = {:e}, translate = {} }}\n",
        v(0.0, 1.4, 5.0),
        v(0.0, 0.7, 0.0),
        v(1.0, 2.0, 2.0),
        5.0 * scale * scale,
        4.0 * scale,
        0.5 * scale,
        v(0.0, 3.0, 0.5),
        0.7 * scale,
        v(-0.8, 0.7, 0.0),
        0.5 * scale,
        v(0.9, 0.5, 0.5),
    ));
    small(&mut scene.settings);
    scene
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let gpu = gpu();
    let samples = |scale: f64| {
        let scene = scaled(scale);
        let effects = called_for(&scene, &scene.settings, Outputs::FILTERED);
        run(&gpu, &scene, effects).samples
    };
    let [device, twin] = samples(1.0);
    for scale in [2f64.powi(-33), 2f64.powi(33)] {
        let [d, t] = samples(scale);
        assert!(d == device && t == twin, "{scale:e}: to the last bit");
    }
    for scale in [1e-10, 1e-5, 1e5, 1e10] {
        let other = samples(scale);
        for (is, was) in other.into_iter().zip([&device, &twin]) {
            let share = agreement(&[is, was.clone()]);
            assert!(share > 0.98, "{scale:e}: {share} of samples agree");
        }
    }
    assert_silent(&gpu);
}
