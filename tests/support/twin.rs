//! Scenes made in a test, and the mean of their picture by the CPU twin.
#![allow(dead_code)]
use glam::{Vec3, vec3};
use image::codecs::png::PngEncoder;
use rayon::prelude::*;
use std::fmt::Write;
use std::fs::File;
use tallow::image::{Film, Samples, WriteOptions};
use tallow::layout::Effects;
use tallow::render::frame_constants;
use tallow::render::settings::Sampler;
use tallow::scene::{Loaded, Scene};
use tallow::twins::path::{Strategy, Tracer};
use tallow::twins::scene::world_from_object;

/// A generator of uniform random numbers.
pub struct Random(fastrand::Rng);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(fastrand::Rng::with_seed(seed))
    }

    /// Number `i` of many sequences.
    pub fn stream(i: usize) -> Self {
        Self::new(i as u64)
    }

    /// A number in [0, 1).
    pub fn unit(&mut self) -> f32 {
        self.0.f32()
    }

    /// A point of [-1, 1)^3.
    pub fn point(&mut self) -> Vec3 {
        Vec3::from([0; 3].map(|_| 2.0 * self.unit() - 1.0))
    }
}

/// A folder for the files of one scene.
pub struct Workplace(tempfile::TempDir);

impl Workplace {
    pub fn new() -> Self {
        Self(tempfile::tempdir().expect("a temporary folder"))
    }

    pub fn obj(self, name: &str, triangles: &[[Vec3; 3]]) -> Self {
        let mut text = String::new();
        for v in triangles.iter().flatten() {
            writeln!(text, "v {} {} {}", v.x, v.y, v.z).unwrap();
        }
        (0..triangles.len()).for_each(|i| writeln!(text, "f {} {} {}", 3 * i + 1, 3 * i + 2, 3 * i + 3).unwrap());
        std::fs::write(self.0.path().join(name), text).unwrap();
        self
    }

    pub fn file(self, name: &str, text: &str) -> Self {
        std::fs::write(self.0.path().join(name), text).unwrap();
        self
    }

    /// A grey environment image.
    pub fn sky(self, name: &str, width: u32, height: u32, light: impl Fn(u32, u32) -> f32) -> Self {
        let mut film = Film::new(width, height);
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        film.add("Y", Samples::F32(pixels.map(|(x, y)| light(x, y)).collect()));
        tallow::image::write(&self.0.path().join(name), &film, &WriteOptions::default()).unwrap();
        self
    }

    /// A square colour picture.
    pub fn picture(self, name: &str, side: u32, texel: impl Fn(u32, u32) -> [u8; 3]) -> Self {
        let image = image::RgbImage::from_fn(side, side, |x, y| image::Rgb(texel(x, y)));
        // The image's own `save` would compile every encoder.
        let file = File::create(self.0.path().join(name)).unwrap();
        image.write_with_encoder(PngEncoder::new(file)).unwrap();
        self
    }

    pub fn scene(&self, text: &str) -> Loaded {
        let path = self.0.path().join("scene.toml");
        Scene::parse(&path, text).unwrap_or_else(|e| panic!("{e}"))
    }
}

/// Centre of [`ball`].
pub const BALL: Vec3 = vec3(0.3, -0.2, 5.0);

/// A closed mesh of radius 1 in world space.
pub fn ball() -> Loaded {
    let sphere = "[[mesh]]\nshape = 'sphere'\nsegments = 128\ntransform = { translate = [0.3, -0.2, 5.0] }\n";
    Workplace::new().scene(sphere)
}

/// [`ball`] as an instance that is turned.
pub fn instanced_ball() -> Loaded {
    let sphere = "[[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 128\n[[instance]]\nmesh = 'ball'\n";
    let turned = "transform = { translate = [0.3, -0.2, 5.0], rotate = [20.0, 40.0, 60.0] }\n";
    let scene = Workplace::new().scene(&format!("{sphere}{turned}"));
    assert_eq!(scene.instances.len(), 1);
    scene
}

/// A room under a panel that is as wide as its ceiling.
pub fn under_a_panel() -> Loaded {
    room_under(Workplace::new(), "shape = 'rectangle'")
}

/// The same under one of 50 triangles.
pub fn under_many_panels() -> Loaded {
    let corner = |i: usize| vec3((i % 6) as f32 * 0.4 - 1.0, (i / 6) as f32 * 0.4 - 1.0, 0.0);
    let square = |i: usize| {
        let at = i / 5 * 6 + i % 5;
        let [a, b, c, d] = [at, at + 1, at + 7, at + 6].map(corner);
        [[a, b, c], [a, c, d]]
    };
    let triangles: Vec<_> = (0..25).flat_map(square).collect();
    room_under(Workplace::new().obj("panels.obj", &triangles), "file = 'panels.obj'")
}

fn room_under(place: Workplace, panel: &str) -> Loaded {
    place.scene(&format!(
        "[film]\nwidth = 16\nheight = 16\n[camera]\nposition = [0.2, -0.4, 0.9]\ntarget = [0.0, 0.3, -1.0]\nfov = 80.0\n\
         [render]\nmax_depth = 3\n[[material]]\nname = 'wall'\ncolor = 0.5\n\
         [[material]]\nname = 'metal'\ntype = 'conductor'\nmetal = 'Al'\nalpha = 0.2\n\
         [[material]]\nname = 'lamp'\nemission = [4.0, 5.0, 6.0]\n\
         [[mesh]]\nshape = 'cube'\nflip_normals = true\nmaterial = 'wall'\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'metal'\ntransform = {{ translate = [0.3, 0.3, -0.4], scale = 0.4 }}\n\
         [[mesh]]\n{panel}\nmaterial = 'lamp'\n\
         transform = {{ translate = [0.0, 0.8, 0.0], rotate = [90.0, 0.0, 0.0], scale = 0.9 }}\n",
    ))
}

/// A ray towards a point where triangles meet, `distance` away.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    pub origin: Vec3,
    pub direction: Vec3,
    pub distance: f32,
}

/// Ray `i` of many from `origin(random)` to vertices and to points on edges of a ball, in turn. `None` from outside
/// near the silhouette, where a ray may pass beside it.
pub fn aimed_at_seam(scene: &Loaded, i: usize, origin: impl Fn(&mut Random) -> Vec3) -> Option<Aim> {
    let mut random = Random::stream(i);
    let t = scene.triangles[(random.unit() * scene.triangles.len() as f32) as usize];
    let place = |p: [f32; 3]| match scene.instances.first() {
        Some(instance) => world_from_object(instance).point(p.into()),
        None => p.into(),
    };
    let [a, b] = [t.v0, t.v1].map(place);
    let target = if i.is_multiple_of(2) { a } else { a.lerp(b, random.unit()) };
    let origin = origin(&mut random);
    let distance = (target - origin).length();
    let direction = (target - origin) / distance;
    let grazes = direction.dot(target - BALL).abs() < 0.3 && origin.distance(BALL) > 1.0;
    (!grazes).then_some(Aim { origin, direction, distance })
}

/// Mean of the picture's channels and the standard error of that mean.
#[derive(Clone, Copy, Debug)]
pub struct Estimate {
    pub mean: f64,
    pub error: f64,
}

impl Estimate {
    /// Within three standard errors, or the rounding of a picture without noise.
    pub fn is(&self, exact: f64) -> bool {
        (self.mean - exact).abs() < (3.0 * self.error).max(1e-5 * exact)
    }

    /// Within three standard errors of the difference.
    pub fn agrees(&self, other: &Self) -> bool {
        (self.mean - other.mean).abs() < 3.0 * self.error.hypot(other.error)
    }
}

/// The picture's mean over `samples` independent samples per pixel (Sobol points would hide the error).
pub fn mean(scene: &Loaded, strategy: Strategy, samples: u32) -> Estimate {
    let mut scene = scene.clone();
    scene.settings.sampler = Sampler::Independent;
    let tracer = Tracer {
        scene: &scene,
        frame: frame_constants(&scene, &scene.settings).unwrap(),
        effects: Effects::ALL,
        strategy,
    };
    let pixels = scene.settings.pixels() as u32;
    // Per pixel, the mean over samples and its variance: pixels differ, which is no error of the picture's mean.
    let of_pixel = |pixel| {
        let values: Vec<f64> =
            (0..samples).map(|index| f64::from(tracer.sample(pixel, index).radiance().element_sum()) / 3.0).collect();
        assert!(values.iter().all(|v| v.is_finite()), "pixel {pixel}: {values:?}");
        let mean = values.iter().sum::<f64>() / f64::from(samples);
        let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        (mean, square / f64::from(samples - 1) / f64::from(samples))
    };
    let sums: Vec<_> = (0..pixels).into_par_iter().map(of_pixel).collect();
    let (mean, variance) = sums.iter().fold((0.0, 0.0), |(m, v), s| (m + s.0, v + s.1));
    let n = f64::from(pixels);
    Estimate { mean: mean / n, error: variance.sqrt() / n }
}

/// A gallery of small lamps of all kinds, a few of which matter to each place, below a dim sky, and as many `points` of light.
pub fn many_lamps(points: usize) -> Loaded {
    many_lamps_and(points, "")
}

/// A bulb that is the key light of what is near it, beside [`many_lamps`].
pub const BULB: &str = "[[light]]\ntype = 'point'\nposition = [-3.2, 0.9, 0.0]\nintensity = 20.0\n";
/// A sun that is the key light of the rest.
pub const SUN: &str = "[[light]]\ntype = 'directional'\ndirection = [0.5, -1.0, 0.2]\nirradiance = 1.6\n";

/// The same, and what the tables `more` say.
pub fn many_lamps_and(points: usize, more: &str) -> Loaded {
    let mut random = Random::new(11);
    let mut place = Workplace::new();
    let mut text = "[film]\nwidth = 16\nheight = 16\n[camera]\nposition = [-4.5, 0.8, 0.0]\ntarget = [-3.2, 0.0, 0.0]\nfov = 40.0\n\
                    [render]\nmax_depth = 2\n[environment]\nradiance = 0.02\n[[material]]\nname = 'plastic'\ntype = 'coated'\n\
                    alpha = 0.2\n[[mesh]]\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = [6.0, 1.5, 1.0] }\n\
                    [[mesh]]\nshape = 'cube'\nmaterial = 'plastic'\ntransform = { translate = [-3.0, 0.3, 0.2], scale = 0.3 }\n"
        .to_owned();
    for (name, emission) in [("a", "20.0"), ("b", "[90.0, 40.0, 20.0]\nemission_two_sided = true")] {
        let triangles = [0; 12].map(|_| {
            let middle = vec3(6.0, 0.4, 1.4) * random.point() + 1.4 * Vec3::Y;
            [0; 3].map(|_| middle + 0.15 * random.point())
        });
        place = place.obj(&format!("{name}.obj"), &triangles);
        text += &format!("[[material]]\nname = '{name}'\nemission = {emission}\n");
        text += &format!("[[mesh]]\nfile = '{name}.obj'\nmaterial = '{name}'\n");
    }
    let mut at = |height: f32| (vec3(6.0, 0.3, 1.4) * random.point() + height * Vec3::Y).to_array();
    for _ in 0..6 {
        let place = at(1.2);
        text += &format!(
            "[[mesh]]\nshape = 'sphere'\nmaterial = 'a'\ntransform = {{ scale = 0.06, translate = {place:?} }}\n"
        );
    }
    for i in 0..points {
        let (place, axis) = (at(1.8), at(-1.0));
        text += &match i % 2 {
            0 => format!("[[light]]\ntype = 'point'\nposition = {place:?}\nintensity = 0.3\n"),
            _ => format!(
                "[[light]]\ntype = 'spot'\nposition = {place:?}\ndirection = {axis:?}\nintensity = 2.0\ncutoff = 30\n"
            ),
        };
    }
    place.scene(&(text + more))
}

/// A square whose corners have colours and opacities of their own.
const SQUARE: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                      property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\nelement face 2\n\
                      property list uchar int vertex_indices\nend_header\n-1 -1 0 20 90 200 255\n1 -1 0 250 10 30 0\n\
                      1 1 0 90 240 60 255\n-1 1 0 10 50 120 90\n3 0 1 2\n3 0 2 3\n";

/// A patterned lamp above a floor: `lamp` is its material, and `table` places its square.
pub fn patterned_lamp(lamp: &str, table: &str) -> Loaded {
    let place = Workplace::new()
        .picture("ramp.png", 16, |x, y| [(x * 15) as u8, (y * 15) as u8, 40])
        .picture("mask.png", 16, |x, y| [if (x / 4 + y / 4).is_multiple_of(2) { 255 } else { 0 }; 3])
        .file("square.ply", SQUARE);
    place.scene(&format!(
        "[film]\nwidth = 16\nheight = 16\n[camera]\nposition = [0.0, 3.0, 4.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 40.0\n\
         [render]\nmax_depth = 2\n[[material]]\nname = 'floor'\ncolor = 0.7\n[[material]]\nname = 'lamp'\n{lamp}\n\
         [[mesh]]\nname = 'floor'\nshape = 'rectangle'\nmaterial = 'floor'\n\
         transform = {{ rotate = [-90.0, 0.0, 0.0], scale = 3.0 }}\n[[mesh]]\nname = 'lamp'\nmaterial = 'lamp'\n{table}\n"
    ))
}

/// Materials of lamps whose corners differ, each with the mesh that it needs.
pub const PATTERNS: [[&str; 2]; 4] = [
    ["emission = 9.0\nemission_texture = { file = 'ramp.png', filter = 'nearest' }", "shape = 'rectangle'"],
    ["emission = 9.0\nopacity_texture = { file = 'mask.png', filter = 'nearest' }", "shape = 'rectangle'"],
    ["type = 'metallic-roughness'\nunlit = true", "file = 'square.ply'"],
    ["type = 'metallic-roughness'\nemission = 9.0\nalpha_mode = 'mask'\nalpha_cutoff = 0.5", "file = 'square.ply'"],
];

/// Places of such a lamp that mirror it: by an instance, and by a mesh that moves.
pub const MIRRORS: [&str; 2] = [
    "[[instance]]\nmesh = 'lamp'\ntransform = { scale = [-0.8, 1.0, 1.0], rotate = [90.0, 0.0, 0.0], translate = [0.1, 1.5, 0.0] }",
    "moving = true\ntransform = { scale = [-0.8, 1.0, 1.0], rotate = [90.0, 0.0, 0.0], translate = [0.1, 1.5, 0.0] }",
];
