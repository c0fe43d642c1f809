//! The path tracer against images of an independent renderer (Mitsuba 3, `tests/data/references/README.md`): every
//! pixel by a z-test with both standard errors, and the image means.
use crate::statistics::sidak_quantile;
use crate::support;
use crate::twin::Workplace;
use glam::dvec3;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use tallow::image::{self, Film, Picture};
use tallow::layout::{Guide, NONE};
use tallow::render::settings::Settings;
use tallow::render::{Outputs, Renderer};
use tallow::scene::{Loaded, Scene};

const SIZE: u32 = 128;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn reference(name: &str) -> Film {
    image::read(&root().join("tests/data/references").join(name)).unwrap()
}

fn colour(name: &str) -> Picture {
    reference(name).picture(None).unwrap()
}

/// (mean, squared standard error) of every pixel.
struct Estimate {
    mean: Vec<[f32; 3]>,
    error2: Vec<[f32; 3]>,
}

fn scene(file: &str, depth: u32, spp: u32) -> Loaded {
    let path: PathBuf = root().join("scenes/cornell-box").join(file);
    let size = |s: &mut Settings| {
        (s.width, s.height, s.spp, s.max_depth) = (SIZE, SIZE, spp, depth);
        s.roulette_depth = 0;
    };
    Scene::load(&path).map(|scene| scene.with(size)).unwrap()
}

fn render(file: &str, depth: u32, spp: u32) -> Estimate {
    let gpu = support::gpu();
    let scene = scene(file, depth, spp);
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let stats = support::render(&gpu, &renderer);
    support::assert_silent(&gpu);
    let error2 = |m2: f32, n: f32| m2 / (n * (n - 1.0));
    Estimate {
        mean: stats.iter().map(|s| s.mean).collect(),
        error2: stats.iter().map(|s| s.m2.map(|m2| error2(m2, s.count as f32))).collect(),
    }
}

/// Share of pixels whose three channels all pass.
fn share_passing(ours: &Estimate, mean: &Picture, error: &Picture) -> f64 {
    let limit = sidak_quantile(3 * mean.pixels.len());
    let passes = |i: usize| {
        (0..3).all(|c| {
            let (a, b) = (f64::from(ours.mean[i][c]), f64::from(mean.pixels[i][c]));
            let spread = f64::from(ours.error2[i][c]) + f64::from(error.pixels[i][c]).powi(2);
            // Where nothing varies (the light itself), single precision is all that may differ; and where a lobe's
            // tail is below 1e-12 of the image's mean, the reference has cut it off.
            (a - b).abs() <= limit * spread.sqrt() + 1e-5 * b.abs() + 1e-13
        })
    };
    (0..mean.pixels.len()).filter(|&i| passes(i)).count() as f64 / mean.pixels.len() as f64
}

/// Per channel: (ratio of the means, their difference in standard errors).
fn means(ours: &Estimate, mean: &Picture, error: &Picture) -> [(f64, f64); 3] {
    std::array::from_fn(|c| {
        let (mut a, mut b, mut spread) = (0.0, 0.0, 0.0);
        for i in 0..mean.pixels.len() {
            a += f64::from(ours.mean[i][c]);
            b += f64::from(mean.pixels[i][c]);
            spread += f64::from(ours.error2[i][c]) + f64::from(error.pixels[i][c]).powi(2);
        }
        (a / b, (a - b) / spread.sqrt())
    })
}

fn agrees(ours: &Estimate, mean: &Picture, error: &Picture) -> Result<(), String> {
    let share = share_passing(ours, mean, error);
    let means = means(ours, mean, error);
    println!("{:.4} % of pixels pass; means (ratio, z) {means:.4?}", 100.0 * share);
    let mean_ok = means.iter().all(|(ratio, z)| (ratio - 1.0).abs() <= 2e-3 || z.abs() <= 3.0);
    if share >= 0.9975 && mean_ok { Ok(()) } else { Err(format!("{share} of pixels pass, means {means:?}")) }
}

fn check(file: &str, variant: &str, depth: u32, spp: u32) {
    let mean = colour(&format!("ref_{variant}_d{depth}.exr"));
    let error = colour(&format!("ref_{variant}_d{depth}_se.exr"));
    let mut ours = render(file, depth, spp);
    agrees(&ours, &mean, &error).unwrap_or_else(|e| panic!("{variant} depth {depth}: {e}"));
    // Control: light that is 2 % too strong must be noticed.
    ours.mean.iter_mut().for_each(|p| *p = p.map(|v| v * 1.02));
    assert!(agrees(&ours, &mean, &error).is_err(), "{variant} depth {depth}: the check cannot fail");
}

/// And samples per pixel: the last picture holds the light of the ones before, whose fewer samples tell where paths end.
const DEPTHS: [(u32, u32); 3] = [(2, 256), (3, 256), (4, 1024)];

#[test]
fn diffuse_box_matches_at_every_depth() {
    DEPTHS.iter().for_each(|&(depth, spp)| check("scene.toml", "diffuse", depth, spp));
}

#[test]
fn conductor_box_matches_at_every_depth() {
    DEPTHS.iter().for_each(|&(depth, spp)| check("conductor.toml", "conductor", depth, spp));
}

#[test]
fn point_light_box_matches_at_every_depth() {
    DEPTHS.iter().for_each(|&(depth, spp)| check("point.toml", "point", depth, spp));
}

fn plane(film: &Film, name: &str) -> Vec<f32> {
    film.channel(name).unwrap_or_else(|| panic!("no channel {name}")).to_f32().into_owned()
}

fn planes(film: &Film, name: &str, parts: [&str; 3]) -> [Vec<f32>; 3] {
    parts.map(|part| plane(film, &format!("{name}.{part}")))
}

/// Pixels at which depth, position, normal, object or albedo is not the reference's; of `metal` it says no albedo.
fn unlike_first_hits(guide: &[Guide], centre: &Film, metal: Option<f32>) -> Vec<usize> {
    let (t, shape) = (plane(centre, "t.T"), plane(centre, "shape.I"));
    let [normal, position] = ["n", "pos"].map(|name| planes(centre, name, ["X", "Y", "Z"]));
    let albedo = planes(centre, "albedo", ["R", "G", "B"]);
    let unlike = |&i: &usize| {
        let g = &guide[i];
        if t[i] < 0.0 {
            return g.object != NONE || g.depth != 0.0;
        }
        let near = |ours: [f32; 3], planes: &[Vec<f32>; 3], tolerance: f32| {
            ours.iter().zip(planes).all(|(a, plane)| (a - plane[i]).abs() <= tolerance)
        };
        g.object as f32 != shape[i]
            || (g.depth - t[i]).abs() > 1e-5 * t[i]
            || !near(g.position, &position, 1e-4)
            || !near(g.normal, &normal, 1e-5)
            || !(near(g.albedo, &albedo, 1e-5) || metal == Some(shape[i]))
    };
    (0..guide.len()).filter(unlike).collect()
}

#[test]
fn first_hits_match_at_pixel_centres() {
    let gpu = support::gpu();
    let outputs = Outputs { guides: true, ..Outputs::default() };
    let variants =
        [("scene.toml", "diffuse", None), ("conductor.toml", "conductor", Some(6.0)), ("point.toml", "point", None)];
    for (file, variant, metal) in variants {
        let scene = scene(file, 1, 1); // guides take no samples
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
        support::render(&gpu, &renderer);
        let guide = renderer.film().tiles[0].guide.read().unwrap();
        let centre = reference(&format!("center_{variant}.exr"));
        assert_eq!(unlike_first_hits(&guide, &centre, metal), [0; 0], "{variant}");
        // Control: one thing that is off in one pixel, on the floor.
        let changes: [fn(&mut Guide); 5] = [
            |g| g.object += 1,
            |g| g.depth *= 1.0001,
            |g| g.position[1] -= 2e-4,
            |g| g.normal[2] += 1e-4,
            |g| g.albedo[2] += 1e-3,
        ];
        for change in changes {
            let (pixel, mut other) = ((120 * SIZE + 64) as usize, guide.clone());
            change(&mut other[pixel]);
            assert_eq!(unlike_first_hits(&other, &centre, metal), [pixel], "{variant}: control");
        }
    }
    support::assert_silent(&gpu);
}

/// A square with a map of hills (3 across, 2 along; heights times `scale`, or normals), lit from low on the left.
fn hills(map: &str, material: &str, scale: f32) -> Loaded {
    let wave = |i: u32, periods: u32| (TAU * f64::from(periods) * (f64::from(i) + 0.5) / 64.0).sin();
    let height = |x: u32, y: u32| [(127.5 + 127.5 * wave(x, 3) * wave(y, 2)).round() as u8; 3];
    let normal = |x: u32, y: u32| {
        let n = dvec3(0.75 * wave(x, 3), 0.6 * wave(y, 2), 0.5).normalize();
        n.to_array().map(|v| ((v + 1.0) * 127.5).round() as u8)
    };
    let place = Workplace::new().picture("bump.png", 64, height).picture("normal.png", 64, normal);
    let material = match material {
        "metal" => "type = 'conductor'\nmetal = 'Al'\nalpha = 0.3\ndistribution = 'ggx'",
        _ => "color = 0.7",
    };
    let map = match map {
        "bump" => format!("bump = 'bump.png'\nbump_scale = {scale}"),
        _ => "normal_map = 'normal.png'".into(),
    };
    place.scene(&format!(
        "[film]\nwidth = 32\nheight = 32\n[camera]\nposition = [0.0, 1.1, 3.2]\ntarget = [0.0, 0.0, 0.0]\nfov = 45.0\n\
         [render]\nspp = 1024\nmax_depth = 2\n[environment]\nradiance = 0.1\n[[material]]\nname = 'hills'\n{material}\n{map}\n\
         [[material]]\nname = 'lamp'\ncolor = 0.0\nemission = 20.0\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'hills'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 1.5 }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
         transform = {{ translate = [-3.0, 1.2, 0.5], rotate = [0.0, 90.0, 0.0], scale = 0.5 }}\n"
    ))
}

/// Of blocks of 4 by 4 pixels the largest relative difference, beyond four standard errors.
fn worst_block(scene: &Loaded, name: &str) -> f64 {
    let gpu = support::gpu();
    let renderer = Renderer::new(&gpu, scene, &scene.settings, Outputs::default()).unwrap();
    let ours = support::render(&gpu, &renderer);
    support::assert_silent(&gpu);
    let (mean, error) = (colour(&format!("{name}.exr")).pixels, colour(&format!("{name}_se.exr")).pixels);
    let block = |b: usize| {
        let (mut a, mut m, mut spread) = (0.0, 0.0, 0.0);
        for i in (0..16).map(|i| (b / 8 * 4 + i / 4) * 32 + b % 8 * 4 + i % 4) {
            let n = ours[i].count as f32;
            a += f64::from(ours[i].mean[1]);
            m += f64::from(mean[i][1]);
            spread += f64::from(ours[i].m2[1] / (n * (n - 1.0)) + error[i][1] * error[i][1]);
        }
        ((a - m).abs() - 4.0 * spread.sqrt()) / m
    };
    support::largest_f64((0..64).map(block))
}

#[test]
fn maps_match_in_blocks() {
    for (map, material) in [("bump", "diffuse"), ("normal", "diffuse"), ("bump", "metal"), ("normal", "metal")] {
        let worst = worst_block(&hills(map, material, 0.35), &format!("{map}_{material}"));
        println!("{map} {material}: {worst:.4}");
        assert!(worst < 0.02, "{map} {material}: a block is {worst} off");
    }
    let steeper = worst_block(&hills("bump", "diffuse", 0.4), "bump_diffuse");
    assert!(steeper > 0.02, "control: hills that are a seventh higher, {steeper}");
}
