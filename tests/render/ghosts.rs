//! Tests that carried samples forget light that has changed: lamps that go out or move away, and what stood before them, on
//! the screen or off it, before a camera at rest and one that moves. Frames that keep all samples are the control.
use crate::moving::{Film, WAYS, by, shifted, turned};
use crate::support::{self, assert_silent, gpu};
use crate::twin::Workplace;
use tallow::gpu::{FrameResources, Gpu};
use tallow::layout::{Camera, PixelStats};
use tallow::render::{Outputs, Renderer, Reproject, carried_samples};
use tallow::scene::description::{LightTable, Rgb, Transform};
use tallow::scene::{EnvironmentChange, Loaded, MaterialChange, Pose, Scene};

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
    (s.width, s.height, s.spp, s.max_depth) = (49, 33, 16, 4);
    scene
}

fn moved(scene: &Scene, name: &str, x: f64, y: f64, z: f64) -> Pose {
    let place = scene.rig.placement(name).unwrap();
    let at = Transform::try_from([1., 0., 0., x, 0., 1., 0., y, 0., 0., 1., z, 0., 0., 0., 1.]).unwrap();
    let was = match name {
        "board" => Transform::try_from([1.2, 0., 0., 0., 0., 0.1, 0., 0., 0., 0., 1.2, 0., 0., 0., 0., 1.]).unwrap(),
        "panel" => Transform::try_from([0.5, 0., 0., 0., 0., 0., -0.5, 0., 0., 0.5, 0., 0., 0., 0., 0., 1.]).unwrap(),
        _ => Transform::try_from([0.25, 0., 0., 0., 0., 0.25, 0., 0., 0., 0., 0.25, 0., 0., 0., 0., 1.]).unwrap(),
    };
    Pose { instances: vec![(place, Transform::from(at.0 * was.0))], ..Pose::default() }
}

fn shining(scene: &Scene, name: &str, emission: f32) -> Pose {
    let material = scene.names.materials.iter().position(|n| n == name).unwrap();
    let emission = Some([emission; 3]);
    Pose { materials: vec![(material, MaterialChange { emission, ..MaterialChange::default() })], ..Pose::default() }
}

fn bulb(_: &Scene, intensity: f32) -> Pose {
    let (position, intensity) = (Some([-3.0, 3.0, 2.5]), Some(Rgb([intensity; 3])));
    Pose { lights: vec![(0, LightTable { position, intensity, ..LightTable::default() })], ..Pose::default() }
}

/// The scene before an event and after it.
type Event = (&'static str, [fn(&Scene) -> Pose; 2]);

const EVENTS: [Event; 6] = [
    ("a lamp out of view goes out", [|s| shining(s, "lamp", 30.0), |s| shining(s, "lamp", 0.0)]),
    ("a lamp in view goes out", [|s| shining(s, "glow", 4.0), |s| shining(s, "glow", 0.0)]),
    ("a bulb goes out", [|s| bulb(s, 9.0), |s| bulb(s, 0.0)]),
    ("a board out of view leaves", [|s| moved(s, "board", 0.3, 4.5, 0.5), |s| moved(s, "board", 40.0, 4.5, 0.5)]),
    ("a lamp out of view moves away", [|s| moved(s, "panel", 1.0, 6.0, 1.0), |s| moved(s, "panel", 40.0, 9.0, 1.0)]),
    ("a lamp in view leaves", [|s| moved(s, "sign", 1.2, 0.6, 0.3), |s| moved(s, "sign", 0.0, 0.6, 40.0)]),
];

/// The camera of a frame: at rest, or turning and walking.
fn way(camera: Camera, moves: bool, frame: u32) -> Camera {
    let t = if moves { frame as f32 } else { 0.0 };
    shifted(turned(camera, 0.4 * t - 1.6), [0.03 * t, 0.01 * t, 0.04 * t])
}

/// Frames before an event, and from it on.
const FRAMES: [u32; 2] = [3, 4];

/// The room, its frames, and a renderer of what it looks like.
struct Stage {
    gpu: Gpu,
    scene: Loaded,
    film: Film,
    still: Renderer,
}

impl Stage {
    fn new(gpu: &Gpu, scene: Loaded, settings: Reproject) -> Self {
        let long = scene.clone().with(|s| (s.spp, s.seed) = (64, 99));
        let still = Renderer::new(gpu, &long, &long.settings, Outputs::default()).unwrap();
        Self { gpu: gpu.clone(), film: Film::moving(gpu, &scene, settings), still, scene }
    }

    fn pose(&mut self, pose: fn(&Scene) -> Pose) {
        let pose = pose(&self.scene);
        let change = self.scene.apply(&pose).unwrap();
        self.film.record(|renderer, rec| renderer.update(rec, &self.scene, &change));
        let mut frame = FrameResources::new(&self.gpu).unwrap();
        self.gpu.run(&mut frame, |rec| self.still.update(rec, &self.scene, &change)).unwrap();
    }

    /// The light of each pixel, green: of the same paths in every call, so that no noise is in what changes.
    fn light(&mut self, camera: Camera) -> Vec<f64> {
        self.still.set_camera(camera).unwrap();
        support::render(&self.gpu, &self.still).iter().map(|s| f64::from(s.mean[1])).collect()
    }

    /// Share of each pixel's samples that were taken before the event: there are more than all frames since have given it.
    fn before_event(&self) -> Vec<f64> {
        let since = self.scene.settings.spp * FRAMES[1];
        let share = |s: PixelStats| f64::from(s.count.saturating_sub(since)) / f64::from(s.count);
        self.film.stats().into_iter().map(share).collect()
    }

    /// The light that an event takes away or brings where the last frame looks, pixel by pixel.
    fn change(&mut self, (name, [before, after]): &Event, moves: bool) -> Vec<f64> {
        let end = way(self.film.camera, moves, FRAMES[0] + FRAMES[1] - 1);
        self.pose(*before);
        let was = self.light(end);
        self.pose(*after);
        let is = self.light(end);
        self.pose(*before);
        let change: Vec<f64> = was.iter().zip(is).map(|(was, is)| was - is).collect();
        let [whole, all] = [change.iter().sum::<f64>(), was.iter().sum()];
        assert!(whole.abs() > 0.05 * all, "control: {name} changes {all} by {whole}");
        change
    }

    /// What is left of that `change`, four frames after the event, as a share of it.
    fn ghost(&mut self, (_, [before, after]): &Event, moves: bool, change: &[f64]) -> f64 {
        let (start, [first, rest]) = (self.film.camera, FRAMES);
        self.pose(*before);
        self.film.restart();
        (0..first).for_each(|k| self.film.frame(way(start, moves, k)));
        self.pose(*after);
        (first..first + rest).for_each(|k| self.film.frame(way(start, moves, k)));
        self.pose(*before);
        let left = self.before_event().iter().zip(change).map(|(share, change)| share * change).sum::<f64>();
        left / change.iter().sum::<f64>()
    }
}

#[test]
fn light_that_has_changed_leaves_no_ghost() {
    let gpu = gpu();
    let mut found = Vec::new();
    let mut stages = WAYS.map(|way| Stage::new(&gpu, room(), by(way)));
    for (event, moves) in EVENTS.iter().flat_map(|event| [(event, false), (event, true)]) {
        let change = stages[0].change(event, moves);
        found.extend(stages.iter_mut().map(|stage| (event.0, moves, stage.ghost(event, moves, &change))));
    }
    assert!(found.iter().all(|(_, _, left)| left.abs() < 0.01), "(event, camera moves, what is left): {found:?}");
    let mut keeps_all = Stage::new(&gpu, room(), Reproject { reproject_light: 1e9, ..Reproject::default() });
    let change = stages[0].change(&EVENTS[0], false);
    let left = keeps_all.ghost(&EVENTS[0], false, &change);
    assert!(left > 0.3, "control: {left} is left where all is kept");
    assert_silent(&gpu);
}

/// A thin post whose shadow, a pixel or two wide, walks over a floor that a sun without noise lights: few probes meet what it takes, and
/// fewer what it gives back. Lamps beside the sun are chosen half of the time.
#[test]
fn a_narrow_shadow_leaves_no_trail() {
    let gpu = gpu();
    let text = "[camera]\nposition = [0.0, 5.0, 5.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 40.0\n\
                [[mesh]]\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 6.0 }\n\
                [[mesh]]\nname = 'board'\nshape = 'cube'\n[[instance]]\nname = 'board'\nmesh = 'board'\n\
                transform = { scale = [0.06, 1.0, 0.06], translate = [-1.0, 1.5, 0.0] }\n\
                [[light]]\ntype = 'directional'\ndirection = [0.0, -1.0, -0.7]\nirradiance = 3.0\n";
    let mut truths = Vec::new();
    let mut shade = |settings: Reproject| {
        let mut scene = Workplace::new().scene(text);
        (scene.settings.width, scene.settings.height, scene.settings.spp, scene.settings.max_depth) = (65, 49, 8, 2);
        let mut stage = Stage::new(&gpu, scene, settings);
        let (camera, mut off) = (stage.film.camera, 0.0);
        for frame in 0..12 {
            let x = -1.0 + 0.12 * frame as f64;
            let place = stage.scene.rig.placement("board").unwrap();
            let at = Transform::try_from([0.06, 0., 0., x, 0., 1., 0., 1.5, 0., 0., 0.06, 0., 0., 0., 0., 1.]).unwrap();
            let change = stage.scene.apply(&Pose { instances: vec![(place, at)], ..Pose::default() }).unwrap();
            stage.film.record(|renderer, rec| renderer.update(rec, &stage.scene, &change));
            let mut resources = FrameResources::new(&gpu).unwrap();
            gpu.run(&mut resources, |rec| stage.still.update(rec, &stage.scene, &change)).unwrap();
            stage.film.frame(camera);
            if truths.len() == frame {
                truths.push(stage.light(camera)); // whatever is carried
            }
            let error = |(s, t): (PixelStats, &f64)| (f64::from(s.mean[1]) - t).powi(2);
            let stats = stage.film.stats().into_iter();
            off += if frame < 3 { 0.0 } else { stats.zip(&truths[frame]).map(error).sum::<f64>() };
        }
        off
    };
    let none = shade(Reproject { reproject_samples: 1, reproject_light: 0.0, ..Reproject::default() });
    for way in WAYS {
        let [found, kept] = [shade(by(way)), shade(Reproject { reproject_light: 1e9, ..by(way) })];
        assert!(found < 1.6 * none, "{way:?}: an error of {found}, {none} of frames alone");
        assert!(kept > 2.0 * found, "control: {kept} where all is kept");
    }
    assert_silent(&gpu);
}

/// A veil that stops half of what is seen through it, before a black ball on a bright sky: nothing lights up or goes dark where paths begin.
fn veil() -> Loaded {
    let mut scene = Workplace::new().scene(
        "[camera]\nposition = [0.0, 0.0, 6.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 40.0\n[environment]\nradiance = 1.0\n\
         [[material]]\nname = 'black'\ncolor = 0.0\n[[material]]\nname = 'veil'\nopacity = 0.5\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'veil'\ntransform = { scale = 6.0, translate = [0.0, 0.0, 3.0] }\n\
         [[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 24\nmaterial = 'black'\ntransform = { scale = 6.0 }\n\
         [[instance]]\nname = 'sign'\nmesh = 'ball'\ntransform = { scale = 0.25, translate = [1.2, 0.6, 0.3] }\n",
    );
    let s = &mut scene.settings;
    (s.width, s.height, s.spp, s.max_depth) = (49, 33, 16, 4);
    scene
}

/// Half of the samples of each pixel are of the veil, at rest and lit as ever, the others of what lies behind it.
#[test]
fn what_has_been_seen_through_a_veil_leaves_no_ghost() {
    let gpu = gpu();
    let mut stages = WAYS.map(|way| Stage::new(&gpu, veil(), by(way)));
    for moves in [false, true] {
        let change = stages[0].change(&EVENTS[5], moves);
        for (stage, way) in stages.iter_mut().zip(WAYS) {
            let left = stage.ghost(&EVENTS[5], moves, &change);
            assert!(left.abs() < 0.01, "{way:?}, the camera moves: {moves}: {left} is left");
        }
    }
    assert_silent(&gpu);
}

/// Nothing is lit where a ball is black, so that pixels at its edge alone show that a sky has gone dark.
#[test]
fn a_sky_that_goes_dark_leaves_no_rim() {
    let gpu = gpu();
    for way in WAYS {
        let mut scene = Workplace::new().scene(
            "[camera]\nposition = [0.0, 0.0, 6.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 40.0\n[environment]\nradiance = 1.0\n\
             [[material]]\nname = 'black'\ncolor = 0.0\n[[mesh]]\nshape = 'sphere'\nsegments = 48\nmaterial = 'black'\n",
        );
        (scene.settings.width, scene.settings.height, scene.settings.spp) = (49, 33, 16);
        let mut film = Film::moving(&gpu, &scene, by(way));
        (0..FRAMES[0]).for_each(|_| film.frame(film.camera));
        let rim = |film: &Film| film.stats().iter().filter(|s| (0.05..0.95).contains(&s.mean[1])).count();
        assert!(rim(&film) > 20, "control: pixels that show both");
        let environment = Some(EnvironmentChange { radiance: Some([0.0; 3]), rotation: None });
        let change = scene.apply(&Pose { environment, ..Pose::default() }).unwrap();
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        film.frame(film.camera);
        assert_eq!(rim(&film), 0, "{way:?}");
    }
    assert_silent(&gpu);
}

/// What changes nothing that is seen costs no samples.
#[test]
fn what_brings_no_change_drops_nothing() {
    let gpu = gpu();
    let mut scene = room();
    let mut film = Film::moving(&gpu, &scene, Reproject::default());
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

/// A chequered wall and a block before it, which fill the view, and a small cube that moves.
fn chequered() -> Loaded {
    let squares = |x: u32, y: u32| if (x + y).is_multiple_of(2) { [230; 3] } else { [20; 3] };
    let mut scene = Workplace::new().picture("squares.png", 64, squares).scene(
        "[camera]\nposition = [0.3, 0.2, 5.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 40.0\n[environment]\nradiance = 1.0\n\
         [[material]]\nname = 'squares'\ncolor_texture = 'squares.png'\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'squares'\ntransform = { scale = 6.0, translate = [0.0, 0.0, -1.0] }\n\
         [[mesh]]\nshape = 'cube'\nmaterial = 'squares'\ntransform = { scale = 0.6, rotate = [0.0, 30.0, 20.0] }\n\
         [[mesh]]\nname = 'cube'\nshape = 'cube'\n\
         [[instance]]\nname = 'sign'\nmesh = 'cube'\ntransform = { scale = 0.25, translate = [-1.6, 0.0, 0.0] }\n",
    );
    (scene.settings.width, scene.settings.height, scene.settings.spp) = (65, 49, 1);
    scene
}

/// Before a camera at rest, pixels whose surfaces rest keep every sample, also where textures and edges make neighbours differ.
#[test]
fn what_rests_keeps_all_its_samples_while_something_moves() {
    let gpu = gpu();
    let frames = 4;
    for way in WAYS {
        let mut scene = chequered();
        let mut film = Film::moving(&gpu, &scene, Reproject { reproject_light: 1e9, ..by(way) });
        film.frame(film.camera);
        for k in 1..=frames {
            let pose = moved(&scene, "sign", -1.6 + 0.02 * f64::from(k), 0.0, 0.0);
            let change = scene.apply(&pose).unwrap();
            film.record(|renderer, rec| renderer.update(rec, &scene, &change));
            film.frame(film.camera);
        }
        let counts: Vec<u32> = film.stats().iter().map(|s| s.count).collect();
        let all = counts.iter().filter(|&&n| n == frames + 1).count();
        println!("{way:?}: {all} of {} pixels keep all", counts.len());
        assert!(all * 20 > counts.len() * 19 && all < counts.len(), "{way:?}: {all} of {}", counts.len());
    }
    assert_silent(&gpu);
}

/// A card that is mirrored about its own plane lies where it was and shows its other side.
#[test]
fn what_turns_over_in_its_place_keeps_nothing() {
    let gpu = gpu();
    for way in WAYS {
        let mut scene = Workplace::new().scene(
            "[camera]\nposition = [0.0, 0.0, 3.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 40.0\n[environment]\nradiance = 1.0\n\
             [[mesh]]\nname = 'card'\nshape = 'rectangle'\n[[instance]]\nname = 'card'\nmesh = 'card'\ntransform = { scale = 4.0 }\n",
        );
        (scene.settings.width, scene.settings.height, scene.settings.spp) = (31, 17, 2);
        let mut film = Film::moving(&gpu, &scene, Reproject { reproject_light: 1e9, ..by(way) });
        film.frame(film.camera);
        let card = scene.rig.placement("card").unwrap();
        let carried = [4.0, -4.0].map(|z| {
            let at = Transform::try_from([4., 0., 0., 0., 0., 4., 0., 0., 0., 0., z, 0., 0., 0., 0., 1.]).unwrap();
            let change = scene.apply(&Pose { instances: vec![(card, at)], ..Pose::default() }).unwrap();
            film.record(|renderer, rec| renderer.update(rec, &scene, &change));
            film.frame(film.camera);
            film.renderer.carriage().unwrap().carried
        });
        assert_eq!(carried, [31 * 17, 0], "{way:?}: as it was, and turned over");
    }
    assert_silent(&gpu);
}

/// Sunlight on a floor, and a bulb in the shade of a slab.
fn shade() -> Loaded {
    let mut scene = Workplace::new().scene(
        "[camera]\nposition = [0.0, 1.6, 5.0]\ntarget = [0.0, 0.9, 0.0]\nfov = 45.0\n[render]\nmax_depth = 3\n\
         [environment]\nradiance = 0.01\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 6.0 }\n\
         [[mesh]]\nshape = 'cube'\ntransform = { scale = [1.2, 0.05, 1.0], translate = [0.0, 2.5, 0.0] }\n\
         [[light]]\ntype = 'directional'\ndirection = [0.0, -1.0, 0.0]\nirradiance = 5.0\n\
         [[light]]\ntype = 'point'\nposition = [0.0, 1.0, 0.0]\nintensity = 0.15\n",
    );
    (scene.settings.width, scene.settings.height, scene.settings.spp) = (64, 48, 4);
    scene
}

/// Samples that pixels in the shade keep when the bulb goes out, over a few seeds.
fn kept_in_the_shade(gpu: &Gpu, settings: Reproject) -> u32 {
    let kept = (1..7).map(|seed| {
        let mut scene = shade();
        scene.settings.seed = seed;
        let mut film = Film::moving(gpu, &scene, settings);
        (0..3).for_each(|_| film.frame(film.camera));
        let light: Vec<_> = film.stats().iter().map(|s| s.mean[1]).collect();
        let (position, intensity) = (Some([0.0, 1.0, 0.0]), Some(Rgb([0.0; 3])));
        let out = (1, LightTable { position, intensity, ..LightTable::default() });
        let change = scene.apply(&Pose { lights: vec![out], ..Pose::default() }).unwrap();
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        film.begin(film.camera);
        let words = film.carried().into_iter().zip(light);
        words.filter(|(_, light)| (0.015..0.1).contains(light)).map(|(word, _)| carried_samples(word)).sum::<u32>()
    });
    kept.sum()
}

/// A change counts against the light where it is seen, not against that of brighter parts nearby.
#[test]
fn a_bulb_that_goes_out_in_the_shade_leaves_little_beside_sunlight() {
    let gpu = gpu();
    for way in WAYS {
        let settings = by(way);
        let all = kept_in_the_shade(&gpu, Reproject { reproject_light: 1e9, ..settings });
        let kept = kept_in_the_shade(&gpu, settings);
        assert!(all > 3000 && 10 * kept < all, "{way:?}: {kept} of {all} samples are kept");
    }
    assert_silent(&gpu);
}
