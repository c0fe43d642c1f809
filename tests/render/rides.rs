//! Tests that carried samples move with the surfaces that they are of: instances, meshes that are deformed or whose hierarchy is
//! built anew, and what appears, vanishes, shrinks, flips and hides itself.
use crate::moving::{Film, WAYS, by, shifted, truth, turned};
use crate::poses::{MOMENTS, Moment, at, pose};
use crate::support::{assert_silent, gpu};
use crate::twin::Workplace;
use tallow::gpu::Gpu;
use tallow::layout::PixelStats;
use tallow::render::{Reproject, Reprojection, Step, carried_samples};
use tallow::scene::description::Transform;
use tallow::scene::{Loaded, Pose, Vertices};

/// Samples of the converged picture in its pose.
fn direct(gpu: &Gpu, scene: &Loaded, camera: tallow::layout::Camera) -> Vec<PixelStats> {
    let long = scene.clone().with(|s| s.spp = 512);
    let mut film = Film::new(gpu, &long, Reproject::default());
    film.renderer.set_seed(7);
    film.frame(camera);
    film.stats()
}

/// A card with two shades before a dark wall, under an even sky.
fn card() -> Loaded {
    let mut scene = Workplace::new().picture("shades.png", 8, |x, _| if x < 4 { [220; 3] } else { [60; 3] }).scene(
        "[camera]\nposition = [0.0, 0.0, 6.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 45.0\n[environment]\nradiance = 1.0\n\
         [[material]]\nname = 'dark'\ncolor = 0.05\n[[material]]\nname = 'card'\ncolor_texture = 'shades.png'\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'dark'\ntransform = { scale = 30.0, translate = [0.0, 0.0, -9.0] }\n\
         [[mesh]]\nname = 'card'\nshape = 'rectangle'\nmaterial = 'card'\n[[instance]]\nname = 'card'\nmesh = 'card'\n",
    );
    let s = &mut scene.settings;
    (s.width, s.height, s.spp, s.max_depth) = (49, 33, 8, 3);
    scene
}

/// The card at a frame: shifted to the side, turned about the line of sight, and nearer.
fn card_at(scene: &Loaded, frame: u32) -> Pose {
    let (t, place) = (f64::from(frame), scene.rig.placement("card").unwrap());
    let (sin, cos) = (0.03 * t).sin_cos();
    let x = 0.11 * t - 0.5;
    let to =
        Transform::try_from([cos, -sin, 0., x, sin, cos, 0., 0.05 * t, 0., 0., 1., 0.1 * t, 0., 0., 0., 1.]).unwrap();
    Pose { instances: vec![(place, to)], ..Pose::default() }
}

/// Frames of the card by a way. Returns the words of its pixels at the end, and what is there.
fn ride(gpu: &Gpu, way: Reprojection) -> (Vec<u32>, Vec<PixelStats>) {
    let mut scene = card();
    let mut film = Film::moving(gpu, &scene, by(way));
    let start = film.camera;
    for k in 0..9 {
        let pose = card_at(&scene, k);
        let change = scene.apply(&pose).unwrap();
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        film.frame(turned(start, 0.2 * k as f32));
    }
    let guide = film.renderer.film().tiles[0].guide.read().unwrap();
    let (stats, words) = (film.stats(), film.carried());
    let on_card: Vec<usize> = (0..guide.len()).filter(|&i| guide[i].object == 1).collect();
    let carried = on_card.iter().filter(|&&i| carried_samples(words[i]) >= 8).count();
    // Two pixels from the border, and from where the shades meet, nearly none are worth it beside eight samples of an even sky.
    assert!(carried * 5 > on_card.len() && on_card.len() > 200, "{carried} of the card's {} pixels", on_card.len());
    let direct = direct(gpu, &scene, turned(start, 1.6));
    let [wrong, off] = truth(&stats, &words, &direct);
    // Some pixels beside the card's edge keep a sample or two of a mixture, while all of their own are of the wall.
    assert!(wrong < 0.015 && off.abs() < 0.01, "{way:?}: {wrong} of pixels wrong, off by {off}");
    (words, direct)
}

#[test]
fn samples_ride_on_what_moves() {
    let gpu = gpu();
    let [(words, direct), _] = WAYS.map(|way| ride(&gpu, way));

    // The naive arm: what lies on the film stays there.
    let mut scene = card();
    let mut naive = Film::new(&gpu, &scene, Reproject::default());
    let start = naive.camera;
    for k in 0..9 {
        let pose = card_at(&scene, k);
        let change = scene.apply(&pose).unwrap();
        naive.record(|renderer, rec| renderer.update(rec, &scene, &change));
        naive.renderer.set_camera(turned(start, 0.2 * k as f32)).unwrap();
        let stats = naive.stats();
        naive.step(&Step::Start);
        naive.renderer.film().tiles[0].stats.write(0, &stats).unwrap();
        naive.renderer.set_first_sample(8 * k);
        naive.renderer.steps().skip(1).for_each(|step| naive.step(&step));
    }
    let [wrong, _] = truth(&naive.stats(), &words, &direct);
    assert!(wrong > 0.05, "control: the naive arm passes: {wrong}");
    assert_silent(&gpu);
}

#[test]
fn a_history_of_the_camera_alone_ends_where_more_moves() {
    let gpu = gpu();
    let mut scene = card();
    let mut film = Film::new(&gpu, &scene, Reproject::default());
    let start = film.camera;
    let carried = |film: &Film| film.renderer.carriage().unwrap().carried;
    for k in 0..6 {
        if k == 3 {
            let pose = card_at(&scene, 4);
            let change = scene.apply(&pose).unwrap();
            film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        }
        film.frame(turned(start, 0.2 * k as f32));
        assert_eq!(carried(&film) > 300, k != 0 && k != 3, "frame {k}: {:?}", film.renderer.carriage());
    }
    assert_silent(&gpu);
}

#[test]
fn moving_scenes_show_what_is_there() {
    let gpu = gpu();
    // A hierarchy that is built anew numbers its triangles anew.
    for (rebuild_above, way) in [f32::INFINITY, 0.0].into_iter().flat_map(|above| WAYS.map(|way| (above, way))) {
        let mut scene = at(&Moment::default()).with(|s| s.spp = 8);
        let mut film = Film::moving(&gpu, &scene, by(way));
        let start = film.camera;
        let moment = |k: u32| Moment { turn: 0.01 * f64::from(k), wave: 0.1 + 0.01 * k as f32, ..Moment::default() };
        for k in 0..7 {
            let pose = Pose { camera: None, lights: Vec::new(), ..pose(&scene, &moment(k), rebuild_above) };
            let pose = Pose { materials: Vec::new(), environment: None, ..pose };
            let change = scene.apply(&pose).unwrap();
            assert!(
                change.deformed.iter().all(|d| d.rebuilt == (rebuild_above == 0.0)),
                "control: {:?}",
                change.deformed
            );
            film.record(|renderer, rec| renderer.update(rec, &scene, &change));
            film.frame(shifted(start, [0.02 * k as f32, 0.0, 0.0]));
        }
        let found = film.renderer.carriage().unwrap();
        let direct = direct(&gpu, &scene, shifted(start, [0.12, 0.0, 0.0]));
        let [wrong, off] = truth(&film.stats(), &film.carried(), &direct);
        assert!(found.carried > 100, "{found:?}");
        // Light that changes slowly is found late: see `reproject_light`.
        assert!(wrong < 0.015 && off.abs() < 0.035, "{way:?}: {wrong} of pixels wrong, off by {off}: {found:?}");
    }
    assert_silent(&gpu);
}

/// The tables that say so are of one change: a frame without another has numbers that stay.
#[test]
fn surfaces_are_numbered_anew_once() {
    let gpu = gpu();
    for way in WAYS {
        let mut scene = at(&Moment::default()).with(|s| s.spp = 4);
        let mut film = Film::moving(&gpu, &scene, by(way));
        let camera = film.camera;
        film.frame(camera);
        let waved = pose(&scene, &Moment { wave: 0.12, ..Moment::default() }, 0.0);
        let change = scene.apply(&waved).unwrap();
        assert!(!change.triangle_now.is_empty(), "control");
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        film.frame(camera);
        let surfaces = |film: &Film| film.points().iter().map(|p| (p.triangle, p.instance)).collect::<Vec<_>>();
        let after = surfaces(&film);
        for frame in 0..2 {
            film.frame(camera);
            let others = surfaces(&film).iter().zip(&after).filter(|(now, then)| now != then).count();
            assert_eq!(others, 0, "{way:?}: pixels that show another surface in frame {frame}");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn what_appears_vanishes_and_flips_is_seen_as_it_is() {
    let gpu = gpu();
    WAYS.into_iter().for_each(|way| appears_vanishes_and_flips(&gpu, way));
    assert_silent(&gpu);
}

fn appears_vanishes_and_flips(gpu: &Gpu, way: Reprojection) {
    let mut scene = at(&Moment::default());
    let mut film = Film::moving(gpu, &scene, by(way));
    let start = film.camera;
    let scales = [1.0, 0.0, 1.0, -1.0, 1e-9, -1e-9, 0.5, f64::from(f32::MIN_POSITIVE), 1.0]
        .map(|scale| Moment { scale, ..Moment::default() });
    for moment in scales.iter().chain(&MOMENTS).chain(&scales) {
        let pose = pose(&scene, moment, 1.4);
        let change = scene.apply(&pose).unwrap();
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        film.frame(start);
        let finite = |s: &PixelStats| s.count > 0 && s.mean.iter().chain(&s.m2).all(|v| v.is_finite());
        assert!(film.stats().iter().all(finite), "{way:?} {moment:?}");
    }
    // What has shrunk to nothing is gone, and its samples with it.
    for scale in [1.0, 0.0] {
        let pose = pose(&scene, &Moment { scale, ..Moment::default() }, 1.4);
        let change = scene.apply(&pose).unwrap();
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        (0..2).for_each(|_| film.frame(start));
    }
    let direct = direct(gpu, &scene, start);
    let [wrong, off] = truth(&film.stats(), &vec![1; direct.len()], &direct);
    assert!(wrong < 0.015 && off.abs() < 0.02, "{wrong} of pixels wrong, off by {off}");

    // Of two updates between frames the second carries nothing.
    for scale in [0.5, 1.0] {
        let pose = pose(&scene, &Moment { scale, ..Moment::default() }, 1.4);
        let change = scene.apply(&pose).unwrap();
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
    }
    film.begin(start);
    assert_eq!(film.renderer.carriage().unwrap().carried, 0);
}

/// A sheet of two flaps, one bright and one dark, of one mesh: one slides before the other, and away.
#[test]
fn a_sheet_that_passes_itself_shows_the_nearer_flap() {
    let gpu = gpu();
    let flaps = |x: f32| {
        let flap =
            |x: f32, z: f32| [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]: [f32; 2]| [x + a, b, z]);
        [flap(0.3, 0.0), flap(x, 0.4)].concat()
    };
    let colors = [[[0.9, 0.9, 0.9, 1.0]; 4], [[0.1, 0.1, 0.1, 1.0]; 4]].concat();
    let indices = vec![0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7];
    let mesh = tallow::scene::description::Mesh { positions: flaps(-2.5), colors, indices, ..Default::default() };
    let mut description = card_description();
    description.mesh.push(tallow::scene::description::MeshTable {
        name: Some("sheet".into()),
        data: Some(mesh),
        moving: true,
        ..Default::default()
    });
    let built = tallow::scene::Scene::build(&description)
        .unwrap()
        .with(|s| (s.width, s.height, s.spp, s.max_depth) = (49, 33, 32, 2));
    for way in WAYS {
        let mut scene = built.clone();
        let mut film = Film::moving(&gpu, &scene, by(way));
        let (start, mut seen) = (film.camera, 0);
        for k in 0..12 {
            let vertices = Vertices { positions: flaps(-2.5 + 0.45 * k as f32), ..Vertices::default() };
            let mesh = scene.rig.mesh("sheet").unwrap();
            let change = scene.apply(&Pose { meshes: vec![(mesh, vertices)], ..Pose::default() }).unwrap();
            film.record(|renderer, rec| renderer.update(rec, &scene, &change));
            film.frame(start);
            // Of the bright flap's middle and of the dark one's.
            let guide = film.renderer.film().tiles[0].guide.read().unwrap();
            let (stats, words) = (film.stats(), film.carried());
            let inside = |i: &usize| {
                let whole =
                    [i - 1, i + 1, i - 49, i + 49].iter().all(|&q| guide[q].position[2] == guide[*i].position[2]);
                whole && carried_samples(words[*i]) > 0 && guide[*i].object == 0
            };
            let pixels: Vec<usize> = (50..49 * 32 - 50).filter(inside).collect();
            // The bright flap has .33 at least, where the other shades it, and the dark one .06.
            let wrong = |i: &&usize| match guide[**i].position[2] < 0.2 {
                true => stats[**i].mean[1] < 0.25,
                false => stats[**i].mean[1] > 0.1,
            };
            let wrong = pixels.iter().filter(wrong).count();
            seen += pixels.len();
            assert!(wrong == 0, "{way:?} frame {k}: {wrong} of {}", pixels.len());
        }
        assert!(seen > 1000, "control: {way:?} {seen} pixels carry samples");
    }
    assert_silent(&gpu);
}

fn card_description() -> tallow::scene::description::Description {
    use tallow::scene::description::{Camera, Description, EnvironmentTable, Rgb};
    let camera = Camera { position: Some([0.0, 0.0, 6.0]), target: Some([0.0; 3]), ..Camera::default() };
    let environment = Some(EnvironmentTable { radiance: Some(Rgb([1.0; 3])), ..Default::default() });
    Description { camera, environment, ..Description::default() }
}
