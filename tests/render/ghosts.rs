//! Tests that carried samples forget light that has changed: lamps that go out or move away, and what stood before them, on
//! the screen or off it, before a camera at rest and one that moves. Frames that keep all samples are the control.
use crate::moving::{Film, shifted, turned};
use crate::support::{self, assert_silent, gpu};
use crate::twin::Workplace;
use tallow::gpu::Gpu;
use tallow::layout::Camera;
use tallow::render::{Outputs, Renderer, Reproject};
use tallow::scene::description::{LightTable, Rgb, Transform};
use tallow::scene::{Loaded, MaterialChange, Pose, Scene};

/// A floor, a wall and a ball under a small lamp that a board shades, all out of view, beside a bulb; a dim sky.
fn room() -> Loaded {
    let mut scene = Workplace::new().scene(
        "[camera]\nposition = [0.0, 1.6, 6.0]\ntarget = [0.0, 1.0, 0.0]\nfov = 45.0\n[render]\nmax_depth = 4\n\
         [environment]\nradiance = 0.05\n\
         [[material]]\nname = 'lamp'\ncolor = 0.0\nemission = 30.0\n[[material]]\nname = 'glow'\ncolor = 0.0\nemission = 4.0\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 6.0 }\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = { scale = 6.0, translate = [0.0, 0.0, -2.5] }\n\
         [[mesh]]\nshape = 'sphere'\nsegments = 48\ntransform = { scale = 0.7, translate = [-0.9, 0.7, 0.0] }\n\
         [[mesh]]\nname = 'panel'\nshape = 'rectangle'\nmaterial = 'lamp'\n\
         [[instance]]\nname = 'panel'\nmesh = 'panel'\ntransform = { rotate = [90.0, 0.0, 0.0], scale = 0.5, translate = [1.0, 6.0, 1.0] }\n\
         [[mesh]]\nname = 'board'\nshape = 'cube'\n\
         [[instance]]\nname = 'board'\nmesh = 'board'\ntransform = { scale = [1.2, 0.1, 1.2], translate = [0.3, 4.5, 0.5] }\n\
         [[mesh]]\nname = 'sign'\nshape = 'sphere'\nsegments = 24\nmaterial = 'glow'\n\
         [[instance]]\nname = 'sign'\nmesh = 'sign'\ntransform = { scale = 0.25, translate = [1.2, 0.6, 0.3] }\n\
         [[light]]\ntype = 'point'\nname = 'bulb'\nposition = [-3.0, 3.0, 2.5]\nintensity = 9.0\n",
    );
    let s = &mut scene.settings;
    (s.width, s.height, s.spp, s.max_depth) = (49, 33, 64, 4);
    scene
}

fn moved(scene: &Scene, name: &str, x: f64, y: f64, z: f64) -> Pose {
    let place = scene.rig.placement(name).unwrap();
    let at = Transform::from([1., 0., 0., x, 0., 1., 0., y, 0., 0., 1., z, 0., 0., 0., 1.]);
    let was = match name {
        "board" => Transform::from([1.2, 0., 0., 0., 0., 0.1, 0., 0., 0., 0., 1.2, 0., 0., 0., 0., 1.]),
        "panel" => Transform::from([0.5, 0., 0., 0., 0., 0., -0.5, 0., 0., 0.5, 0., 0., 0., 0., 0., 1.]),
        _ => Transform::from([0.25, 0., 0., 0., 0., 0.25, 0., 0., 0., 0., 0.25, 0., 0., 0., 0., 1.]),
    };
    Pose { instances: vec![(place, Transform(at.0 * was.0))], ..Pose::default() }
}

fn dark(scene: &Scene, name: &str) -> Pose {
    let material = scene.names.materials.iter().position(|n| n == name).unwrap();
    let emission = Some([0.0; 3]);
    Pose { materials: vec![(material, MaterialChange { emission, ..MaterialChange::default() })], ..Pose::default() }
}

fn bulb_out(_: &Scene) -> Pose {
    let (position, intensity) = (Some([-3.0, 3.0, 2.5]), Some(Rgb([0.0; 3])));
    Pose { lights: vec![(0, LightTable { position, intensity, ..LightTable::default() })], ..Pose::default() }
}

type Event = (&'static str, fn(&Scene) -> Pose);

const EVENTS: [Event; 6] = [
    ("a lamp out of view goes out", |scene| dark(scene, "lamp")),
    ("a lamp in view goes out", |scene| dark(scene, "glow")),
    ("a bulb goes out", bulb_out),
    ("a board out of view leaves", |scene| moved(scene, "board", 40.0, 4.5, 0.5)),
    ("a lamp out of view moves away", |scene| moved(scene, "panel", 40.0, 9.0, 1.0)),
    ("a lamp in view leaves", |scene| moved(scene, "sign", 0.0, 0.6, 40.0)),
];

/// The camera of a frame: at rest, or turning and walking.
fn way(camera: Camera, moves: bool, frame: u32) -> Camera {
    let t = if moves { frame as f32 } else { 0.0 };
    shifted(turned(camera, 0.4 * t - 1.6), [0.03 * t, 0.01 * t, 0.04 * t])
}

/// Light of all pixels, green.
fn energy(stats: &[tallow::layout::PixelStats]) -> f64 {
    stats.iter().map(|s| f64::from(s.mean[1])).sum()
}

fn converged(gpu: &Gpu, scene: &Loaded, camera: Camera) -> f64 {
    let long = scene.clone().with(|s| (s.spp, s.seed) = (512, 99));
    let mut renderer = Renderer::new(gpu, &long, &long.settings, Outputs::default()).unwrap();
    renderer.set_camera(camera).unwrap();
    energy(&support::render(gpu, &renderer))
}

/// What is left of the light that an event takes away or brings, four frames later, as a share of it.
fn ghost(gpu: &Gpu, (name, event): &Event, moves: bool, settings: Reproject) -> f64 {
    const BEFORE: u32 = 6;
    let mut scene = room();
    let mut film = Film::new(gpu, &scene, settings);
    let start = film.camera;
    (0..BEFORE).for_each(|k| film.frame(way(start, moves, k)));
    let end = way(start, moves, BEFORE + 3);
    let was = converged(gpu, &scene, end);
    let pose = event(&scene);
    let change = scene.apply(&pose).unwrap();
    film.record(|renderer, rec| renderer.update(rec, &scene, &change));
    (BEFORE..BEFORE + 4).for_each(|k| film.frame(way(start, moves, k)));
    let (is, seen) = (converged(gpu, &scene, end), energy(&film.stats()));
    assert!((is - was).abs() > 0.05 * was, "control: {name} changes {was} to {is}");
    (seen - is) / (was - is)
}

#[test]
fn light_that_has_changed_leaves_no_ghost() {
    let gpu = gpu();
    for event in &EVENTS {
        for moves in [false, true] {
            let left = ghost(&gpu, event, moves, Reproject::default());
            println!("{} {moves}: {left:.4}", event.0);
            assert!(left.abs() < 0.01, "{}, camera moves: {moves}: {left} is left", event.0);
        }
        let all = Reproject { reproject_error: 1e9, ..Reproject::default() };
        let left = ghost(&gpu, event, false, all);
        assert!(left > 0.3, "control: of {} {left} is left where all is kept", event.0);
    }
    assert_silent(&gpu);
}

/// What changes nothing that is seen costs no samples.
#[test]
fn what_brings_no_change_drops_nothing() {
    let gpu = gpu();
    let mut scene = room();
    let mut film = Film::new(&gpu, &scene, Reproject::default());
    film.frame(film.camera);
    for x in [0.3, 0.31] {
        // The board where it is; then another camera at once; then the ball of light behind the wall, where nothing sees it.
        let pose = moved(&scene, "board", x, 4.5, 0.5);
        let pose = if x == 0.3 { pose } else { moved(&scene, "board", 0.3, 4.5, 0.5) };
        let change = scene.apply(&pose).unwrap();
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        film.begin(film.camera);
        let found = film.renderer.carriage().unwrap();
        assert!(found.light == 0 && found.hidden < 40 && found.carried > 1100, "{found:?}");
        film.renderer.steps().skip(1).for_each(|step| film.step(&step));
    }
    assert_silent(&gpu);
}
