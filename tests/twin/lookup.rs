//! Tests the lookup of filtered light along eye rays: the choice among four guide rays by hand, the kernel against its twin, and
//! guide rays with invalid values.
use crate::support::{assert_silent, gpu, hash};
use glam::{Vec2, vec2};
use std::path::Path;
use tallow::gpu::Gpu;
use tallow::layout::{Effects, Guide, NONE, vec3, vec4};
use tallow::render::settings::PixelFilter;
use tallow::render::{Outputs, Renderer, frame_constants};
use tallow::scene::{Loaded, Scene};
use tallow::twins::guide_lookup::{GuideRays, look_up};
use tallow::twins::path::{Strategy, Tracer};
use tallow::twins::primary_hit::guide;

/// Around the workgroups' sizes, one row, one column, one pixel.
const SIZES: [[u32; 2]; 6] = [[1, 1], [31, 1], [1, 65], [64, 1], [65, 2], [33, 17]];
const EYE_RAYS: u32 = 5;

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
    let apart =
        |a: &[vec3], b: &[vec3]| a.iter().zip(b).map(|(a, b)| (a[1] - b[1]).abs() / b[1].max(0.01)).fold(0.0, f32::max);
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
            // Rounding decides an edge or a choice here and there.
            assert!(wrong <= device.len() / 50, "{file} {size:?}: {wrong} pixels differ");
            if device.len() > 500 {
                filtered.rotate_right(1);
                let [turned, _] = both(&gpu, &scene, &guide, &filtered);
                assert!(differing(&turned, &host) > 200, "{file} {size:?} control: other pixels' light");
            }
        }
    }
    assert_silent(&gpu);
}

/// Under light of 1 what is left is the albedo of the eye rays, which are those of the pixel's samples.
#[test]
fn eye_rays_are_those_of_the_samples() {
    let scene = scene("cornell-box/scene.toml", [31, 33], PixelFilter::Box);
    let effects = Effects { indirect: true, ..Effects::default() };
    let (guide, _) = guides(&scene);
    let seen = twin(&scene, &effects, &guide, &vec![LIT; guide.len()]);
    let tracer = tracer(&scene, effects);
    let albedo = |p: u32| (0..EYE_RAYS).map(|k| tracer.sample(p, k).albedo).sum::<glam::Vec3>() / EYE_RAYS as f32;
    let expected: Vec<vec3> = (0..seen.len() as u32).map(|p| albedo(p).into()).collect();
    assert_eq!(differing(&seen, &expected), 0);
    assert!(differing(&seen[1..], &expected[..seen.len() - 1]) > 100, "control: other pixels");
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
