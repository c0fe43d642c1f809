//! Tests renders that place their samples: they have the same bits however they are cut, interrupted or dealt to rounds, the right
//! mean, and defined values in pixels without a sample.
use crate::support::{assert_silent, gpu, largest};
use std::ops::ControlFlow;
use std::path::Path;
use tallow::denoise::filter::{FILTERS, FilterSettings, firefly::Fireflies};
use tallow::denoise::{Demodulation, Denoiser};
use tallow::error::Error;
use tallow::gpu::{FrameResources, Gpu};
use tallow::image::{self, Samples, WriteOptions};
use tallow::render::schedule::{self, Cut};
use tallow::render::settings::Settings;
use tallow::render::{Checkpoint, Job, Outputs, Renderer, Status, Step, frame_constants};
use tallow::scene::{Loaded, Scene};
use tallow::statistics::{Pixel, join};

const POLICIES: [&str; 3] = ["geometry", "variance", "both"];
const SIZE: [u32; 2] = [33, 17];

fn scene(change: impl Fn(&mut Settings)) -> Loaded {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml");
    let small = |s: &mut Settings| {
        [s.width, s.height] = SIZE;
        (s.spp, s.max_depth) = (8, 3);
        change(s);
    };
    Scene::load(&file).map(|scene| scene.with(small)).unwrap()
}

fn split() -> Outputs {
    Outputs { split_light: true, guides: false, counters: false }
}

fn bits(pixels: &[Pixel]) -> Vec<u32> {
    let words =
        |p: &Pixel| bytemuck::cast_slice(&[p.stats]).iter().chain(bytemuck::cast_slice(&[p.light])).copied().collect();
    pixels.iter().flat_map(|p: &Pixel| -> Vec<u32> { words(p) }).collect()
}

fn read(renderer: &Renderer) -> Vec<Pixel> {
    let tile = &renderer.film().tiles[0];
    let (stats, light) = (tile.stats.read().unwrap(), tile.light.read().unwrap());
    stats.into_iter().zip(light).map(|(stats, light)| Pixel { stats, light }).collect()
}

/// Runs a whole render by steps of at most so many paths.
fn run_by(renderer: &Renderer, frame: &mut FrameResources, paths_at_once: u32) -> Vec<Pixel> {
    Job { paths_at_once, ..Job::new(renderer) }.run_to_end(frame).unwrap();
    read(renderer)
}

fn run(renderer: &Renderer, frame: &mut FrameResources) -> Vec<Pixel> {
    run_by(renderer, frame, u32::MAX)
}

/// Steps that are not in the order of a render.
fn run_steps(renderer: &Renderer, frame: &mut FrameResources, steps: &[Step]) -> Vec<Pixel> {
    steps.iter().for_each(|step| drop(renderer.run(frame, step).unwrap()));
    read(renderer)
}

fn render(gpu: &Gpu, scene: &Loaded) -> Vec<Pixel> {
    let renderer = Renderer::new(gpu, scene, &scene.settings, split()).unwrap();
    run(&renderer, &mut FrameResources::new(gpu).unwrap())
}

fn total(pixels: &[Pixel]) -> u64 {
    pixels.iter().map(|p| u64::from(p.stats.count)).sum()
}

/// A software device ends a thread's loops after 65,535 rounds, silently, and one pixel may have more samples in a batch.
#[test]
fn a_pixel_may_have_any_number_of_samples() {
    let gpu = gpu();
    for policy in ["uniform", "variance"] {
        let scene = scene(|s| {
            ([s.width, s.height], s.spp, s.max_depth) = ([2, 1], 70_000, 2);
            s.allocate.policy = tallow::allocate::policy(policy).unwrap();
        });
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap();
        let mut frame = FrameResources::new(&gpu).unwrap();
        let whole = run(&renderer, &mut frame);
        assert_eq!(total(&whole), 140_000, "{policy}");
        assert!(whole.iter().any(|p| p.stats.count >= 70_000), "{policy}: {whole:?}");
        assert!(bits(&run_by(&renderer, &mut frame, 9_001)) == bits(&whole), "{policy}");
    }
    assert_silent(&gpu);
}

#[test]
fn the_budget_is_met_and_no_cut_changes_a_bit() {
    let gpu = gpu();
    for policy in POLICIES {
        let scene = scene(|s| s.allocate.policy = tallow::allocate::policy(policy).unwrap());
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap();
        let mut frame = FrameResources::new(&gpu).unwrap();
        let whole = run(&renderer, &mut frame);
        assert_eq!(total(&whole), 8 * 33 * 17, "{policy}");
        let counts: Vec<u32> = whole.iter().map(|p| p.stats.count).collect();
        assert!(
            counts.iter().min() < counts.iter().max() && *counts.iter().min().unwrap() >= 2,
            "{policy}: {counts:?}"
        );
        let pixels = SIZE[0] * SIZE[1];
        for paths in [31, 64, 65, 500, pixels] {
            let steps = schedule::steps(&scene.settings, &Cut { pixels, tile: 1 << 20, paths });
            assert!(steps.count() > renderer.steps().count());
            assert!(bits(&run_by(&renderer, &mut frame, paths)) == bits(&whole), "{policy}, batches of {paths}");
        }
        // Control: one path fewer shows.
        let mut steps: Vec<Step> = renderer.steps().collect();
        if let Some(Step::Listed(range)) = steps.last_mut() {
            range.paths -= 1;
        }
        assert!(bits(&run_steps(&renderer, &mut frame, &steps)) != bits(&whole), "{policy}");
    }
    assert_silent(&gpu);
}

/// RAS as published: at most one sample a round, the same bits for every batch size, and by chance in the end.
#[test]
fn a_falling_threshold_gives_at_most_one_sample_a_round() {
    let gpu = gpu();
    let with = |spp| {
        scene(move |s| {
            (s.spp, s.allocate.policy, s.allocate.min_spp, s.allocate.max_spp) =
                (spp, &tallow::allocate::threshold::ROW, 2, 16);
        })
    };
    let counts = |pixels: &[Pixel]| pixels.iter().map(|p| p.stats.count).collect::<Vec<_>>();
    let (frozen, scene) = (counts(&render(&gpu, &with(16))), with(80));
    assert!(frozen.iter().all(|n| (2..=16).contains(n)), "{frozen:?}");
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let whole = run(&renderer, &mut frame);
    let later: Vec<u32> = counts(&whole).iter().zip(&frozen).map(|(all, before)| all - before).collect();
    // Each of 64 rounds is a chance of n / 16: binomial, and independent from pixel to pixel. The sum of squared
    // deviations over their variances is chi-square; pixels with all 16 samples get one every time.
    let certain = frozen.iter().zip(&later).filter(|&(&n, _)| n == 16);
    assert!(certain.clone().all(|(_, &n)| n == 64));
    let (mut chi, mut freedom) = (0.0, 0.0);
    for (&n, &got) in frozen.iter().zip(&later).filter(|&(&n, _)| n < 16) {
        let p = f64::from(n) / 16.0;
        chi += (f64::from(got) - 64.0 * p).powi(2) / (64.0 * p * (1.0 - p));
        freedom += 1.0;
    }
    assert!(freedom > 100.0 && certain.count() > 0, "all alike: the test tests nothing");
    assert!((chi - freedom).abs() < 5.0 * f64::sqrt(2.0 * freedom), "chi-square {chi} of {freedom}");
    for paths in [64, 65, SIZE[0] * SIZE[1]] {
        assert!(bits(&run_by(&renderer, &mut frame, paths)) == bits(&whole), "batches of {paths}");
    }
    assert_silent(&gpu);
}

#[test]
fn batches_of_one_path_and_rounds_in_any_number_or_order_change_no_bit() {
    let gpu = gpu();
    let with = |rounds| {
        scene(move |s| {
            (s.width, s.height, s.spp) = (7, 5, 6);
            (s.allocate.policy, s.allocate.rounds) = (&tallow::allocate::geometry::ROW, rounds);
        })
    };
    let whole = render(&gpu, &with(1));
    for rounds in [2, 3, 100] {
        assert!(bits(&render(&gpu, &with(rounds))) == bits(&whole), "{rounds} rounds");
    }
    let scene = with(4);
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    assert!(bits(&run_by(&renderer, &mut frame, 1)) == bits(&whole), "one path");
    // The rounds backwards: a pixel's next sample is its next, whichever round asks for it.
    let mut steps: Vec<Step> = renderer.steps().collect();
    let first = steps.iter().position(|s| matches!(s, Step::Listed(_))).unwrap();
    steps[first..].reverse();
    assert!(bits(&run_steps(&renderer, &mut frame, &steps)) == bits(&whole), "backwards");
    assert_silent(&gpu);
}

/// What a render leaves that is stopped after so many steps.
fn interrupted(job: &Job, frame: &mut FrameResources, scene: &Scene, stop: usize) -> Checkpoint {
    let mut steps = 0;
    let mut stop_there = |_: &Status| {
        steps += 1;
        Ok(if steps > stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    };
    let status = job.run(frame, &mut stop_there).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("interrupted.exr");
    image::write(&file, &job.film(&status).unwrap(), &WriteOptions::default()).unwrap();
    Checkpoint::read(&file, scene, job.renderer.settings()).unwrap()
}

#[test]
fn a_render_resumed_anywhere_has_the_bits_of_one_that_never_stopped() {
    let gpu = gpu();
    for policy in ["uniform", "geometry", "variance", "both", "threshold"] {
        let scene = scene(|s| {
            // Enough that what an allocation lists is dealt to several rounds.
            (s.spp, s.allocate.policy, s.allocate.rounds) = (80, tallow::allocate::policy(policy).unwrap(), 4);
            // The last 75 of 80 rounds are left to chance.
            s.allocate.max_spp = if policy == "threshold" { 5 } else { 0 };
        });
        let whole = render(&gpu, &scene);
        let renderer = Renderer::resumable(&gpu, &scene, &scene.settings, split()).unwrap();
        let mut frame = FrameResources::new(&gpu).unwrap();
        let cut = Cut { pixels: SIZE[0] * SIZE[1], tile: 1 << 20, paths: 300 };
        let all = schedule::steps(&scene.settings, &cut).count();
        let job = Job { paths_at_once: cut.paths, ..Job::new(&renderer) };
        // After the first step, which starts the film, there are no samples that a file could name.
        for stop in [2, 3, 4, all / 2, all - 2, all] {
            let checkpoint = interrupted(&job, &mut frame, &scene, stop);
            let resumed = Job { checkpoint: Some(&checkpoint), ..Job::new(&renderer) };
            resumed.run_to_end(&mut frame).unwrap();
            assert!(bits(&read(&renderer)) == bits(&whole), "{policy}, stopped after step {stop}");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn records_of_another_film_are_an_error() {
    let gpu = gpu();
    let scene = scene(|s| s.allocate.policy = &tallow::allocate::both::ROW);
    let (renderer, mut frame) =
        (Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap(), FrameResources::new(&gpu).unwrap());
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let mut resume = |size: usize, priority: usize, lacks: usize| {
        let (pixels, priority, pending) = (vec![Pixel::default(); size], vec![0.0; priority], vec![0; lacks]);
        let splits_light = true;
        renderer.resume(&mut frame, &Checkpoint { pixels, priority, pending, splits_light, ..Checkpoint::default() })
    };
    for wrong in [pixels - 1, pixels + 1, 0] {
        for [size, priority, lacks] in [[wrong, 0, pixels], [pixels, 0, wrong]] {
            let error = resume(size, priority, lacks).unwrap_err();
            assert!(matches!(&error, Error::Usage(line) if line.contains(&format!("{wrong} "))), "{error}");
        }
    }
    assert!(matches!(resume(pixels, 1, pixels), Err(Error::Usage(_))));
    for priority in [0, pixels] {
        resume(pixels, priority, pixels).unwrap();
    }
    assert_silent(&gpu);
}

#[test]
fn samples_without_split_light_go_on_in_no_renderer_that_splits_it() {
    let gpu = gpu();
    let scene = scene(|s| s.spp = 2);
    let mut frame = FrameResources::new(&gpu).unwrap();
    let [whole, split] = [Outputs::default(), split()]
        .map(|outputs| Renderer::resumable(&gpu, &scene, &scene.settings, outputs).unwrap());
    // After the beginning and a sample.
    let checkpoint = interrupted(&Job { paths_at_once: SIZE[0] * SIZE[1], ..Job::new(&whole) }, &mut frame, &scene, 2);
    whole.resume(&mut frame, &checkpoint).unwrap();
    let error = split.resume(&mut frame, &checkpoint).unwrap_err();
    assert!(matches!(&error, Error::Usage(line) if line.contains("direct and indirect light")), "{error}");
    assert_silent(&gpu);
}

/// A renderer is used again, or its memory may hold anything.
#[test]
fn a_job_that_stops_before_its_first_step_has_no_sample() {
    let gpu = gpu();
    let scene = scene(|_| {});
    let renderer = Renderer::resumable(&gpu, &scene, &scene.settings, split()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    run(&renderer, &mut frame);
    let job = Job::new(&renderer);
    let status = job.run(&mut frame, &mut |_| Ok(ControlFlow::Break(()))).unwrap();
    let film = job.film(&status).unwrap();
    for (layer, count) in [("samples", 0), ("pending", scene.settings.spp)] {
        assert_eq!(film.channel(layer), Some(&Samples::U32(vec![count; film.pixels()])), "{layer}");
    }
    assert_silent(&gpu);
}

/// Else samples would count twice in a merge, or go on in a scene that they are not of.
#[test]
fn films_tell_what_their_samples_are_of_or_nothing() {
    let gpu = gpu();
    let mut scene = scene(|s| s.spp = 1);
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let mut run = |renderer: &Renderer| Job::new(renderer).run_to_end(&mut frame).unwrap();
    let tells = |renderer: &Renderer, status: &Status| {
        Job::new(renderer).film(status).unwrap().metadata.contains_key("sampleRanges")
    };
    let status = run(&renderer);
    assert!(tells(&renderer, &status));
    renderer.set_seed(0);
    assert!(tells(&renderer, &status), "no other seed");
    renderer.set_seed(1);
    assert!(!tells(&renderer, &status), "the samples are of seed 0");
    let status = run(&renderer);
    assert!(tells(&renderer, &status));
    renderer.set_first_sample(7);
    assert!(!tells(&renderer, &status), "the samples begin with the first");
    let status = run(&renderer);
    assert!(tells(&renderer, &status));
    let change = scene.apply(&tallow::scene::Pose::default()).unwrap();
    gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| renderer.update(rec, &scene, &change)).unwrap();
    assert!(!tells(&renderer, &status), "the samples may be of another pose");
    let status = run(&renderer);
    assert!(tells(&renderer, &status));
    assert_silent(&gpu);
}

/// Where nothing is placed there is no list, and before the first there are no paths on it.
#[test]
fn a_renderer_tells_of_lists_only_where_it_makes_some() {
    let gpu = gpu();
    let scene = scene(|s| s.spp = 1);
    let even = Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap();
    let able = Renderer::resumable(&gpu, &scene, &scene.settings, split()).unwrap();
    Job::new(&even).run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
    for told in [even.listed().map(drop), even.apportionment().map(drop)] {
        assert!(told.is_err_and(|e| e.to_string().contains("\"adaptive\"")));
    }
    assert_eq!((able.listed().unwrap(), able.apportionment().unwrap()), (0, Default::default()));
    assert_silent(&gpu);
}

/// What policies find once per camera is no priority yet: a file that is written before the first round would show it.
#[test]
fn a_start_leaves_priorities_as_they_are() {
    let gpu = gpu();
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let (priority, pending) = (vec![7.0; pixels], vec![0; pixels]);
    let unsampled = Checkpoint { pixels: vec![Pixel::default(); pixels], splits_light: true, ..Checkpoint::default() };
    let checkpoint = Checkpoint { priority, pending, ..unsampled };
    for policy in ["geometry", "variance", "both", "threshold"] {
        let scene = scene(|s| s.allocate.policy = tallow::allocate::policy(policy).unwrap());
        let (renderer, mut frame) =
            (Renderer::new(&gpu, &scene, &scene.settings, split()).unwrap(), FrameResources::new(&gpu).unwrap());
        renderer.resume(&mut frame, &checkpoint).unwrap();
        renderer.run(&mut frame, &Step::Start).unwrap();
        assert_eq!(renderer.film().counts.priority.read().unwrap(), checkpoint.priority, "{policy}");
    }
    assert_silent(&gpu);
}

#[test]
fn disjoint_sample_ranges_join_to_one_render() {
    let gpu = gpu();
    let part = |first, spp| render(&gpu, &scene(move |s| (s.first_sample, s.spp) = (first, spp)));
    let (whole, a, b) = (part(0, 24), part(0, 7), part(7, 17));
    let joined: Vec<Pixel> = a.iter().zip(&b).map(|(a, b)| join(a, b)).collect();
    // Each of n = 24 additions of a running mean rounds to 2^-24 of it, and of M2 to as much of M2 and of its change,
    // n 2^-24 = 1.5e-6 in all; both sides may be off by it.
    let close =
        |x: &[f32; 3], y: &[f32; 3]| x.iter().zip(y).all(|(x, y)| (x - y).abs() <= 3e-6 * x.abs().max(y.abs()) + 1e-9);
    // Indirect light is what direct light leaves of the mean, over albedo: it has the errors of all three.
    let close_to_mean = |one: &Pixel, two: &Pixel| {
        let [x, y, albedo] = [one.indirect(), two.indirect(), one.light.albedo];
        (0..3).all(|c| (x[c] - y[c]).abs() * albedo[c] <= 1e-5 * one.stats.mean[c] + 1e-9)
    };
    for (one, two) in whole.iter().zip(&joined) {
        assert_eq!(one.stats.count, two.stats.count);
        assert!(close(&one.stats.mean, &two.stats.mean) && close_to_mean(one, two));
        assert!(
            one.stats.m2.iter().zip(&two.stats.m2).all(|(x, y)| (x - y).abs() <= 1e-5 * x + 1e-6),
            "{one:?} {two:?}"
        );
    }
    // Control: parts that overlap are not the whole.
    let wrong: Vec<Pixel> = a.iter().zip(&part(0, 17)).map(|(a, b)| join(a, b)).collect();
    assert!(!whole.iter().zip(&wrong).all(|(one, two)| close(&one.stats.mean, &two.stats.mean)));
}

fn average(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len() as f64;
    values.sum::<f64>() / count
}

#[test]
fn geometry_is_unbiased_and_learning_nearly_so() {
    let gpu = gpu();
    let picture = |policy: &str, spp, min_spp| {
        let of = |seed| {
            render(
                &gpu,
                &scene(|s| {
                    (s.spp, s.seed, s.allocate.policy, s.allocate.min_spp) =
                        (spp, seed, tallow::allocate::policy(policy).unwrap(), min_spp);
                }),
            )
        };
        let brightness = |p: Pixel| f64::from(p.stats.mean.iter().sum::<f32>()) / 3.0;
        let means: Vec<f64> = (1..=8).map(|seed| average(of(seed).into_iter().map(brightness))).collect();
        let mean = average(means.iter().copied());
        // Standard error of a mean of eight.
        (mean, (average(means.iter().map(|m| (m - mean).powi(2))) / 7.0).sqrt())
    };
    let reference = picture("uniform", 256, 2);
    for (policy, min_spp, bias) in
        [("geometry", 2, 0.0), ("variance", 4, 0.02), ("both", 4, 0.02), ("both", 1, 0.02), ("threshold", 16, 0.02)]
    {
        let (mean, error) = picture(policy, 32, min_spp);
        let off = (mean - reference.0).abs();
        println!("{policy}: {mean:.5} +- {error:.5}, uniform {:.5} +- {:.5}", reference.0, reference.1);
        assert!(off < 4.0 * error.hypot(reference.1) + bias * reference.0, "{policy}: {mean} {error} {reference:?}");
        assert!(error < 0.01 * mean, "control, {policy}: {mean} +- {error} tells");
    }
}

#[test]
fn pixels_without_a_sample_are_well_defined() {
    let gpu = gpu();
    for policy in POLICIES {
        let scene = scene(|s| {
            (s.spp, s.allocate.policy, s.allocate.min_spp, s.allocate.rounds) =
                (1, tallow::allocate::policy(policy).unwrap(), 0, 1)
        });
        let pixels = render(&gpu, &scene);
        assert_eq!(total(&pixels), 33 * 17, "{policy}");
        let finite = |p: &Pixel| {
            bytemuck::cast_slice::<_, f32>(&[p.light])
                .iter()
                .chain(&p.stats.mean)
                .chain(&p.stats.m2)
                .all(|v| v.is_finite())
        };
        assert!(pixels.iter().all(finite), "{policy}");
        let untouched = pixels.iter().filter(|p| p.stats.count == 0);
        assert!(untouched.clone().all(|p| *p == Pixel::default()), "{policy}");
        assert!(policy != "geometry" || untouched.count() > 0, "no pixel was left out: the test tests nothing");
    }
    assert_silent(&gpu);
}

#[test]
fn no_pixel_exceeds_the_largest_number() {
    let gpu = gpu();
    for policy in POLICIES {
        let scene = scene(|s| (s.allocate.policy, s.allocate.max_spp) = (tallow::allocate::policy(policy).unwrap(), 9));
        let pixels = render(&gpu, &scene);
        assert_eq!((total(&pixels), pixels.iter().map(|p| p.stats.count).max()), (8 * 33 * 17, Some(9)), "{policy}");
    }
    assert_silent(&gpu);
}

/// A white ball in a constant sky, most of which gets no sample: whatever fills it in, nothing is brighter than the sky, to the noise of
/// four samples.
#[test]
fn sky_without_samples_takes_no_more_light_than_there_is() {
    let text = "[film]\nwidth = 64\nheight = 64\n[camera]\nposition = [0, 0, 3]\ntarget = [0, 0, 0]\nfov = 40\n[render]\nspp = 4\n\
                max_depth = 3\n[environment]\nradiance = 0.5\n[[mesh]]\nshape = 'sphere'\nmaterial = 'white'\n\
                transform = { scale = 0.5 }\n[[material]]\nname = 'white'\ncolor = 0.8\n";
    let place = |s: &mut Settings| {
        (s.allocate.policy, s.allocate.min_spp) = (tallow::allocate::policy("geometry").unwrap(), 0);
    };
    let (gpu, scene) = (gpu(), Scene::parse(Path::new("ball.toml"), text).unwrap().with(place));
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let pixels = run(&renderer, &mut FrameResources::new(&gpu).unwrap());
    let empty = pixels.iter().filter(|pixel| pixel.stats.count == 0).count();
    assert!(empty > 1000, "control: {empty} pixels have no sample");
    for row in &FILTERS[1..] {
        let denoiser =
            Denoiser::new(&gpu, &renderer, row, &FilterSettings::default(), Demodulation::Light, Fireflies::Off)
                .unwrap();
        gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| denoiser.record(rec)).unwrap();
        let picture = denoiser.picture().read().unwrap();
        let most = largest(picture.iter().flat_map(|pixel| &pixel[..3]).copied());
        assert!((0.45..0.6).contains(&most), "{}: {most}", row.name);
    }
    assert_silent(&gpu);
}

/// The records of this film are more than one storage binding of the reference device may hold: 1366 rows and no more.
#[test]
fn a_film_of_several_storage_bindings_is_placed() {
    let gpu = gpu();
    let sized = |policy: &'static str, spp| {
        scene(move |s| {
            ([s.width, s.height], s.spp, s.max_depth) = ([2048, 1376], spp, 2);
            (s.allocate.policy, s.allocate.min_spp) = (tallow::allocate::policy(policy).unwrap(), 1);
        })
    };
    let outputs = Outputs { guides: true, ..split() };
    let scene = sized("both", 2);
    let placed = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
    let windows = placed.film().tiles[0].windows().count();
    assert!(windows == 2 || gpu.info().max_storage_range > 1 << 27, "{windows} windows");
    let pixels = run(&placed, &mut FrameResources::new(&gpu).unwrap());
    assert_eq!(total(&pixels), 2 * 2048 * 1376);
    let alike = render(&gpu, &sized("uniform", 1));
    let one: Vec<usize> = (0..pixels.len()).filter(|&i| pixels[i].stats.count == 1).collect();
    assert!(one.iter().filter(|&&i| i >= 2048 * 1370).count() > 1000, "the last rows have too few to compare");
    assert!(one.iter().all(|&i| bits(&pixels[i..=i]) == bits(&alike[i..=i])), "a pixel of one sample has other light");
    let (scene, guide) = (sized("both", 2), placed.film().tiles[0].guide.read().unwrap());
    let frame = frame_constants(&scene, &scene.settings).unwrap();
    let wrong = |&p: &u32| tallow::twins::primary_hit::guide(&scene, &frame, p).object != guide[p as usize].object;
    assert!((0..2048 * 1376).step_by(997).filter(wrong).count() < 10, "primary hits");
    assert_silent(&gpu);
}
