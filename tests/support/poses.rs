//! A scene in which everything can move, and poses of it: by [`Scene::apply`], and as a description of its own.
#![allow(dead_code)]
use tallow::scene::description::*;
use tallow::scene::{EnvironmentChange, Loaded, MaterialChange, Pose, Scene, Vertices};

/// Vertices along an edge of the cloth.
const EDGE: u32 = 24;

/// What a test moves; the default is how the scene is loaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Turns of the instances, as a share of a circle.
    pub turn: f64,
    /// Height of the cloth's waves.
    pub wave: f32,
    /// Scale of the second instance along x; negative mirrors, 0 hides.
    pub scale: f64,
    /// Factor of all lights, and of the lamp's emission.
    pub light: f32,
    /// Sideways shift of the camera.
    pub step: f64,
}

impl Default for Moment {
    fn default() -> Self {
        Self { turn: 0.0, wave: 0.1, scale: 1.0, light: 1.0, step: 0.0 }
    }
}

/// Moments that change one thing each, and all.
pub const MOMENTS: [Moment; 6] = [
    Moment { turn: 0.2, wave: 0.1, scale: 1.0, light: 1.0, step: 0.0 },
    Moment { turn: 0.0, wave: 0.6, scale: 1.0, light: 1.0, step: 0.0 },
    Moment { turn: 0.1, wave: 0.1, scale: -1.5, light: 1.0, step: 0.0 },
    Moment { turn: 0.0, wave: 0.1, scale: 1.0, light: 2.5, step: 0.0 },
    Moment { turn: 0.0, wave: 0.1, scale: 1.0, light: 1.0, step: 0.7 },
    Moment { turn: 0.7, wave: -0.9, scale: 0.4, light: 0.25, step: -0.4 },
];

fn cloth(wave: f32) -> Mesh {
    let points = || (0..EDGE * EDGE).map(|i| [i % EDGE, i / EDGE].map(|v| v as f32 / (EDGE - 1) as f32 * 2.0 - 1.0));
    let positions = points().map(|[x, z]| [x, wave * (4.0 * x + 9.0 * z * wave).sin(), z]).collect();
    let normals = points().map(|[x, z]| [-wave * 4.0 * (4.0 * x + 9.0 * z * wave).cos(), 1.0, 0.0]).collect();
    let cell = |i: u32| {
        let a = i / (EDGE - 1) * EDGE + i % (EDGE - 1);
        [a, a + EDGE, a + 1, a + 1, a + EDGE, a + EDGE + 1]
    };
    let indices = (0..(EDGE - 1).pow(2)).flat_map(cell).collect();
    Mesh { positions, normals, indices, ..Mesh::default() }
}

fn steps(moment: &Moment) -> [Transform; 3] {
    let (sin, cos) = (moment.turn * std::f64::consts::TAU).sin_cos();
    let at = |x: f64, y: f64, z: f64, scale: f64| {
        Transform::try_from([scale * cos, 0., sin, x, 0., 1., 0., y, -scale * sin, 0., cos, z, 0., 0., 0., 1.]).unwrap()
    };
    [at(cos, 0.8, sin, 1.0), at(-1.3 * cos, 1.2, 1.3 * sin, moment.scale), at(0.3 * sin, 2.4, 0.0, 1.0)]
}

fn lamp(moment: &Moment) -> LightTable {
    LightTable {
        position: Some([2.0 * moment.light, 3.0, 1.0]),
        intensity: Some(Rgb([4.0 * moment.light; 3])),
        ..LightTable::default()
    }
}

fn camera(moment: &Moment) -> Camera {
    Camera { position: Some([moment.step, 2.0, 6.0]), target: Some([0.0, 0.8, 0.0]), ..Camera::default() }
}

/// The scene, loaded at a moment.
pub fn at(moment: &Moment) -> Loaded {
    let shape = |name: &str, shape, material: &str| MeshTable {
        name: Some(name.into()),
        shape: Some(shape),
        material: Some(material.into()),
        ..MeshTable::default()
    };
    let wide = Transform::try_from([5., 0., 0., 0., 0., 0., 5., -0.5, 0., -5., 0., 0., 0., 0., 0., 1.]).unwrap();
    let panel = Transform::try_from([0.5, 0., 0., 0., 0., 0., -0.5, 0., 0., 0.5, 0., 0., 0., 0., 0., 1.]).unwrap();
    let material = |name: &str, color: f32, emission: f32| MaterialTable {
        name: name.into(),
        color: Some(Rgb([color, 0.5, 0.3])),
        emission: (emission > 0.0).then_some(Rgb([emission; 3])),
        ..MaterialTable::default()
    };
    let [cube, ball, light] = steps(moment);
    let place = |mesh: &str, transform| InstanceTable { mesh: mesh.into(), transform, ..InstanceTable::default() };
    let description = Description {
        camera: camera(moment),
        environment: Some(EnvironmentTable { radiance: Some(Rgb([0.2 * moment.light; 3])), ..Default::default() }),
        mesh: vec![
            MeshTable { transform: wide, ..shape("floor", Shape::Rectangle, "grey") },
            shape("cube", Shape::Cube, "grey"),
            shape("ball", Shape::Sphere, "red"),
            MeshTable { moving: true, transform: panel, ..shape("panel", Shape::Rectangle, "lamp") },
            MeshTable {
                name: Some("cloth".into()),
                data: Some(cloth(moment.wave)),
                material: Some("red".into()),
                moving: true,
                ..MeshTable::default()
            },
        ],
        instance: vec![
            InstanceTable { name: Some("cube".into()), ..place("cube", cube) },
            place("ball", ball),
            place("panel", light),
        ],
        material: vec![
            material("grey", 0.6, 0.0),
            material("red", 0.9, 0.0),
            material("lamp", 0.0, 9.0 * moment.light),
        ],
        light: vec![lamp(moment)],
        ..Description::default()
    };
    Scene::build(&description).unwrap().with(|s| (s.width, s.height, s.spp, s.max_depth) = (48, 32, 4, 4))
}

/// What brings the scene to a moment, whatever it was before.
pub fn pose(scene: &Scene, moment: &Moment, rebuild_above: f32) -> Pose {
    let lamp_material = scene.names.materials.iter().position(|name| name == "lamp").unwrap();
    let Mesh { positions, normals, .. } = cloth(moment.wave);
    let emission = Some([9.0 * moment.light; 3]);
    Pose {
        camera: Some(camera(moment)),
        instances: steps(moment).into_iter().enumerate().collect(),
        meshes: vec![(scene.rig.mesh("cloth").unwrap(), Vertices { positions, normals, ..Vertices::default() })],
        materials: vec![(lamp_material, MaterialChange { emission, ..MaterialChange::default() })],
        lights: vec![(0, lamp(moment))],
        environment: Some(EnvironmentChange { radiance: Some([0.2 * moment.light; 3]), rotation: None }),
        rebuild_above,
    }
}
