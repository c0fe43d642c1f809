//! Tests the lookup of filtered light along eye rays: the choice among four guide rays by hand, the kernel against its twin, and
//! guide rays with invalid values.
use crate::kernels::pictures;
use crate::support::{assert_silent, gpu, hash, largest};
use crate::twin::Workplace;
use glam::{Vec2, vec2};
use std::path::Path;
use tallow::gpu::{DeviceKind, FrameResources, Gpu};
use tallow::layout::{Effects, Guide, NONE, vec3, vec4};
use tallow::render::settings::PixelFilter;
use tallow::render::{Outputs, Renderer, Step, frame_constants};
use tallow::scene::{Loaded, Scene};
use tallow::twins::guide_lookup::{GuideRays, look_up};
use tallow::twins::path::{Strategy, Tracer};
use tallow::twins::primary_hit::guide;

/// Around the workgroups' sizes, one row, one column, one pixel.
const SIZES: [[u32; 2]; 6] = [[1, 1], [31, 1], [1, 65], [64, 1], [65, 2], [33, 17]];
/// The device traces up to 8 of a pixel at once.
const EYE_RAYS: u32 = 11;

fn surface(normal: vec3, depth: f32) -> Guide {
    Guide { normal, depth, ..Guide::default() }
}

const X: vec3 = [1.0, 0.0, 0.0];
const Z: vec3 = [0.0, 0.0, 1.0];
const LIT: vec4 = [1.0; 4];

fn chosen(guide: &[Guide], filtered: &[vec4], eye: Guide, film: Vec2) -> Option<usize> {
    GuideRays { size: [2, guide.len() as u32 / 2], guide, filtered }.most_similar(&eye, film)
}

#[test]
fn the_choice_among_four_solves_the_worked_examples() {
    let lit = [LIT; 4];
    // Differences of normal 0 or sqrt 2, of depth 2.9 or 0.1 from an eye ray that meets (x, 2.1): S_n is 0, 1, 0, 1 and S_d
    // is 0, 28/29, 28/29, 0; only the second has both.
    let guide = [surface(Z, 5.0), surface(X, 2.0), surface(Z, 2.2), surface(X, 5.0)];
    assert_eq!(chosen(&guide, &lit, surface(X, 2.1), vec2(0.9, 0.9)), Some(1));
    assert_eq!(chosen(&guide, &lit, surface(Z, 2.1), vec2(0.9, 0.9)), Some(2));
    assert_eq!(chosen(&guide, &lit, surface(Z, 4.9), vec2(1.9, 1.9)), Some(0));
    // Both terms count: depths 1, 2, 3, 4 from 0.9 give S_d 30/31, 20/31, 10/31, 0; normals at 60, 0, 90, 90 degrees give S_n
    // 1 - 1/sqrt 2, 1, 0, 0. So 0.28, 0.65, 0, 0.
    let tilted = [0.5, 0.0, 0.75f32.sqrt()];
    let guide = [surface(tilted, 1.0), surface(X, 2.0), surface(Z, 3.0), surface(Z, 4.0)];
    assert_eq!(chosen(&guide, &lit, surface(X, 0.9), vec2(0.9, 0.9)), Some(1));

    // Of equals, the nearest, wherever the ray is; a ray beyond the border has those of the border.
    let flat = [surface(Z, 1.0); 4];
    let at = [(0.6, 0.6, 0), (1.4, 0.6, 1), (0.6, 1.4, 2), (1.4, 1.4, 3), (-0.4, 0.2, 0), (2.3, 1.9, 3)];
    for (x, y, nearest) in at {
        assert_eq!(chosen(&flat, &lit, surface(Z, 1.0), vec2(x, y)), Some(nearest), "{x} {y}");
    }
    // Six rows: four are looked at, and no others.
    let mut column = [surface(Z, 9.0); 12];
    column[8] = surface(X, 1.0);
    assert_ne!(chosen(&column, &[LIT; 12], surface(X, 1.0), vec2(0.9, 1.4)), Some(8));
    assert_eq!(chosen(&column, &[LIT; 12], surface(X, 1.0), vec2(0.9, 3.6)), Some(8));
}

#[test]
fn guide_rays_without_light_are_never_chosen() {
    let eye = surface(X, 2.0);
    let guide = [eye, surface(Z, 5.0), surface(Z, 5.0), surface(Z, 5.0)];
    assert_eq!(chosen(&guide, &[LIT; 4], eye, vec2(0.9, 0.9)), Some(0), "control");
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    for bad in [surface(X, 0.0), surface(X, nan), surface(X, inf), surface([1.0, nan, 0.0], 2.0)] {
        let guide = [bad, guide[1], guide[2], guide[3]];
        assert_eq!(chosen(&guide, &[LIT; 4], eye, vec2(0.9, 0.9)), Some(1), "{bad:?}");
    }
    for dark in [[1.0, 1.0, 1.0, 0.0], [nan, 1.0, 1.0, 1.0], [1.0, inf, 1.0, 1.0], [1.0, 1.0, 1.0, nan]] {
        assert_eq!(chosen(&guide, &[dark, LIT, LIT, LIT], eye, vec2(0.9, 0.9)), Some(1), "{dark:?}");
    }
    assert_eq!(chosen(&guide, &[[0.0; 4]; 4], eye, vec2(0.9, 0.9)), None);
}

fn scene(file: &str, size: [u32; 2], filter: PixelFilter) -> Loaded {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
    Scene::load(&path).map(|scene| scene.with(|s| ([s.width, s.height], s.filter) = (size, filter))).unwrap()
}

/// What guide rays meet, and light that differs from pixel to pixel, a few having none.
fn guides(scene: &Loaded) -> (Vec<Guide>, Vec<vec4>) {
    let frame = frame_constants(scene, &scene.settings).unwrap();
    let light = |i: u32| {
        let unit = |k: u32| (hash(4 * i + k) >> 8) as f32 / (1 << 24) as f32;
        [unit(0), unit(1), unit(2), if i % 7 == 6 { 0.0 } else { 1.0 }]
    };
    let pixels = 0..scene.settings.pixels() as u32;
    (pixels.clone().map(|p| guide(scene, &frame, p)).collect(), pixels.map(light).collect())
}

/// Of the device and of the twin.
fn both(gpu: &Gpu, scene: &Loaded, guide: &[Guide], filtered: &[vec4]) -> [Vec<vec3>; 2] {
    let renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::default()).unwrap();
    let (device, _) = renderer.look_up(guide, filtered, EYE_RAYS).unwrap();
    [device, twin(scene, renderer.effects(), guide, filtered)]
}

fn twin(scene: &Loaded, effects: &Effects, guide: &[Guide], filtered: &[vec4]) -> Vec<vec3> {
    let tracer = tracer(scene, *effects);
    let guides = GuideRays { size: tracer.frame.path.size, guide, filtered };
    (0..guide.len() as u32).map(|p| look_up(&tracer, &guides, p, 0..EYE_RAYS)).collect()
}

fn tracer(scene: &Loaded, effects: Effects) -> Tracer<'_> {
    Tracer { scene, frame: frame_constants(scene, &scene.settings).unwrap(), effects, strategy: Strategy::Both }
}

/// A software device ends loops early, silently: all rays of a pixel in one loop brought a twentieth of the light.
#[test]
fn tens_of_thousands_of_eye_rays_bring_what_a_few_do() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", [4, 2], PixelFilter::Box);
    let (guide, filtered) = guides(&scene);
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let [few, many] = [4096, 1 << 16].map(|n| renderer.look_up(&guide, &filtered, n).unwrap().0);
    let apart = |a: &[vec3], b: &[vec3]| largest(a.iter().zip(b).map(|(a, b)| (a[1] - b[1]).abs() / b[1].max(0.01)));
    assert!(apart(&few, &many) < 0.03, "{few:?} {many:?}");
    let mut turned = many.clone();
    turned.rotate_right(1);
    assert!(apart(&few, &turned) > 0.1, "control: pixels differ");
    assert_silent(&gpu);
}

fn differing(a: &[vec3], b: &[vec3]) -> usize {
    let differs = |(a, b): (&vec3, &vec3)| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-4 || a[c].is_nan() != b[c].is_nan());
    a.iter().zip(b).filter(|&pair| differs(pair)).count()
}

#[test]
fn the_kernel_agrees_with_its_twin() {
    let gpu = gpu();
    for (file, filter) in [
        ("cornell-box/scene.toml", PixelFilter::Box),
        ("cornell-box/mirror.toml", PixelFilter::Gaussian),
        ("grass/scene.toml", PixelFilter::Tent),
    ] {
        for size in SIZES {
            let scene = scene(file, size, filter);
            let (guide, mut filtered) = guides(&scene);
            let [device, host] = both(&gpu, &scene, &guide, &filtered);
            let wrong = differing(&device, &host);
            // Rounding decides an edge or a choice here and there, on GPUs more often.
            let most = device.len() / if gpu.info().kind == DeviceKind::Cpu { 50 } else { 25 };
            assert!(wrong <= most, "{file} {size:?}: {wrong} pixels differ");
            if device.len() > 500 {
                filtered.rotate_right(1);
                let [turned, _] = both(&gpu, &scene, &guide, &filtered);
                assert!(differing(&turned, &host) > 200, "{file} {size:?} control: other pixels' light");
            }
        }
    }
    assert_silent(&gpu);
}

/// Plates whose light may take two ways, slopes that mirror into their own surface, and a mirror that shows walls and the sky.
fn plates() -> Loaded {
    let plate = |material: &str, x: f32, turn: &str| {
        format!(
            "[[mesh]]\nshape = 'rectangle'\nmaterial = '{material}'\n\
             transform = {{ rotate = {turn}, translate = [{x}, 0.0, 0.0], scale = 0.9 }}\n"
        )
    };
    let plates = [
        plate("glass", -3.0, "[-75, 0, 0]"),
        plate("pane", -1.0, "[-80, 0, 0]"),
        plate("gold", 1.0, "[0, -60, 0]"),
        plate("silver", 3.0, "[0, -60, 0]"),
        plate("mirror", 5.0, "[-40, 30, 0]"),
    ];
    let scene = Workplace::new().picture("slope.png", 8, |_, _| [191, 128, 238]).scene(&format!(
        "[camera]\nposition = [1.0, 0.0, 9.0]\ntarget = [1.0, 0.0, 0.0]\nfov = 50.0\n[render]\nmax_depth = 6\n\
         [environment]\nradiance = 0.3\n[[material]]\nname = 'glass'\ntype = 'dielectric'\n\
         [[material]]\nname = 'pane'\ntype = 'metallic-roughness'\nmetallic = 0\nroughness = 0\ntransmission_factor = 1\n\
         [[material]]\nname = 'gold'\ntype = 'metallic-roughness'\nmetallic = 1\nroughness = 0\ncolor = [0.9, 0.7, 0.3]\n\
         normal_map = 'slope.png'\n[[material]]\nname = 'silver'\ntype = 'conductor'\nnormal_map = 'slope.png'\n\
         [[material]]\nname = 'mirror'\ntype = 'conductor'\n[[material]]\nname = 'red'\ncolor = [0.8, 0.1, 0.1]\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'red'\ntransform = {{ translate = [0.0, 0.0, -3.0], scale = 20.0 }}\n\
         [[mesh]]\nshape = 'cube'\nmaterial = 'red'\ntransform = {{ translate = [6.0, 6.0, 4.0], scale = 3.0 }}\n{}",
        plates.concat()
    ));
    scene.with(|s| [s.width, s.height] = [65, 33])
}

/// Under light of 1 what is left is the albedo that paths keep, which the same light was divided by.
#[test]
fn eye_rays_multiply_light_by_the_albedo_of_the_samples() {
    let gpu = gpu();
    let mut failures = Vec::new();
    let cornell = |file: &str| scene(&format!("cornell-box/{file}.toml"), [31, 33], PixelFilter::Box);
    for (name, scene) in [
        ("walls", cornell("scene")),
        ("mirror", cornell("mirror")),
        ("glass", cornell("glass")),
        ("bumps", pictures()),
        ("plates", plates()),
        ("plates, no further bounce", plates().with(|s| s.max_depth = 2)),
    ] {
        let pixels = scene.settings.pixels();
        let found = both(&gpu, &scene, &vec![surface(Z, 1.0); pixels], &vec![LIT; pixels]);
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
        // Roulette divides what the throughput of a path would be.
        let tracer = tracer(&scene, Effects { roulette: false, ..*renderer.effects() });
        let albedo = |p: u32| {
            let samples: Vec<_> = (0..EYE_RAYS).map(|k| tracer.sample(p, k)).collect();
            let mean: vec3 = (samples.iter().map(|s| s.albedo).sum::<glam::Vec3>() / EYE_RAYS as f32).into();
            (mean, samples.iter().any(|s| s.astray)) // no albedo of what the pixel shows
        };
        let (expected, astray): (Vec<vec3>, Vec<bool>) = (0..pixels as u32).map(albedo).unzip();
        let usual = |seen: &[vec3]| -> Vec<vec3> {
            seen.iter().zip(&astray).filter(|(_, astray)| !**astray).map(|(v, _)| *v).collect()
        };
        assert!(usual(&expected).len() > pixels * 9 / 10, "{name}, control: {} of {pixels}", usual(&expected).len());
        let wrong = found.each_ref().map(|seen| differing(&usual(seen), &usual(&expected)));
        if wrong.iter().any(|&n| n > pixels / 100) {
            failures.push(format!("{name}: {wrong:?} of {pixels} pixels of kernel and twin differ"));
        }
        assert!(differing(&found[0][1..], &expected[..pixels - 1]) > 50, "{name}, control: other pixels");
    }
    assert_eq!(failures, Vec::<String>::new());
    assert_silent(&gpu);
}

#[test]
fn no_guide_ray_spoils_the_image() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", [33, 17], PixelFilter::Box);
    let (good, filtered) = guides(&scene);
    let miss = Guide { object: NONE, material: NONE, ..Guide::default() };
    for image in both(&gpu, &scene, &vec![miss; good.len()], &filtered) {
        assert!(image.iter().all(|v| *v == [0.0; 3]), "nothing is met, so nothing is seen");
    }
    // Broken guide rays and broken light count as none.
    let (mut broken, mut unlit, mut dark) = (good.clone(), filtered.clone(), filtered.clone());
    for i in (0..good.len()).step_by(5) {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        match i % 3 {
            0 => broken[i].normal = [nan; 3],
            1 => broken[i].depth = [nan, inf, 0.0][i / 3 % 3],
            _ => unlit[i] = [[nan, 0.0, 0.0, 1.0], [0.0, inf, 0.0, 1.0]][i / 3 % 2],
        }
        dark[i][3] = 0.0;
    }
    let spoiled = both(&gpu, &scene, &broken, &unlit);
    let expected = both(&gpu, &scene, &good, &dark);
    assert_eq!(spoiled, expected);
    assert!(differing(&expected[0], &both(&gpu, &scene, &good, &filtered)[0]) > 50, "control: those pixels matter");
    for light in [0.0, 1e-30, 65504.0, 1e20, 1e38] {
        for image in both(&gpu, &scene, &good, &vec![[light, light, light, 1.0]; good.len()]) {
            assert!(image.iter().flatten().all(|v| v.is_finite() && *v >= 0.0), "{light}");
        }
    }
    assert_silent(&gpu);
}

/// It looks from where the renderer's camera is now; steps that go on with a film, and a frame that is compared with it, from where it was.
#[test]
fn a_lookup_leaves_the_film_its_camera() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", [4, 3], PixelFilter::Box);
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    renderer.run(&mut FrameResources::new(&gpu).unwrap(), &Step::Start).unwrap();
    let before = renderer.scene().camera.read().unwrap();
    let mut camera = before[0];
    camera.position[0] += 0.1;
    renderer.set_camera(camera).unwrap();
    let (guide, filtered) = guides(&scene);
    renderer.look_up(&guide, &filtered, 1).unwrap();
    assert_eq!(renderer.scene().camera.read().unwrap(), before);
    assert_silent(&gpu);
}

#[test]
fn what_does_not_fit_the_film_is_refused() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", [4, 3], PixelFilter::Box);
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let (guide, filtered) = guides(&scene);
    assert!(renderer.look_up(&guide, &filtered, 1).is_ok(), "control");
    for error in [
        renderer.look_up(&guide, &filtered, 0).unwrap_err(),
        renderer.look_up(&guide[1..], &filtered, 1).unwrap_err(),
        renderer.look_up(&guide, &filtered[1..], 1).unwrap_err(),
    ] {
        assert!(error.exit_code() == 2 && error.to_string().contains("guide rays"), "{error}");
    }
}
