//! Compares the kernels of reprojection with their CPU twin. Rounding moves a few points to another pixel: nearly all pixels must
//! begin with the same samples, bit for bit.
use crate::moving::{Film, WAYS, by, shifted, turned};
use crate::poses::{MOMENTS, Moment, at, pose};
use crate::support::{assert_silent, gpu};
use crate::twin::Workplace;
use glam::Vec3;
use std::path::Path;
use tallow::gpu::Gpu;
use tallow::layout::{
    Camera, Effects, FrameConstants, Guide, LightChange, PathConstants, PixelLight, PixelStats, ReprojectPush,
    SurfacePoint,
};
use tallow::math::hash::pcg;
use tallow::render::pass::light_change::SPACINGS;
use tallow::render::{Carriage, Carried, Reproject, carried_samples, frame_constants};
use tallow::scene::{Loaded, Pose, Relit, Scene};
use tallow::shaders::shared::sample_marks::{ALL_PASSED_OVER, SOME_BARE};
use tallow::twins::camera::{camera_ray, film_from_pixel, film_from_point};
use tallow::twins::light_change;
use tallow::twins::path::{Strategy, Tracer};
use tallow::twins::primary_hit::{guide, point};
use tallow::twins::reproject::{Handed, Left, Reprojection};

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
        size: settings.size(),
        first_pixel: 0,
        pixels: settings.pixels() as u32,
        view: s.reproject_error,
        noise: s.reproject_light,
        aliasing: s.reproject_aliasing,
        max_samples: s.reproject_samples,
        max_age: s.reproject_age,
        spp: settings.spp,
        ..Default::default()
    }
}

/// What pixels begin with: words, statistics, light.
type Begun = (Vec<u32>, Vec<(PixelStats, PixelLight)>);

/// By the twin.
fn by_twin(r: &Reprojection, how: Reproject, handed: &mut Handed, frame: &FrameConstants) -> Begun {
    let seen: Vec<Guide> = (0..r.push.pixels).map(|i| guide(r.scene, frame, i)).collect();
    let mut points: Vec<_> = (0..r.push.pixels).map(|i| point(r.scene, frame, i)).collect();
    if how.reproject == tallow::render::Reprojection::Backward {
        let gathered = r.gather(handed, &seen, &points);
        return gathered.into_iter().map(|(word, stats, light)| (word, (stats, light))).unzip();
    }
    let mut words = r.project(handed, &seen, &points);
    let begun = r.carry(handed, &mut words, &mut points);
    (words, begun)
}

/// Moves a film to the camera. Returns what pixels begin with, by the kernels and by the twin.
fn both(film: &mut Film, scene: &Loaded, settings: Reproject, camera: Camera) -> [Begun; 2] {
    let tile = &film.renderer.film().tiles[0];
    let (guides, stats) = (tile.guide.read().unwrap(), film.stats());
    let (points, light, carried) = (film.points(), film.light(), film.carried());
    let left = Left { guide: &guides, points: &points, stats: &stats, light: &light, carried: &carried };
    let (changes, instance_now, triangle_now) = (&[][..], &[][..], &[][..]);
    let (before, previous, push) = (scene, film.camera, push(scene, settings));
    let reprojection = Reprojection { before, scene, instance_now, triangle_now, changes, previous, camera, push };
    let mut handed = reprojection.remember(&left);
    let frame = FrameConstants { camera, ..frame_constants(scene, &scene.settings).unwrap() };
    let twin = by_twin(&reprojection, settings, &mut handed, &frame);

    film.begin(camera);
    film.camera = camera;
    let begun: Vec<_> = film.stats().into_iter().zip(film.light()).collect();
    let differ = film.offered().iter().zip(&handed.offered).filter(|(a, b)| a != b).count();
    assert!(differ * 50 <= begun.len(), "{differ} pixels of {} hand on something else", begun.len());
    [(film.carried(), begun), twin]
}

/// A scene and its constants with the lights of before or `after`, as probes choose among them; `scale` is that of densities before.
fn with_lights(
    scene: &Scene,
    frame: FrameConstants,
    choice: Option<&Relit>,
    after: bool,
    scale: f32,
) -> (Scene, FrameConstants) {
    let Some(r) = choice else { return (scene.clone(), frame) };
    let lights = if after { &r.after } else { &r.before };
    let (light_count, triangle_pdf_scale) = (lights.len() as u32, scale * r.pdf_scale);
    let path = PathConstants { light_count, environment: r.environment, triangle_pdf_scale, ..frame.path };
    let lit = Scene { lights: lights.clone(), light_table: r.table.clone(), ..scene.clone() };
    (lit, FrameConstants { path, ..frame })
}

/// How light changes from one pose to the next by the twin of probes.
fn changes_by_twin(
    [before, after]: [(&Scene, FrameConstants); 2],
    choice: Option<&Relit>,
    effects: Effects,
    points: &[SurfacePoint],
    handed: &Handed,
) -> Vec<LightChange> {
    let (previous, PathConstants { size, triangle_pdf_scale, .. }) = (before.1.camera, before.1.path);
    let [old, new] = [(before, false), (after, true)]
        .map(|((scene, frame), after)| with_lights(scene, frame, choice, after, triangle_pdf_scale));
    let [old, new] =
        [&old, &new].map(|(scene, frame)| Tracer { scene, frame: *frame, effects, strategy: Strategy::Both });
    let probes = light_change::before(&old, &previous, points, (&handed.offered, &handed.records));
    let mut changes = light_change::after(&new, &previous, &handed.records, &probes);
    for spacing in SPACINGS {
        changes = light_change::sums(&changes, light_change::probe_cells_of(size), spacing);
    }
    changes
}

/// Brings a scene into another pose and the camera to another place. Returns what pixels begin with, by the kernels and by the twin,
/// and how many cells agree about their light.
fn both_where_all_moves(
    film: &mut Film,
    scene: &mut Loaded,
    settings: Reproject,
    pose: &Pose,
    camera: Camera,
) -> ([Begun; 2], usize) {
    let tile = &film.renderer.film().tiles[0];
    let (guides, stats) = (tile.guide.read().unwrap(), film.stats());
    let (points, light, carried) = (film.points(), film.light(), film.carried());
    let left = Left { guide: &guides, points: &points, stats: &stats, light: &light, carried: &carried };
    let before = scene.scene.clone();
    let seed = pcg(pcg(!film.renderer.settings().seed).wrapping_add(film.renderer.settings().first_sample));
    let frame_of = |scene: &Scene, camera: Camera| {
        let frame = frame_constants(scene, film.renderer.settings()).unwrap();
        FrameConstants { camera, path: PathConstants { seed, ..frame.path } }
    };
    let previous = film.camera;
    let change = scene.apply(pose).unwrap();
    let flags = [&change.instance_now, &change.triangle_now].map(|now| u32::from(!now.is_empty()));
    let sky = change.changes_sky(scene).into();
    let push = ReprojectPush { moved: 1, sky, instances: flags[0], triangles: flags[1], ..push(scene, settings) };
    let (instance_now, triangle_now) = (&change.instance_now[..], &change.triangle_now[..]);
    let leaving =
        Reprojection { before: &before, scene, instance_now, triangle_now, changes: &[], previous, camera, push };
    let mut handed = leaving.remember(&left);
    let relit = Relit::of(&change.lights_before, scene);
    let frame = frame_of(scene, camera);
    let poses = [(&before, frame_of(&before, previous)), (&scene.scene, frame)];
    let changes = changes_by_twin(poses, relit.as_ref(), *film.renderer.effects(), &points, &handed);
    film.record(|renderer, rec| renderer.update(rec, scene, &change));
    film.begin(camera);
    film.camera = camera;
    let begun: Vec<_> = film.stats().into_iter().zip(film.light()).collect();
    let found = film.renderer.history().unwrap().light_change().read().unwrap();
    let alike = |(a, b): &(&LightChange, &LightChange)| {
        // A path that rounding leads elsewhere shifts the changes of all cells around it.
        a.count == b.count && (a.change - b.change).abs() <= 0.003 + 0.01 * b.change
    };
    let cells = found.iter().zip(&changes).filter(alike).count();
    // Rounding of one path may be in the errors of all cells around: from here on those of the kernels count.
    let reprojection = Reprojection { changes: &found, ..leaving };
    let twin = by_twin(&reprojection, settings, &mut handed, &frame);

    ([(film.carried(), begun), twin], cells)
}

#[test]
fn kernels_agree_with_their_twin_where_all_moves() {
    let gpu = gpu();
    // Changed light drops most of what has moved. The second time nothing is dropped for it, and more is compared.
    // Before a camera at rest, pixels of what rests too keep their samples.
    let steps = [[0.01, 0.0, 0.02], [0.0; 3]];
    for (way, step) in WAYS.into_iter().flat_map(|way| steps.map(|step| (way, step))) {
        let (lit, _) = agree_where_all_moves(&gpu, Reproject { reproject_error: 0.1, ..by(way) }, step);
        let (_, carried) = agree_where_all_moves(&gpu, Reproject { reproject_light: 1e9, ..by(way) }, step);
        assert!(
            lit > 1000 && carried > 3000,
            "control: {lit} pixels' light has changed, {carried} are carried, {way:?}, {step:?}"
        );
    }
    assert_silent(&gpu);
}

/// Returns how many pixels lost their samples to changed light, and how many began with some.
fn agree_where_all_moves(gpu: &Gpu, settings: Reproject, step: [f32; 3]) -> (u64, u64) {
    let mut scene = at(&Moment::default()).with(|s| (s.width, s.height) = (65, 33));
    let mut film = Film::moving(gpu, &scene, settings);
    film.frame(film.camera);
    let cells = 17 * 9;
    let (mut lit, mut carried, mut all_alike) = (0, 0, 0);
    for (k, moment) in MOMENTS.iter().enumerate() {
        // Every other time hierarchies are built anew.
        let rebuild_above = if k % 2 == 0 { 0.0 } else { f32::INFINITY };
        let pose = pose(&scene, &Moment { light: 1.0 + 0.02 * k as f32, ..*moment }, rebuild_above);
        let camera = shifted(film.camera, step);
        let (begun, alike) = both_where_all_moves(&mut film, &mut scene, settings, &pose, camera);
        let (n, agree) = (begun[0].0.len(), agreeing(&begun));
        assert!(agree * 100 >= n * 99, "{moment:?}: {agree} of {n}");
        all_alike += alike;
        let found = Carriage::of(&film.offered(), &film.carried());
        (lit, carried) = (lit + found.light, carried + found.carried);
        film.renderer.steps().skip(1).for_each(|step| film.step(&step));
    }
    let all = cells * MOMENTS.len();
    assert!(all_alike * 20 >= all * 19, "{all_alike} of {all} cells");
    (lit, carried)
}

#[test]
fn changes_of_light_are_shares_of_it() {
    // Paths of light 2 of which each loses or gains so much.
    let change = |by: f32| LightChange {
        sum: [by, 0.0, 0.0],
        squares: by * by,
        size: by.abs(),
        light: 2.0,
        count: 1,
        ..Default::default()
    };
    let found = |found: &[LightChange], spacing| light_change::sums(found, [3, 3], spacing)[4].change;
    // One path of nine tells nothing: it may be alone. Of two the square of the sum, 4, loses their own, 2.
    let mut some = vec![change(0.0); 9];
    assert_eq!(found(&some, 1), 0.0);
    some[4] = change(1.0);
    assert_eq!(found(&some, 1), 0.0);
    some[0] = change(1.0);
    assert!((found(&some, 1) - f32::sqrt(2.0) / 18.0).abs() < 1e-6);
    // Nine: 81 - 9.
    assert!((found(&[change(-1.0); 9], 1) - f32::sqrt(72.0) / 18.0).abs() < 1e-6);
    // What a narrow shadow takes and gives back is twice a change. Eight: 64 - 8.
    let moved = [1.0, -1.0, 1.0, -1.0, 0.0, 1.0, -1.0, 1.0, -1.0].map(change);
    assert!((found(&moved, 1) - f32::sqrt(56.0) / 18.0).abs() < 1e-6);
    // In wider windows changes count with their sign, and in the widest one path alone. Cells that are no multiple of the spacing away
    // belong to the sums of others.
    let alone = |at: usize| (0..9).map(|i| change(f32::from(u8::from(i == at)))).collect::<Vec<_>>();
    assert_eq!([found(&alone(4), 3), found(&alone(5), 9), found(&alone(4), 9)], [0.0, 0.0, 0.5]);
    let wide = |corners: [f32; 2]| {
        let mut some = vec![change(0.0); 49];
        (some[24], some[3 * 7]) = (change(corners[0]), change(corners[1])); // three apart
        light_change::sums(&some, [7, 7], 3)[24].change
    };
    let of_all = 2.0 * 9.0; // the light of nine cells
    assert!((wide([1.0, 1.0]) - f32::sqrt(2.0) / of_all).abs() < 1e-6 && wide([1.0, -1.0]) == 0.0);
    // What has changed without noise counts by itself, two cells away, and in wider windows where it was found.
    let sums = |at: usize, spacing| {
        let certain = |i: usize| LightChange {
            change: if i == at { 0.5 } else { 0.0 },
            light: 2.0,
            count: 1,
            ..Default::default()
        };
        let changes = light_change::sums(&(0..49).map(certain).collect::<Vec<_>>(), [7, 7], spacing);
        changes.iter().map(|sum| sum.change).collect::<Vec<_>>()
    };
    let found = sums(24, 1);
    let square = |i: usize| (1..6).contains(&(i % 7)) && (1..6).contains(&(i / 7));
    assert!((0..49).all(|i| found[i] == if square(i) { 0.5 } else { 0.0 }), "{found:?}");
    assert_eq!(sums(24, 3).iter().enumerate().filter(|(_, change)| **change > 0.0).collect::<Vec<_>>(), [(24, &0.5)]);
    assert_eq!([light_change::probe_cell_of(0, [9, 9]), light_change::probe_cell_of(9 * 4 + 8, [9, 9])], [0, 5]);
}

/// Farther apart than there are pixels.
const NO_HOLES: usize = 1000;

/// A near wall beside a far one, whose light differs by so much, in 16 x 9 pixels; every pixel has eight samples, of variance 1 (.01 beside
/// holes), and of those `carried`; one in `holes` has none. What they hand on.
fn handed_beside(other: &str, contrast: f32, carried: Carried, holes: usize) -> Vec<Carried> {
    let mut scene = Workplace::new().scene(&format!(
        "[camera]\nposition = [0.0, 0.0, 6.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 45.0\n[environment]\nradiance = 1.0\n\
         [[material]]\nname = 'lamp'\nemission = 9.0\n[[material]]\nname = 'wall'\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'wall'\ntransform = {{ scale = 20.0, translate = [-20.0, 0.0, 0.0] }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = '{other}'\ntransform = {{ scale = 90.0, translate = [0.0, 0.0, -3.0] }}\n",
    ));
    (scene.settings.width, scene.settings.height) = (16, 9);
    let frame = frame_constants(&scene, &scene.settings).unwrap();
    let (previous, camera) = (frame.camera, shifted(frame.camera, [0.01, 0.0, 0.0]));
    let pixels = 0..16 * 9;
    let guide: Vec<Guide> = pixels.clone().map(|i| guide(&scene, &frame, i)).collect();
    let points: Vec<_> = pixels.map(|i| point(&scene, &frame, i)).collect();
    let wall = guide[0].object;
    let light = |g: &Guide| if g.object == wall { 1.0 } else { 1.0 + contrast };
    let m2 = if holes == NO_HOLES { 7.0 } else { 0.07 };
    let of = |g: &Guide| PixelStats { mean: [light(g); 3], m2: [m2; 3], count: 8, ..Default::default() };
    let mut stats: Vec<_> = guide.iter().map(of).collect();
    stats.iter_mut().skip(holes / 2).step_by(holes).for_each(|s| *s = PixelStats::default());
    let left = Left {
        guide: &guide,
        points: &points,
        stats: &stats,
        light: &[PixelLight::default(); 144],
        carried: &[carried.word(); 144],
    };
    let push = push(&scene, Reproject::default());
    let (before, scene, changes, now) = (&scene, &scene, &[][..], &[][..]);
    let handed = Reprojection { before, scene, instance_now: now, triangle_now: now, changes, previous, camera, push }
        .remember(&left);
    handed.offered.iter().map(|&word| Carried::of(word)).collect()
}

/// How many of their samples those by the edge hand on.
fn kept_beside(other: &str, contrast: f32) -> Vec<u32> {
    let kept = handed_beside(other, contrast, Carried::default(), NO_HOLES);
    assert!(kept.iter().filter(|c| !c.edge && c.count == 8).count() >= 144 - 2 * 9, "those away from it hand on all");
    [7, 8].map(|x| kept[4 * 16 + x].count).to_vec()
}

#[test]
fn edges_hand_on_what_is_worth_it() {
    // 72 samples in a window, of two means: 9 * 21 / 70 is the variance of one. A quarter of three squared differences is .278 of it,
    // and 8 / (1 + 8 * .278) rounds to 2; a hundred times as much leaves none.
    assert_eq!(kept_beside("wall", 0.0), [8, 8]);
    assert_eq!(kept_beside("wall", 1.0), [2, 2]);
    assert_eq!(kept_beside("wall", 10.0), [0, 0]);
    // Beside a lamp none, however alike: some pixels of its rim are far brighter than those around.
    assert_eq!(kept_beside("lamp", 0.0), [0, 0]);
}

/// A pixel that nothing was given is not a black one.
#[test]
fn pixels_without_samples_say_nothing_of_those_around() {
    let handed = handed_beside("wall", 0.0, Carried::default(), 11);
    let holes = (0..144).filter(|i| i % 11 == 5).count();
    assert_eq!(handed.iter().map(|c| c.count).filter(|&n| n == 8).count(), 144 - holes, "{handed:?}");
}

#[test]
fn new_samples_thin_age() {
    // Four samples that have moved six times, and four new ones: the mean over eight.
    let handed = handed_beside("wall", 0.0, Carried { count: 4, age: 6, ..Carried::default() }, NO_HOLES);
    assert!(handed.iter().all(|c| [c.count, c.age] == [8, 3]), "{:?}", handed[0]);
}

/// Pixels that begin with the same words, and the same samples: where those of several pixels are merged, but for rounding.
fn agreeing([a, b]: &[Begun; 2]) -> usize {
    let close = |a: f32, b: f32| a == b || (a - b).abs() <= 1e-3 * (a.abs() + b.abs()) + 1e-5;
    let values = |(s, l): &(PixelStats, PixelLight)| {
        [s.mean, s.m2, l.direct, l.albedo, [l.indirect_m2, s.count as f32, (l.remainder >> 29) as f32]].concat()
    };
    let alike = |i: &usize| {
        let [of_a, of_b] = [values(&a.1[*i]), values(&b.1[*i])];
        a.0[*i] == b.0[*i] && of_a.into_iter().zip(of_b).all(|(a, b)| close(a, b))
    };
    (0..a.0.len()).filter(alike).count()
}

#[test]
fn kernels_agree_with_their_twin() {
    let gpu = gpu();
    WAYS.into_iter().for_each(|way| agree(&gpu, Reproject { reproject_samples: 4, ..by(way) }));
    assert_silent(&gpu);
}

#[test]
fn a_camera_at_rest_knows_what_glass_has_not_shown() {
    let gpu = gpu();
    let scene = scene("cornell-box/glass.toml", [49, 33]).with(|s| s.spp = 1);
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene, by(way));
        film.frame(film.camera);
        let before = film.light();
        let (astray, camera) = (before.iter().filter(|l| l.remainder != 0).count(), film.camera);
        let kept = |begun: &Begun| {
            let same =
                begun.1.iter().zip(&before).filter(|((stats, l), old)| stats.count > 0 && l.remainder == old.remainder);
            same.filter(|(_, old)| old.remainder != 0).count()
        };
        let begun = both(&mut film, &scene, by(way), camera);
        assert!(astray > 5, "control: {astray} pixels");
        assert_eq!(begun.each_ref().map(kept), [astray; 2], "{way:?}");
    }
    assert_silent(&gpu);
}

#[test]
fn pixels_without_samples_agree_with_their_twin() {
    let gpu = gpu();
    let scene = scene("cornell-box/glossy.toml", [49, 33]);
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene, by(way));
        film.frame(film.camera);
        let mut stats = film.stats();
        stats.iter_mut().step_by(7).for_each(|s| *s = PixelStats::default());
        film.renderer.film().tiles[0].stats.write(0, &stats).unwrap();
        // Others know nothing of the key light, which brings the rest something.
        let mut light = film.light();
        light.iter_mut().for_each(|l| l.direct = [0.25; 3]);
        let unlit = |l: &mut PixelLight| (l.direct, l.remainder) = ([0.0; 3], ALL_PASSED_OVER);
        (0..light.len()).filter(|i| i % 49 < 20 || i % 4 == 0).for_each(|i| unlit(&mut light[i]));
        // And some show a lamp, too.
        light.iter_mut().skip(1).step_by(4).for_each(|l| (l.direct, l.remainder) = ([0.5; 3], SOME_BARE));
        film.renderer.film().tiles[0].light.write(0, &light).unwrap();
        let camera = turned(film.camera, 0.4);
        let begun = both(&mut film, &scene, by(way), camera);
        let (n, agree) = (begun[0].0.len(), agreeing(&begun));
        let carried = begun[0].0.iter().filter(|&&word| carried_samples(word) > 0).count();
        assert!(agree * 50 >= n * 49 && carried * 4 > n, "{way:?}: {agree} and {carried} of {n}");
    }
    assert_silent(&gpu);
}

#[test]
fn coats_with_normals_of_their_own_agree_with_their_twin() {
    let gpu = gpu();
    let mut scene = Workplace::new().picture("waves.png", 8, |x, y| [90 + 20 * (x % 4) as u8, 165 - 20 * (y % 4) as u8, 240]).scene(
        "[camera]\nposition = [0.0, 3.0, 6.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 45.0\n[environment]\nradiance = 1.0\n\
         [[material]]\nname = 'coated'\ntype = 'metallic-roughness'\nroughness = 0.9\nclearcoat = 1.0\n\
         clearcoat_roughness = 0.5\nclearcoat_normal_map = 'waves.png'\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'coated'\ntransform = { scale = 9.0 }\n",
    );
    (scene.settings.width, scene.settings.height, scene.settings.spp) = (49, 33, 3);
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene, by(way));
        film.frame(film.camera);
        let camera = shifted(film.camera, [0.1, 0.0, 0.0]);
        let begun = both(&mut film, &scene, by(way), camera);
        let (n, agree) = (begun[0].0.len(), agreeing(&begun));
        let fewer = begun[0].0.iter().filter(|&&word| (1..3).contains(&Carried::of(word).count)).count();
        assert!(agree * 50 >= n * 49 && fewer * 4 > n, "{way:?}: {agree} and {fewer} of {n}");
    }
    assert_silent(&gpu);
}

fn agree(gpu: &Gpu, settings: Reproject) {
    let loose = Reproject { reproject_error: 1e3, reproject_aliasing: 1e9, ..settings };
    let accounted = Reproject { reproject_error: 0.05, ..loose }; // some of the samples
    for (file, settings, least) in [
        ("cornell-box/scene.toml", settings, 0.25),
        ("cornell-box/glossy.toml", settings, 0.1),
        ("cornell-box/glossy.toml", loose, 0.25),
        ("cornell-box/glossy.toml", accounted, 0.2),
        ("cornell-box/glass.toml", settings, 0.15),
        ("grass/scene.toml", loose, 0.004),
    ] {
        // Sizes do not depend on materials.
        let sizes = if file == "cornell-box/scene.toml" { &SIZES[..] } else { &SIZES[5..] };
        for &size in sizes {
            let scene = scene(file, size);
            let mut film = Film::new(gpu, &scene, settings);
            film.frame(film.camera);
            let reach = Vec3::from(scene.bounds[1]).distance(scene.bounds[0].into());
            let step = [0.004 * reach, 0.001 * reach, 0.01 * reach];
            let ways =
                [turned(film.camera, 2.3), shifted(film.camera, step), shifted(film.camera, step.map(|s| 1.2 * s))];
            for (turn, camera) in ways.into_iter().enumerate() {
                let begun = both(&mut film, &scene, settings, camera);
                let (n, agree) = (begun[0].0.len(), agreeing(&begun));
                assert!(agree * 50 >= n * 49, "{file} {size:?} way {turn}: {agree} of {n}, {settings:?}");
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
