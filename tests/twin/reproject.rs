//! Compares the kernels of reprojection with their CPU twin. Rounding moves a few points to another pixel: nearly all pixels must
//! begin with the same samples, bit for bit.
use crate::moving::{Film, shifted, turned};
use crate::support::{assert_silent, gpu};
use glam::Vec3;
use std::path::Path;
use tallow::layout::{Camera, FrameConstants, Guide, PixelLight, PixelStats, ReprojectPush};
use tallow::render::{Carriage, Reproject, carried_samples, frame_constants};
use tallow::scene::{Loaded, Scene};
use tallow::twins::camera::{camera_ray, film_from_pixel, film_from_point};
use tallow::twins::primary_hit::{guide, point};
use tallow::twins::reproject::{Left, Reprojection};

/// Around the workgroups' sizes, one row, one column, one pixel.
const SIZES: [[u32; 2]; 6] = [[1, 1], [31, 1], [1, 65], [64, 1], [65, 2], [49, 33]];

fn scene(file: &str, [width, height]: [u32; 2]) -> Loaded {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
    let small = |s: &mut tallow::render::settings::Settings| (s.width, s.height, s.spp) = (width, height, 3);
    Scene::load(&path).map(|scene| scene.with(small)).unwrap()
}

fn push(scene: &Loaded, s: Reproject) -> ReprojectPush {
    let settings = &scene.settings;
    ReprojectPush {
        size: [settings.width, settings.height],
        first_pixel: 0,
        pixels: settings.pixels() as u32,
        max_error: s.reproject_error,
        aliasing: s.reproject_aliasing,
        max_samples: s.reproject_samples,
        max_age: s.reproject_age,
        spp: settings.spp,
        moved: 0,
        ..Default::default()
    }
}

/// What pixels begin with: words, statistics, light.
type Begun = (Vec<u32>, Vec<(PixelStats, PixelLight)>);

/// Moves a film to the camera. Returns what pixels begin with, by the kernels and by the twin.
fn both(film: &mut Film, scene: &Loaded, settings: Reproject, camera: Camera) -> [Begun; 2] {
    let tile = &film.renderer.film().tiles[0];
    let (guides, stats) = (tile.guide.read().unwrap(), film.stats());
    let (points, light, carried) = (film.points(), film.light(), film.carried());
    let left = Left { guide: &guides, points: &points, stats: &stats, light: &light, carried: &carried };
    let reprojection = Reprojection { scene, previous: film.camera, camera, push: push(scene, settings) };
    let mut handed = reprojection.remember(&left);
    let frame = FrameConstants { camera, ..frame_constants(scene, &scene.settings).unwrap() };
    let pixels = 0..scene.settings.pixels() as u32;
    let seen: Vec<Guide> = pixels.clone().map(|i| guide(scene, &frame, i)).collect();
    let mut points: Vec<_> = pixels.map(|i| point(scene, &frame, i)).collect();
    let mut words = reprojection.project(&mut handed, &points);
    let twin = reprojection.carry(&handed, &mut words, &seen, &mut points);

    film.begin(camera);
    film.camera = camera;
    let begun: Vec<_> = film.stats().into_iter().zip(film.light()).collect();
    let differ = film.offered().iter().zip(&handed.offered).filter(|(a, b)| a != b).count();
    assert!(differ * 50 <= words.len(), "{differ} pixels of {} hand on something else", words.len());
    [(film.carried(), begun), (words, twin)]
}

fn agreeing([a, b]: &[Begun; 2]) -> usize {
    (0..a.0.len()).filter(|&i| a.0[i] == b.0[i] && a.1[i] == b.1[i]).count()
}

#[test]
fn kernels_agree_with_their_twin() {
    let gpu = gpu();
    let settings = Reproject { reproject_samples: 4, ..Reproject::default() };
    let loose = Reproject { reproject_error: 1e3, reproject_aliasing: 1e9, ..settings };
    for (file, settings, least) in [
        ("cornell-box/scene.toml", settings, 0.25),
        ("cornell-box/glossy.toml", settings, 0.1),
        ("cornell-box/glossy.toml", loose, 0.25),
        ("cornell-box/glass.toml", settings, 0.15),
        ("grass/scene.toml", loose, 0.004),
    ] {
        for size in SIZES {
            let scene = scene(file, size);
            let mut film = Film::new(&gpu, &scene, settings);
            film.frame(film.camera);
            let reach = Vec3::from(scene.bounds[1]).distance(scene.bounds[0].into());
            let ways = [turned(film.camera, 2.3), shifted(film.camera, [0.004 * reach, 0.001 * reach, 0.01 * reach])];
            for (turn, camera) in ways.into_iter().enumerate() {
                let begun = both(&mut film, &scene, settings, camera);
                let (n, agree) = (begun[0].0.len(), agreeing(&begun));
                assert!(agree * 50 >= n * 49, "{file} {size:?} way {turn}: {agree} of {n}");
                let carried = begun[0].0.iter().filter(|&&word| carried_samples(word) > 0).count();
                let enough = size != [49, 33] || carried as f64 > least * n as f64;
                let found = Carriage::of(&film.offered(), &film.carried());
                assert!(enough, "{file} way {turn}: {carried} of {n} are carried: {found:?}");
                let [(words, mut stats), twin] = begun;
                stats.rotate_right(1);
                let control = agreeing(&[(words, stats), twin]);
                assert!(
                    size != [49, 33] || control < n - carried / 2,
                    "control: {control} of {n} agree with a neighbour's"
                );
                // The second way moves what was carried already, and what was added.
                film.renderer.steps().skip(1).for_each(|step| film.step(&step));
            }
        }
    }
    assert_silent(&gpu);
}

#[test]
fn points_project_to_where_rays_start() {
    let scene = scene("cornell-box/scene.toml", [37, 21]);
    let size = [37, 21];
    let camera = turned(scene.camera(size).unwrap(), 31.0);
    for (x, y) in [(0.1, 0.2), (18.5, 10.5), (36.9, 20.9), (-4.0, 30.0)] {
        let ray = camera_ray(&camera, film_from_pixel(glam::vec2(x, y), size), glam::Vec2::splat(0.5));
        let film = film_from_point(&camera, ray.origin + 7.0 * ray.direction, size);
        assert!((film.x - x).abs() < 1e-4 && (film.y - y).abs() < 1e-4 && film.z > 0.0, "{film} for {x} {y}");
        let behind = film_from_point(&camera, ray.origin - 7.0 * ray.direction, size);
        assert!(behind.z < 0.0, "{behind}");
    }
    let flat = Camera { right: camera.up, ..camera };
    let film = film_from_point(&flat, Vec3::from(camera.position) + Vec3::from(camera.forward), size);
    assert!(!(film.x >= 0.0 && film.y >= 0.0 && film.z > 0.0 && film.is_finite()), "axes in one plane: {film}");
}
