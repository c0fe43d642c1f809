//! Tests frames that begin with the samples of the last: what must be carried to the bit, what must not be carried at all, and
//! that what is carried is of the right surface. A naive arm, which keeps all samples where they are on the film, fails every
//! check of truth.
use crate::moving::{Film, WAYS, by, shifted, truth, turned};
use crate::support::{self, assert_silent, gpu};
use crate::twin::Workplace;
use std::path::Path;
use tallow::gpu::Gpu;
use tallow::layout::{Camera, NONE, PixelLight, PixelStats};
use tallow::render::settings::Settings;
use tallow::render::{Carriage, Carried, Moves, Outputs, Renderer, Reproject, Reprojection, Step, carried_samples};
use tallow::scene::{Change, Loaded, Scene};

fn scene(file: &str, change: impl Fn(&mut Settings)) -> Loaded {
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file))
        .map(|scene| scene.with(&change))
        .unwrap()
}

fn small(s: &mut Settings) {
    (s.width, s.height, s.spp, s.max_depth) = (49, 33, 4, 4);
}

fn bits<T: bytemuck::Pod>(values: &[T]) -> Vec<u32> {
    bytemuck::cast_slice(values).to_vec()
}

#[test]
fn a_camera_at_rest_accumulates_to_the_bit() {
    let gpu = gpu();
    let files = ["cornell-box/scene.toml", "cornell-box/glass.toml", "veach-mis/scene.toml"];
    for (file, reproject) in files.into_iter().flat_map(|file| WAYS.map(|way| (file, way))) {
        let whole = scene(file, |s| (small(s), s.spp = 12).0);
        let renderer = Renderer::new(&gpu, &whole, &whole.settings, Outputs::FILTERED).unwrap();
        let expected = support::render(&gpu, &renderer);
        let light = renderer.film().tiles[0].light.read().unwrap();

        let parts = scene(file, small);
        // Limits are those of samples that move.
        let strict = Reproject {
            reproject,
            reproject_samples: 1,
            reproject_age: 0,
            reproject_error: 0.0,
            reproject_light: 0.0,
            reproject_aliasing: 0.0,
        };
        let mut film = Film::new(&gpu, &parts, strict);
        (0..3).for_each(|_| film.frame(film.camera));
        assert!(bits(&film.stats()) == bits(&expected) && bits(&film.light()) == bits(&light), "{file} {reproject:?}");
        assert!(
            film.carried().iter().all(|&word| word == 8),
            "{file} {reproject:?}: all of two frames, and none has moved"
        );

        let mut repeats = Film::new(&gpu, &parts, strict);
        (0..3).for_each(|_| {
            repeats.renderer.set_first_sample(0);
            repeats.frame(repeats.camera);
        });
        assert!(bits(&repeats.stats()) != bits(&expected), "control: the same samples three times");
    }
    assert_silent(&gpu);
}

/// The word of a pixel has room for so many samples; the others leave with their share of the sums.
#[test]
fn a_view_at_rest_has_the_variance_of_the_samples_that_count() {
    let gpu = gpu();
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene("cornell-box/scene.toml", small), by(way));
        let camera = film.camera;
        film.frame(camera);
        let many = |s: PixelStats| PixelStats { count: 100_001, m2: [5e4; 3], ..s };
        let stats: Vec<_> = film.stats().into_iter().map(many).collect();
        let light: Vec<_> = film.light().into_iter().map(|l| PixelLight { indirect_m2: 1e4, ..l }).collect();
        let tile = &film.renderer.film().tiles[0];
        tile.stats.write(0, &stats).unwrap();
        tile.light.write(0, &light).unwrap();
        film.begin(camera);
        for (s, l) in film.stats().iter().zip(&film.light()) {
            assert_eq!(s.count, 65_535);
            let [of_all, of_indirect] = [s.m2[1], l.indirect_m2].map(|m2| m2 / 65_534.0);
            assert!(
                (of_all - 0.5).abs() < 1e-6 && (of_indirect - 0.1).abs() < 1e-6,
                "{way:?}: {of_all}, {of_indirect}"
            );
        }
    }
    assert_silent(&gpu);
}

/// One sample has no deviations from its mean, however well the noise around is known: were a variance handed on with it, the next
/// frame's would add to it, and so on without end.
#[test]
fn a_sample_that_moves_alone_has_no_variance() {
    let gpu = gpu();
    for way in WAYS {
        let one = Reproject { reproject_samples: 1, ..by(way) };
        let mut film = Film::new(&gpu, &scene("cornell-box/scene.toml", small), one);
        film.frame(film.camera);
        let known = film.stats().iter().filter(|s| s.m2[1] > 0.0).count();
        film.begin(turned(film.camera, 0.3));
        let begun = film.stats().into_iter().zip(film.light());
        let alone: Vec<_> = begun.filter(|(s, _)| s.count == 1).collect();
        assert!(alone.len() * 2 > known && known > 500, "{way:?}: control: {} of {known} move", alone.len());
        assert!(alone.iter().all(|(s, l)| s.m2 == [0.0; 3] && l.indirect_m2 == 0.0), "{way:?}");
    }
    assert_silent(&gpu);
}

#[test]
fn the_size_of_batches_changes_no_bit() {
    let gpu = gpu();
    let scene = scene("cornell-box/glossy.toml", small);
    let frames = |way, cut: Option<u32>| {
        let mut film = Film::new(&gpu, &scene, Reproject { reproject_error: 1.0, ..by(way) });
        for k in 0..3_u32 {
            let camera = shifted(turned(film.camera, 1.7 * k as f32), [0.01 * k as f32, 0.0, 0.0]);
            match cut {
                None => film.frame(camera),
                Some(pixels) => {
                    film.begin(camera);
                    for first_pixel in (0..49 * 33).step_by(pixels as usize) {
                        let pixels = pixels.min(49 * 33 - first_pixel);
                        let batch = |first, samples| {
                            Step::Uniform(tallow::render::Batch {
                                first_pixel,
                                pixels,
                                first_sample: 4 * k + first,
                                samples,
                            })
                        };
                        film.step(&batch(0, 1));
                        film.step(&batch(1, 3));
                    }
                }
            }
        }
        (film.stats(), film.carried())
    };
    for way in WAYS {
        let (whole, words) = frames(way, None);
        assert!(words.iter().filter(|&&word| carried_samples(word) > 0).count() > 300, "control: {way:?}");
        for pixels in [64, 77, 1000] {
            let (cut, cut_words) = frames(way, Some(pixels));
            assert!(bits(&cut) == bits(&whole) && cut_words == words, "{way:?}: {pixels} pixels at a time");
        }
    }
    assert_silent(&gpu);
}

/// A floor, a diffuse and a glossy ball, a lamp and a small box behind them, all `scale` times as large.
fn scaled(scale: f64) -> Loaded {
    let v = |x: f64, y: f64, z: f64| format!("[{:e}, {:e}, {:e}]", x * scale, y * scale, z * scale);
    let mut scene = Workplace::new().scene(&format!(
        "[camera]\nposition = {}\ntarget = {}\nfov = 45.0\n[render]\nmax_depth = 3\n\
         [[material]]\nname = 'gloss'\ntype = 'conductor'\nmetal = 'Al'\nalpha = 0.4\n[[material]]\nname = 'lamp'\nemission = 9.0\n\
         [[mesh]]\nshape = 'rectangle'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = {:e} }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
         transform = {{ rotate = [75.0, 0.0, 0.0], scale = {:e}, translate = {} }}\n\
         [[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 64\n\
         [[instance]]\nmesh = 'ball'\nmaterial = 'gloss'\ntransform = {{ scale = {:e}, translate = {} }}\n\
         [[instance]]\nmesh = 'ball'\ntransform = {{ scale = {:e}, translate = {} }}\n\
         [[mesh]]\nshape = 'cube'\ntransform = {{ rotate = [0.0, 30.0, 0.0], scale = {:e}, translate = {} }}\n",
        v(0.0, 1.4, 5.0),
        v(0.0, 0.7, 0.0),
        4.0 * scale,
        0.5 * scale,
        v(0.0, 3.0, 0.5),
        0.7 * scale,
        v(-0.8, 0.7, 0.0),
        0.5 * scale,
        v(0.9, 0.5, 0.5),
        0.3 * scale,
        v(0.2, 0.3, -1.0),
    ));
    small(&mut scene.settings);
    scene
}

/// Of every pixel after two frames: samples carried, how often they moved, the point that they are of; and why others were dropped.
fn kept(gpu: &Gpu, way: Reprojection, scale: f32) -> Vec<[u32; 4]> {
    let scene = scaled(f64::from(scale));
    let mut film = Film::new(gpu, &scene, Reproject { reproject_error: 0.5, ..by(way) });
    film.frame(film.camera);
    film.frame(shifted(turned(film.camera, 1.3), [0.02 * scale, 0.01 * scale, 0.3 * scale]));
    film.begin(shifted(turned(film.camera, 2.1), [0.07 * scale, 0.02 * scale, 0.5 * scale]));
    let found = film.renderer.carriage().unwrap();
    // Going ahead, all new points were on the last film.
    let left = found.outside > 20 || way == Reprojection::Backward;
    assert!(found.carried > 400 && left, "control: {found:?}");
    let pixels = film.carried().into_iter().zip(film.points()).zip(film.offered());
    pixels.map(|((word, p), offered)| [word, p.triangle, p.instance, offered]).collect()
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let gpu = gpu();
    for (way, scale) in WAYS.into_iter().flat_map(|way| [1e-3, 1e3, 1e-6, 1e6].map(|scale| (way, scale))) {
        let [whole, kept] = [1.0, scale].map(|scale| kept(&gpu, way, scale));
        let differ = kept.iter().zip(&whole).filter(|(a, b)| a != b);
        // How many samples of an edge are worth keeping depends on light, whose last bits may round it.
        let edge = |pixel: &[u32; 4]| [pixel[0], pixel[3]].into_iter().any(|word| Carried::of(word).edge);
        let (at_edges, others): (Vec<_>, Vec<_>) = differ.partition(|(a, b)| edge(a) || edge(b));
        assert!(
            others.is_empty() && at_edges.len() < 4,
            "{way:?} {scale:e}: other samples: {others:x?}, at edges {at_edges:x?}"
        );
    }
    assert_silent(&gpu);
}

#[test]
fn nothing_is_carried_where_nothing_is_to_be_seen_again() {
    let gpu = gpu();
    WAYS.into_iter().for_each(|way| nothing_is_carried(&gpu, way));
    assert_silent(&gpu);
}

fn nothing_is_carried(gpu: &Gpu, way: Reprojection) {
    let scene = scene("cornell-box/scene.toml", small);
    let all = 49 * 33;
    let mut film = Film::new(gpu, &scene, by(way));
    let at = film.camera;
    // The first frame of all may begin like any other.
    film.begin(at);
    let found = film.renderer.carriage().unwrap();
    let Carriage { new_edges, outside, .. } = found;
    assert_eq!(found, Carriage { new: all - new_edges, new_edges, outside, ..Carriage::default() });
    assert!(outside == 0 || way == Reprojection::Backward, "{found:?}");
    assert!(film.stats().iter().all(|s| *s == PixelStats::default()));
    film.frame(at);

    // A half turn puts every point behind the camera.
    film.begin(turned(at, 180.0));
    let found = film.renderer.carriage().unwrap();
    let gone = found.outside + found.edge + found.sky == all || way == Reprojection::Backward;
    assert!(gone && found.carried == 0 && found.samples == 0, "{way:?}: {found:?}");
    assert!(film.stats().iter().all(|s| *s == PixelStats::default()));

    // Cuts to where the wall hides all, to axes that almost lie in one plane, to a film that is almost a point.
    let scaled = |axis: [f32; 3], by: f32| axis.map(|v| v * by);
    for cut in [
        shifted(at, [0.0, 0.0, -400.0]),
        Camera { right: [1e-5 * at.right[0], at.up[1], 0.0], ..at },
        Camera { up: scaled(at.up, 1e-30), ..at },
        Camera { right: scaled(at.right, 1e-30), up: scaled(at.up, 1e-30), ..at },
    ] {
        let mut film = Film::new(gpu, &scene, by(way));
        film.frame(at);
        film.frame(cut);
        assert!(film.stats().iter().all(|s| s.mean.iter().chain(&s.m2).all(|v| v.is_finite())), "{cut:?}");
        film.frame(at);
        assert!(film.stats().iter().all(|s| s.mean.iter().chain(&s.m2).all(|v| v.is_finite())), "{cut:?}, and back");
    }
}

/// Samples through a lens show many points, of which none is the pixel's: they are kept where nothing changes, and do not move.
#[test]
fn nothing_is_carried_from_or_to_a_lens() {
    let gpu = gpu();
    for way in WAYS {
        let mut scene = scene("cornell-box/scene.toml", small);
        scene.view.lens_radius = 0.2;
        let mut film = Film::new(&gpu, &scene, by(way));
        let lens = film.camera;
        let point = Camera { lens_radius: 0.0, ..lens };
        let moved = shifted(lens, [0.01, 0.0, 0.0]);
        let carried = [lens, moved, moved, point, lens, point, point].map(|camera| {
            film.frame(camera);
            film.renderer.carriage().unwrap().carried
        });
        let [still, last] = [2, 6].map(|i| carried[i]);
        let none = [0, 1, 3, 4, 5].map(|i| carried[i]);
        assert!(none == [0; 5] && still == 49 * 33 && last > 1000, "{way:?}: {carried:?}");
    }
    assert_silent(&gpu);
}

#[test]
fn limits_hold() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", small);
    let of = |settings: Reproject| {
        let mut film = Film::new(&gpu, &scene, settings);
        let words: Vec<Vec<u32>> = (0..6)
            .map(|k| {
                film.frame(turned(film.camera, 0.9 * k as f32));
                film.carried()
            })
            .collect();
        let most = |of: fn(u32) -> u32| words.iter().flatten().map(|&word| of(word)).max().unwrap();
        [most(carried_samples), most(|word| if carried_samples(word) > 0 { word >> 16 & 0xff } else { 0 })]
    };
    // Samples of five frames, four each, that have moved 1 to 5 times: 3 on average.
    assert_eq!(of(Reproject::default()), [20, 3], "control");
    assert_eq!(of(Reproject { reproject_samples: 7, ..Reproject::default() }), [7, 2]);
    // Where their age would be 3, two thirds of the samples are handed on with that of 2.
    let [most, age] = of(Reproject { reproject_age: 2, ..Reproject::default() });
    assert!((8..=16).contains(&most) && age == 2, "{most} {age}");
    assert_eq!(of(Reproject { reproject_age: 0, ..Reproject::default() }), [0, 0]);
    let mut film = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let error = film.keep_history(Reproject::default(), Moves::Camera).unwrap_err().to_string();
    assert!(error.contains("Outputs::guides"), "{error}");
    let outputs = Outputs { guides: true, ..Outputs::default() };
    let mut film = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
    let error = film
        .keep_history(Reproject { reproject_age: 256, ..Reproject::default() }, Moves::Camera)
        .unwrap_err()
        .to_string();
    assert!(error.contains("reproject-age is 256"), "{error}");
    assert!(film.run(&mut tallow::gpu::FrameResources::new(&gpu).unwrap(), &Step::Reproject).is_err());
    assert_silent(&gpu);
}

/// A history that follows the camera alone has records of no surface where something else has changed: nothing looks for any.
#[test]
fn a_change_that_is_not_followed_begins_anew() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", small);
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene, by(way));
        let camera = film.camera;
        film.frame(camera);
        film.begin(turned(camera, 1.0));
        assert!(film.carried().iter().any(|&word| carried_samples(word) > 0), "control");
        film.frame(camera);
        let change = Change { lights: true, ..Change::default() };
        film.record(|renderer, rec| renderer.update(rec, &scene, &change));
        let passes = film.begin(turned(camera, 1.0));
        let names: Vec<_> = passes.iter().map(|pass| pass.name).collect();
        assert!(!names.contains(&"gather") && !names.contains(&"carry"), "{names:?}");
        assert!(film.carried().iter().all(|&word| carried_samples(word) == 0));
    }
    assert_silent(&gpu);
}

/// At the limit of age a film does not begin anew.
#[test]
fn old_samples_are_forgotten_by_degrees() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", small);
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene, Reproject { reproject_age: 3, ..by(way) });
        let samples: Vec<u64> = (0..16)
            .map(|k| {
                film.frame(turned(film.camera, 0.1 * k as f32));
                film.renderer.carriage().unwrap().samples
            })
            .collect();
        println!("{way:?}: {samples:?}");
        // Rounded to whole frames, ages rise and fall a little.
        assert!(samples[1] > 0 && samples.windows(2).all(|pair| 3 * pair[1] > 2 * pair[0]), "{way:?}: {samples:?}");
        assert!(samples[15] < 2 * samples[5], "{way:?}: they are forgotten: {samples:?}");
    }
    assert_silent(&gpu);
}

#[test]
fn budgets_are_exact_and_fresh_pixels_come_first() {
    let gpu = gpu();
    for policy in ["geometry", "variance", "both", "uniform"] {
        let scene = scene("cornell-box/scene.toml", |s| {
            small(s);
            s.allocate.policy = tallow::allocate::policy(policy).unwrap();
            s.allocate.min_spp = 2;
        });
        let mut film = Film::new(&gpu, &scene, Reproject::default());
        for k in 0..4_u32 {
            let begun = film.placed_frame(turned(film.camera, 1.5 * k as f32), k);
            let stats = film.stats();
            let new: Vec<u32> = stats.iter().zip(&begun).map(|(after, before)| after.count - before.count).collect();
            assert_eq!(new.iter().sum::<u32>(), 4 * 49 * 33, "{policy} frame {k}: the budget");
            assert!(stats.iter().all(|s| s.count >= 2), "{policy} frame {k}: the least number");
            assert!(stats.iter().all(|s| s.mean.iter().chain(&s.m2).all(|v| v.is_finite())), "{policy} frame {k}");
            // Of those that see the box at all; the sky beside it is without noise. Geometry alone does not ask for noise, and carried
            // pixels at edges are placed as edges are.
            let words = film.carried();
            let mean = |fresh: bool| {
                let alike = |i: usize| (begun[i].count == 0) == fresh && (fresh || !Carried::of(words[i]).edge);
                let seen = |i: &usize| stats[*i].mean[1] > 0.0 && alike(*i);
                let of: Vec<u32> = (0..new.len()).filter(seen).map(|i| new[i]).collect();
                of.iter().sum::<u32>() as f64 / of.len().max(1) as f64
            };
            if k > 1 && ["variance", "both"].contains(&policy) {
                assert!(
                    mean(true) > mean(false) + 0.5,
                    "{policy} frame {k}: fresh {} carried {}",
                    mean(true),
                    mean(false)
                );
            }
        }
    }
    let scene = scene("cornell-box/scene.toml", |s| {
        small(s);
        s.allocate.policy = tallow::allocate::policy("threshold").unwrap();
    });
    let film = Film::new(&gpu, &scene, Reproject::default());
    let error =
        film.renderer.begin_frame(&mut tallow::gpu::FrameResources::new(&gpu).unwrap()).unwrap_err().to_string();
    assert!(error.contains("noise_threshold"), "{error}");
    assert_silent(&gpu);
}

/// Carried samples count in a pixel's mean, and are no part of the sequence that its new ones come from: those are its first.
/// Shares of all samples would leave a frame's budget to the few pixels that carry less than theirs.
#[test]
fn frames_that_wait_for_nothing_place_their_own_budget_alone() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", |s| {
        small(s);
        s.allocate.policy = tallow::allocate::policy("variance").unwrap();
    });
    let (spp, mut film) = (scene.settings.spp, Film::new(&gpu, &scene, Reproject::default()));
    let mut before = vec![0; (49 * 33) as usize];
    for frame in 0..5 {
        film.frame(film.camera);
        let counts: Vec<u32> = film.stats().iter().map(|s| s.count).collect();
        let new: Vec<u32> = counts.iter().zip(&before).map(|(now, before)| now - before).collect();
        let (sum, most) = (new.iter().sum::<u32>(), new.iter().max().unwrap());
        assert_eq!(sum, spp * 49 * 33, "frame {frame}");
        assert!(*most < 24 * spp, "{most} in one pixel, frame {frame}");
        before = counts;
    }
    assert_silent(&gpu);
}

#[test]
fn new_samples_begin_the_sequence_of_their_frame() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", |s| {
        small(s);
        s.allocate.policy = tallow::allocate::policy("variance").unwrap();
        s.allocate.min_spp = 2;
    });
    let mut film = Film::new(&gpu, &scene, Reproject::default());
    let start = film.camera;
    (0..2).for_each(|k| drop(film.placed_frame(turned(start, 1.5 * k as f32), k)));
    let begun = film.placed_frame(turned(start, 3.0), 9);
    let stats = film.stats();
    let mut compared = 0;
    for spp in [2, 3] {
        let even = tallow::allocate::policy("uniform").unwrap();
        let even = scene.clone().with(|s| (s.spp, s.seed, s.allocate.policy) = (spp, 9, even));
        let mut alone = Renderer::new(&gpu, &even, &even.settings, Outputs::default()).unwrap();
        alone.set_camera(turned(start, 3.0)).unwrap();
        let alone = support::render(&gpu, &alone);
        let gained = |i: &usize| begun[*i].count > 0 && stats[*i].count == begun[*i].count + spp;
        for i in (0..stats.len()).filter(gained) {
            let sum = |s: &PixelStats| f64::from(s.count) * f64::from(s.mean[1]);
            let new = (sum(&stats[i]) - sum(&begun[i])) / f64::from(spp);
            let expected = f64::from(alone[i].mean[1]);
            assert!((new - expected).abs() < 1e-4 * (1.0 + expected), "pixel {i}: {new}, alone {expected}");
            compared += 1;
        }
    }
    assert!(compared > 100, "control: {compared} pixels");
    assert_silent(&gpu);
}

/// A bright panel before a dark wall, and a camera that steps aside: samples of the wall whose points the panel hides, and those of
/// the panel's edges, may not end on the other. No neighbour tells edges here.
#[test]
fn what_is_hidden_stays_behind() {
    let gpu = gpu();
    let mut scene = Workplace::new().scene(
        "[camera]\nposition = [-1.5, 0.0, 6.0]\ntarget = [-1.5, 0.0, 0.0]\nfov = 45.0\n[render]\nmax_depth = 2\n\
         [environment]\nradiance = 1.0\n[[material]]\nname = 'dark'\ncolor = 0.1\n[[material]]\nname = 'bright'\ncolor = 0.9\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'dark'\ntransform = { scale = 30.0, translate = [0.0, 0.0, -3.0] }\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'bright'\ntransform = { scale = 0.9, translate = [0.0, 0.0, 1.0] }\n",
    );
    small(&mut scene.settings);
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene, Reproject { reproject_aliasing: 1e9, ..by(way) });
        film.frame(film.camera);
        film.frame(shifted(film.camera, [3.0, 0.0, 0.0]));
        let found = film.renderer.carriage().unwrap();
        assert!(found.carried > 700 && found.hidden > 50, "control: {way:?} {found:?}");
        let guide = film.renderer.film().tiles[0].guide.read().unwrap();
        let surface = |object: u32| if object == 0 { 0.0..0.75 } else { 0.25..1.0 }; // pixels at edges show both
        let (stats, words) = (film.stats(), film.carried());
        let wrong = |i: &usize| !surface(guide[*i].object).contains(&stats[*i].mean[1]);
        let carried: Vec<usize> = (0..guide.len()).filter(|&i| carried_samples(words[i]) > 0).collect();
        let wrong = carried.iter().filter(|i| wrong(i)).count();
        assert!(wrong * 50 < carried.len(), "{wrong} of {} show the other: {way:?} {found:?}", carried.len());
    }
}

#[test]
fn the_changed_view_is_accounted() {
    let gpu = gpu();
    let scene = scene("cornell-box/glossy.toml", small);
    let reach = glam::Vec3::from(scene.bounds[1]).distance(scene.bounds[0].into());
    let way = |camera: Camera, k: u32| shifted(camera, [0.006 * k as f32 * reach, 0.0, 0.006 * k as f32 * reach]);
    let found = [0.0, 0.1, 1e9].map(|reproject_error| {
        let mut film = Film::new(&gpu, &scene, Reproject { reproject_error, ..Reproject::default() });
        let start = film.camera;
        (0..4).for_each(|k| film.frame(way(start, k)));
        let Carriage { view, samples, .. } = film.renderer.carriage().unwrap();
        (view, samples)
    });
    let [(all, few), (some, more), (none, most)] = found;
    assert!(all > some && none == 0, "pixels that the view leaves no sample: {found:?}");
    assert!(few < more && more < most, "samples: {found:?}");
    assert_silent(&gpu);
}

/// Filters take neighbours' noise for independent: where each pixel becomes four, a quarter of its samples counts in each. Without a filter
/// all count, and so they do where the picture shrinks.
#[test]
fn pixels_of_a_zoom_share_the_samples_that_they_take() {
    let gpu = gpu();
    let scene = scene("cornell-box/scene.toml", |s| (s.width, s.height, s.spp) = (48, 36, 16));
    let most = |mut film: Film, times: f32| {
        film.frame(film.camera);
        let wide = |edge: [f32; 3]| edge.map(|v| v * times);
        let Camera { right, up, .. } = film.camera;
        film.begin(Camera { right: wide(right), up: wide(up), ..film.camera });
        film.carried().into_iter().map(|word| Carried::of(word).count).max().unwrap()
    };
    for way in WAYS {
        let filtered = [0.5, 2.0].map(|times| most(Film::new(&gpu, &scene, by(way)), times));
        let plain = [0.5, 2.0].map(|times| most(Film::unfiltered(&gpu, &scene, by(way)), times));
        assert_eq!((filtered, plain), ([4, 16], [16, 16]), "{way:?}");
    }
    assert_silent(&gpu);
}

/// A floor of rough metal under a lamp, and a camera that moves slowly; all light times `scale`.
fn metal_floor(scale: f64) -> Loaded {
    let mut scene = Workplace::new().scene(&format!(
        "[camera]\nposition = [-1.0, 1.2, 4.5]\ntarget = [-0.2, 0.7, 0.0]\nfov = 45.0\n\
         [environment]\nradiance = {0:?}\n[[material]]\nname = 'metal'\ntype = 'conductor'\nmetal = 'Al'\nalpha = 0.3\n\
         [[material]]\nname = 'lamp'\nemission = {1:?}\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'metal'\n\
         transform = {{ rotate = [-90.0, 0.0, 0.0], scale = 6.0 }}\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\n\
         transform = {{ rotate = [90.0, 0.0, 0.0], scale = 0.7, translate = [0.0, 3.2, 1.0] }}\n",
        0.0625 * scale,
        10.0 * scale
    ));
    small(&mut scene.settings);
    (scene.settings.max_depth, scene.settings.spp) = (2, 1);
    scene
}

const STEP: [f32; 3] = [0.0083, 0.0017, -0.0021];

/// The mean of samples must not depend on which of them are carried: those of bright pixels hold as long as those of dark ones.
#[test]
fn a_slow_view_keeps_the_mean_of_glossy_surfaces() {
    let gpu = gpu();
    let scene = metal_floor(1.0);
    let floor = |film: &Film| {
        let pixels = film.stats().into_iter().zip(film.points()).filter(|(_, at)| at.triangle != NONE);
        let light: Vec<f64> = pixels.map(|(s, _)| f64::from(s.mean[1])).collect();
        light.iter().sum::<f64>() / light.len() as f64
    };
    let long = scene.clone().with(|s| s.spp = 2048);
    let at = |start: Camera, frames: f32| shifted(start, STEP.map(|step| step * frames));
    let mut reference = Film::new(&gpu, &long, Reproject::default());
    reference.frame(at(reference.camera, 7.5));
    for way in WAYS {
        let of_seed = |seed: u32| {
            let mut film = Film::new(&gpu, &scene, by(way));
            film.renderer.set_seed(seed);
            let start = film.camera;
            let light = (0..12).map(|k| (film.frame(at(start, k as f32)), floor(&film)).1);
            light.skip(4).sum::<f64>() / 8.0
        };
        let mean = (1..=16).map(of_seed).sum::<f64>() / 16.0 / floor(&reference);
        assert!((mean - 1.0).abs() < 0.03, "{way:?}: {mean} of the light");
    }
    assert_silent(&gpu);
}

#[test]
fn the_unit_of_light_does_not_matter() {
    let gpu = gpu();
    for way in WAYS {
        let words = [1.0, 1.0 / 8192.0].map(|scale| {
            let mut film = Film::new(&gpu, &metal_floor(scale), by(way));
            let start = film.camera;
            (0..4).for_each(|k| film.frame(shifted(start, STEP.map(|step| step * 9.0 * k as f32))));
            film.carried()
        });
        let carried: u32 = words[0].iter().map(|&word| carried_samples(word)).sum();
        assert!(carried > 500, "control: {way:?}: {carried}");
        assert!(words[0] == words[1], "{way:?}: other samples");
    }
    assert_silent(&gpu);
}

/// A camera that moves past a floor of rough metal, in which a lamp is seen: its highlight is where the view puts it, and leaves nothing
/// behind on the floor.
/// A faint sun beside the sky lets light samples choose the lamp but seldom, so that few bright samples make the highlight.
#[test]
fn highlights_do_not_smear() {
    let gpu = gpu();
    let mut scene = Workplace::new().scene(
        "[camera]\nposition = [-0.8, 1.2, 4.0]\ntarget = [-0.8, 0.2, 0.0]\nfov = 45.0\n[render]\nmax_depth = 2\n\
         [environment]\nradiance = 0.2\n[[light]]\ntype = 'directional'\ndirection = [0.0, -1.0, 0.0]\nirradiance = 0.001\n\
         [[material]]\nname = 'metal'\ntype = 'conductor'\nmetal = 'Al'\nalpha = 0.15\n\
         [[material]]\nname = 'lamp'\nemission = 20.0\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'metal'\n\
         transform = { rotate = [-90.0, 0.0, 0.0], scale = 9.0 }\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\ntransform = { scale = 0.4, translate = [0.0, 1.5, -3.0] }\n",
    );
    small(&mut scene.settings);
    scene.settings.spp = 32;
    let end = |camera: Camera| shifted(camera, [1.2, 0.0, 0.0]);
    let long = scene.clone().with(|s| s.spp = 512);
    let mut direct = Film::new(&gpu, &long, Reproject::default());
    direct.renderer.set_seed(7);
    direct.frame(end(direct.camera));
    let direct = direct.stats();
    for way in WAYS {
        let wrong = [Reproject::default().reproject_error, 1e9].map(|reproject_error| {
            let mut film = Film::new(&gpu, &scene, Reproject { reproject_error, ..by(way) });
            let start = film.camera;
            (0..8).for_each(|k| film.frame(shifted(start, [0.15 * k as f32, 0.0, 0.0])));
            film.frame(end(start));
            truth(&film.stats(), &vec![1; direct.len()], &direct)[0]
        });
        assert!(
            wrong[0] < 0.01 && wrong[1] > 0.02,
            "{way:?}: share of pixels that are wrong, and where every view counts alike: {wrong:?}"
        );
    }
    assert_silent(&gpu);
}

/// A camera that moves past a picture whose stripes are about as wide as pixels, frame by frame with so many samples that one frame
/// alone is good: carried samples of pixels beside must not blur it.
#[test]
fn textures_do_not_smear() {
    let gpu = gpu();
    let picture = |x: u32, y: u32| [if (x / 3 + y / 5).is_multiple_of(2) { 230 } else { 20 }, 120, 60];
    let mut scene = Workplace::new().picture("stripes.png", 64, picture).scene(
        "[camera]\nposition = [0.0, 0.4, 3.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 45.0\n[environment]\nradiance = 1.0\n\
         [[material]]\nname = 'striped'\ncolor_texture = 'stripes.png'\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'striped'\ntransform = { rotate = [-30.0, 20.0, 0.0], scale = 1.5 }\n",
    );
    small(&mut scene.settings);
    scene.settings.spp = 32;
    let start = Film::new(&gpu, &scene, Reproject::default()).camera;
    let at = |frame: u32| turned(shifted(start, [0.013 * frame as f32, 0.0, -0.02 * frame as f32]), 0.3 * frame as f32);
    let alone = |spp: u32, seed: u32| {
        let mut film = Film::new(&gpu, &scene.clone().with(|s| s.spp = spp), Reproject::default());
        film.renderer.set_seed(seed);
        film.frame(at(8));
        film.stats()
    };
    let reference = alone(2048, 7);
    let error = |stats: &[PixelStats]| {
        let square =
            |(a, b): (&PixelStats, &PixelStats)| (0..3).map(|c| f64::from(a.mean[c] - b.mean[c]).powi(2)).sum::<f64>();
        stats.iter().zip(&reference).map(square).sum::<f64>()
    };
    let of_one = error(&alone(32, 3));
    for way in WAYS {
        let mut film = Film::new(&gpu, &scene, by(way));
        (0..9).for_each(|k| film.frame(at(k)));
        let ratio = error(&film.stats()) / of_one;
        assert!(ratio < 1.5, "{way:?}: {ratio} of the error of a frame alone");
    }
    assert_silent(&gpu);
}

#[test]
fn every_way_to_a_view_shows_what_is_there() {
    let gpu = gpu();
    for file in ["cornell-box/scene.toml", "cornell-box/glossy.toml"] {
        let scene = scene(file, |s| (small(s), s.spp = 8).0);
        let long = scene.clone().with(|s| s.spp = 1024);
        let reach = glam::Vec3::from(scene.bounds[1]).distance(scene.bounds[0].into());
        let end = |c: Camera| shifted(turned(c, 6.0), [0.05 * reach, 0.0, 0.05 * reach]);
        let mut direct = Film::new(&gpu, &long, Reproject::default());
        direct.renderer.set_seed(7);
        direct.frame(end(direct.camera));
        let direct = direct.stats();
        // Three ways there: turning first, moving first, and from the other side.
        let way = |way: usize, t: f32, c: Camera| {
            let [turn, shift] = [[2.0 * t, 2.0 * t - 1.0], [2.0 * t - 1.0, 2.0 * t], [2.0 - t, 2.0 - t]][way]
                .map(|t| if way == 2 { t } else { t.clamp(0.0, 1.0) });
            shifted(turned(c, 6.0 * turn), [0.05 * shift * reach, 0.0, 0.05 * shift * reach])
        };
        for (path, reproject) in (0..3).flat_map(|path| WAYS.map(|way| (path, way))) {
            let mut film = Film::new(&gpu, &scene, by(reproject));
            let start = film.camera;
            (0..=8).for_each(|k| film.frame(way(path, k as f32 / 8.0, start)));
            film.frame(end(start)); // the end of all three, but for rounding
            let found = film.renderer.carriage().unwrap();
            assert!(found.carried > 400, "{file} way {path} {reproject:?}: {found:?}");
            let [wrong, off] = truth(&film.stats(), &film.carried(), &direct);
            assert!(
                wrong < 0.01 && off.abs() < 0.01,
                "{file} way {path} {reproject:?}: {wrong} of pixels wrong, off by {off}: {found:?}"
            );
        }
        // The naive arm: what lies on the film stays there.
        let mut naive = Film::new(&gpu, &scene, Reproject::default());
        let start = naive.camera;
        for k in 0..=8 {
            naive.renderer.set_camera(way(0, k as f32 / 8.0, start)).unwrap();
            let steps: Vec<Step> = naive.renderer.steps().collect();
            if k == 0 {
                naive.step(&Step::Start);
            } else {
                // The camera that rays start from is written by a start alone: its statistics are put back.
                let stats = naive.stats();
                naive.step(&Step::Start);
                naive.renderer.film().tiles[0].stats.write(0, &stats).unwrap();
            }
            naive.renderer.set_first_sample(8 * k + 8);
            steps[1..].iter().for_each(|step| naive.step(step));
        }
        let words = vec![64; 49 * 33];
        let [wrong, _] = truth(&naive.stats(), &words, &direct);
        assert!(wrong > 0.05, "control: the naive arm passes: {wrong}");
    }
    assert_silent(&gpu);
}
