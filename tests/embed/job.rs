//! Tests a render in an engine by the library alone: up to a noise threshold, interrupted, written, read, resumed, merged.

use crate::support::{assert_silent, gpu};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;
use tallow::gpu::{FrameResources, Gpu};
use tallow::image::{self, Film, Samples, WriteOptions};
use tallow::layout::Camera;
use tallow::render::settings::Settings;
use tallow::render::{Checkpoint, Gap, Job, Outputs, Renderer, Status, Step, StopReason, merge, traces_paths};
use tallow::scene::{Change, Loaded, Scene};

fn scene(change: impl Fn(&mut Settings)) -> Loaded {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml");
    let small = |s: &mut Settings| {
        (s.width, s.height, s.spp, s.max_depth) = (33, 17, 32, 3);
        change(s);
    };
    Scene::load(&file).unwrap().with(small)
}

/// Some pixels reach it, and some do not before they are full.
fn to_a_threshold(s: &mut Settings) {
    (s.allocate.policy, s.allocate.noise_threshold) = (tallow::allocate::policy("variance").unwrap(), 0.08);
}

/// Runs a job, which stops before the first step by which it has traced so many samples, and writes its film.
fn run(gpu: &Gpu, job: &Job, file: &Path, most: u64) -> Status {
    let mut frame = FrameResources::new(gpu).unwrap();
    let mut steps = Vec::new();
    let mut between = |status: &Status| {
        steps.push((status.done, status.planned));
        Ok(if status.traced >= most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    };
    let status = job.run(&mut frame, &mut between).unwrap();
    assert!(steps.is_sorted() && steps.iter().all(|(done, planned)| done <= planned), "{steps:?}");
    image::write(file, &job.film(&status).unwrap(), &WriteOptions::default()).unwrap();
    status
}

/// Names and bits of all channels.
fn channels(film: &Film) -> Vec<(&str, Vec<u32>)> {
    let bits = |samples: &Samples| match samples {
        Samples::F32(values) => values.iter().map(|v| v.to_bits()).collect(),
        Samples::U32(values) => values.clone(),
    };
    film.channels.iter().map(|c| (c.name.as_str(), bits(&c.samples))).collect()
}

#[test]
fn an_engine_renders_to_a_threshold_and_resumes_where_it_was_interrupted() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    for (policy, spread) in [("to a threshold", false), ("evenly", true)] {
        let scene = scene(|s| if spread { s.spp = 4 } else { to_a_threshold(s) });
        let renderer = Renderer::resumable(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        // Short steps, so that there are some to stop between.
        let job = Job { paths_at_once: 300, ..Job::new(&renderer) };
        let whole = run(&gpu, &job, &file("whole.exr"), u64::MAX);
        match whole.stopped {
            StopReason::Threshold { above } => assert!(!spread && above < 33 * 17, "{above} pixels are above it"),
            reason => assert!(spread && reason == StopReason::Done, "{reason:?}"),
        }
        let part = run(&gpu, &job, &file("part.exr"), whole.traced / 2);
        assert_eq!(part.stopped, StopReason::Interrupted);
        assert!(part.traced >= whole.traced / 2 && part.traced < whole.traced, "{policy}");
        let checkpoint = Checkpoint::read(&file("part.exr"), &scene, &scene.settings).unwrap();
        let rest = Job { checkpoint: Some(&checkpoint), ..Job::new(&renderer) };
        let rest = run(&gpu, &rest, &file("resumed.exr"), u64::MAX);
        assert_eq!((rest.stopped, part.traced + rest.traced), (whole.stopped, whole.traced), "{policy}");
        let [whole, part, resumed] =
            ["whole.exr", "part.exr", "resumed.exr"].map(|name| image::read(&file(name)).unwrap());
        assert!(
            channels(&resumed) == channels(&whole),
            "{policy}: other bits than those of the render that never stopped"
        );
        assert!(channels(&part) != channels(&whole), "{policy}: control");
        assert_eq!(whole.primaries.map(|[red, ..]| red), Some([0.64, 0.33]), "Rec. 709");
    }
    assert_silent(&gpu);
}

#[test]
fn a_job_begins_in_one_way() {
    let gpu = gpu();
    let scene = scene(|s| s.spp = 2);
    let renderer = Renderer::resumable(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let job = Job { pixel: Some(5), carries: true, ..Job::new(&renderer) };
    let error = job.run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap_err().to_string();
    assert!(error.contains("more than one of checkpoint, pixel and carries"), "{error}");
    let pixels = scene.settings.pixels();
    let job = Job { pixel: Some(pixels as u32), ..Job::new(&renderer) };
    let error = job.run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap_err().to_string();
    assert!(error.contains(&format!("pixel {pixels} is outside of the film")), "{error}");
    assert_silent(&gpu);
}

/// What was accumulated is still of the scene that it says.
#[test]
fn an_update_that_is_refused_leaves_what_a_film_says() {
    let gpu = gpu();
    let mut scene = scene(|s| s.spp = 2);
    let mut renderer = Renderer::resumable(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let status = Job::new(&renderer).run_to_end(&mut frame).unwrap();
    let said = |renderer: &Renderer| Job::new(renderer).film(&status).unwrap().metadata;
    let before = said(&renderer);
    let fov = scene.scene.view.fov.replace(200.0);
    let change = Change::everything(&scene);
    assert!(gpu.run(&mut frame, |rec| renderer.update(rec, &scene, &change)).is_err());
    assert_eq!(said(&renderer), before);
    scene.scene.view.fov = fov;
    let other = crate::support::gpu();
    let foreign = other.run(&mut FrameResources::new(&other).unwrap(), |rec| renderer.update(rec, &scene, &change));
    let error = foreign.unwrap_err();
    assert!(error.exit_code() == 2 && error.to_string().contains("the renderer was made on another device"), "{error}");
    assert!(said(&renderer) == before && renderer.run(&mut frame, &Step::Start).is_ok());
    assert_silent(&gpu);
}

#[test]
fn steps_of_a_given_time_change_no_bit() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.exr");
    for (policy, even) in [("to a threshold", false), ("evenly", true)] {
        // The first step has 4096 paths.
        let scene = scene(|s| {
            (s.width, s.height) = (99, 51);
            if !even {
                to_a_threshold(s);
            }
        });
        let renderer = Renderer::resumable(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        let rendered = |step_time: Option<Duration>| {
            let job = Job { step_time, ..Job::new(&renderer) };
            let status = run(&gpu, &job, &file, u64::MAX);
            (status.times.iter().filter(|pass| traces_paths(pass.name)).count(), image::read(&file).unwrap())
        };
        let ((few, whole), (many, cut)) = (rendered(None), rendered(Some(Duration::from_nanos(1))));
        assert!(many > few, "{policy}: {few} and {many} steps");
        assert!(channels(&whole) == channels(&cut), "{policy}");
    }
    assert_silent(&gpu);
}

#[test]
fn an_engine_merges_what_it_rendered_by_two_seeds() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    for (name, seed, first) in [("a.exr", 0, 0), ("b.exr", 1, 0), ("c.exr", 1, 8)] {
        let scene = scene(|s| (s.spp, s.seed, s.first_sample) = (4, seed, first));
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        run(&gpu, &Job::new(&renderer), &file(name), u64::MAX);
    }
    let merged = merge(&["a.exr", "b.exr", "c.exr"].map(file)).unwrap();
    assert_eq!(merged.gaps, [Gap { seed: 1, first: 4, last: 7 }]);
    let counts = |film: &Film| film.channel("samples").cloned();
    assert!(matches!(counts(&merged.film), Some(Samples::U32(counts)) if counts.iter().all(|&n| n == 12)));
    let [a, b] = ["a.exr", "b.exr"].map(|name| image::read(&file(name)).unwrap().picture(None).unwrap().pixels);
    let mean = merge(&["b.exr", "a.exr"].map(file)).unwrap().film.picture(None).unwrap().pixels;
    let is_mean = |((a, b), mean): ((&[f32; 3], &[f32; 3]), &[f32; 3])| {
        (0..3).all(|c| (mean[c] - (a[c] + b[c]) / 2.0).abs() <= 1e-6 * mean[c])
    };
    assert!(a.iter().zip(&b).zip(&mean).all(is_mean), "of as many samples each, the mean of the two");
    assert!(a != b, "control: the seeds differ");
    let twice = merge(&["a.exr", "a.exr"].map(file)).unwrap_err();
    assert!(twice.exit_code() == 3 && twice.to_string().contains("twice"), "{twice}");
    assert_eq!(merge(&[] as &[&Path]).unwrap_err().exit_code(), 2);
    assert_silent(&gpu);
}

/// No scene has its samples: a file that said so would be resumed with the scene's own camera.
#[test]
fn a_film_of_a_moved_camera_cannot_be_resumed() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("moved.exr");
    let scene = scene(|s| s.spp = 2);
    let mut renderer = Renderer::resumable(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    run(&gpu, &Job::new(&renderer), &file, u64::MAX);
    Checkpoint::read(&file, &scene, &scene.settings).unwrap();
    renderer.set_camera(Camera { position: [0.1, 0.2, 0.3], ..scene.camera([33, 17]).unwrap() }).unwrap();
    run(&gpu, &Job::new(&renderer), &file, u64::MAX);
    let error = Checkpoint::read(&file, &scene, &scene.settings).unwrap_err();
    assert!(error.exit_code() == 3 && error.to_string().contains("settings"), "{error}");
    assert_silent(&gpu);
}
