//! Tests whole renders: they have the same bits however the work is cut, differ by rounding only whatever effects are compiled in,
//! give the known answer of furnaces, and have no broken pixel.
use crate::alike::alike;
use crate::support;
use crate::twin::{Random, Workplace};
use glam::Vec3;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Mutex;
use tallow::gpu::{Buffer, FrameResources, Gpu, Location, Tuning};
use tallow::layout::{
    BSDF_COATED, BSDF_DIFFUSE, Effect, Effects, Guide, LIGHT_POINT, Material, NONE, PixelLight, PixelStats, Triangle,
};
use tallow::render::settings::{PixelFilter, Sampler, Settings, Split};
use tallow::render::{self, Batch, Job, Outputs, Renderer, Step};
use tallow::scene::{Loaded, Scene, SceneFile};
use tallow::shaders::shared::light::KEY_PROBABILITY;
use tallow::statistics::{BrokenSamples, Pixel};

fn scene(file: &str, change: impl Fn(&mut Settings)) -> Loaded {
    Scene::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file))
        .map(|scene| scene.with(&change))
        .unwrap()
}

fn small(s: &mut Settings) {
    (s.width, s.height, s.spp) = (33, 17, 4);
}

fn bits(stats: &[PixelStats]) -> Vec<u32> {
    bytemuck::cast_slice(stats).to_vec()
}

/// Every scene that the repository ships.
fn scenes() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let files = |folder: std::fs::DirEntry| {
        let name = folder.file_name().into_string().unwrap();
        let inside = std::fs::read_dir(folder.path()).unwrap();
        inside.map(move |f| format!("{name}/{}", f.unwrap().file_name().into_string().unwrap()))
    };
    let folders = std::fs::read_dir(root).unwrap().map(Result::unwrap).filter(|f| f.path().is_dir());
    let mut all: Vec<_> = folders.flat_map(files).filter(|f| f.ends_with(".toml")).collect();
    all.sort();
    assert!(all.len() >= 12, "{all:?}");
    all
}

/// Kernels add to indices without a limit, and so does the host.
#[test]
fn the_sequence_of_samples_goes_on_from_its_start_behind_its_end() {
    let scene = scene("cornell-box/scene.toml", small);
    let mut renderer = Renderer::new(&support::gpu(), &scene, &scene.settings, Outputs::default()).unwrap();
    renderer.set_first_sample(u32::MAX);
    let first = |step: Step| if let Step::Uniform(batch) = step { Some(batch.first_sample) } else { None };
    let firsts = [0, 1, 2].map(|sample| renderer.samples(sample, 1).find_map(first));
    assert_eq!(firsts, [Some(u32::MAX), Some(0), Some(1)]);
    // Ranges of such samples cannot be told: its film names none, and says so to who would go on with it.
    let film = |first: u32, renderer: &mut Renderer| {
        renderer.set_first_sample(first);
        let job = Job::new(renderer);
        let status = job.run_to_end(&mut FrameResources::new(&support::gpu()).unwrap()).unwrap();
        job.film(&status).unwrap().metadata.contains_key("sampleRanges")
    };
    assert_eq!([7, u32::MAX - 1].map(|first| film(first, &mut renderer)), [true, false]);
}

/// Its buffers are as long as those of layers that nobody asked for.
#[test]
fn a_film_of_one_pixel_has_the_layers_of_any_other() {
    let gpu = support::gpu();
    for file in ["cornell-box/scene.toml", "cornell-box/glass.toml"] {
        let layers = [1, 2].map(|width| {
            let scene = scene(file, |s| (s.width, s.height, s.spp) = (width, 1, 1));
            let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
            let job = Job::new(&renderer);
            let status = job.run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
            let film = job.film(&status).unwrap();
            film.channels.into_iter().map(|channel| channel.name).collect::<Vec<_>>()
        });
        assert_eq!(layers[0], layers[1], "{file}");
    }
    support::assert_silent(&gpu);
}

/// The samples' rays against the counters, which atomics make.
#[test]
fn samples_know_their_rays() {
    let gpu = support::gpu();
    for split_light in [false, true] {
        let scene = scene("cornell-box/glass.toml", small);
        let renderer =
            Renderer::new(&gpu, &scene, &scene.settings, Outputs { split_light, guides: false, counters: true })
                .unwrap();
        support::render(&gpu, &renderer); // one batch
        let records = if split_light { 3 } else { 1 };
        let samples = renderer.film().samples.read().unwrap();
        assert_eq!(samples.len(), 33 * 17 * 4 * records, "one batch");
        let rays: f64 = samples.iter().step_by(records).map(|s| f64::from(s[3])).sum();
        assert_eq!(rays, renderer.counters().unwrap().rays() as f64, "split_light {split_light}");
        assert!(rays > f64::from(2 * 33 * 17 * 4), "control: {rays}");
    }
    support::assert_silent(&gpu);
}

/// Two frames in one recording: the first is still to run when the camera moves.
#[test]
fn a_recorded_frame_keeps_its_camera() {
    let gpu = support::gpu();
    let scene = scene("cornell-box/scene.toml", small);
    let still = scene.camera(scene.settings.size()).unwrap();
    let moved = tallow::layout::Camera { near: still.near + 0.1, position: [0.1, 1.0, 6.0], ..still };
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let expected = [still, moved].map(|camera| {
        renderer.set_camera(camera).unwrap();
        support::render(&gpu, &renderer)
    });
    let copies = ["first", "second"].map(|name| Buffer::new(&gpu, name, 33 * 17, Location::Readback).unwrap());
    let stats = renderer.film().tiles[0].stats.clone();
    gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| {
        for (camera, copy) in [still, moved].into_iter().zip(&copies) {
            renderer.set_camera(camera)?;
            renderer.steps().try_for_each(|step| renderer.record(rec, &step))?;
            rec.copy(&stats, copy)?;
        }
        Ok(())
    })
    .unwrap();
    for (copy, expected) in copies.iter().zip(&expected) {
        assert!(bits(&copy.read().unwrap()) == bits(expected));
    }
    assert!(bits(&expected[0]) != bits(&expected[1]), "control: the cameras see different pictures");
    support::assert_silent(&gpu);
}

/// The effects that change the picture when they are compiled in alone, for the message of a failure.
fn culprits(gpu: &Gpu, scene: &Loaded, expected: &[PixelStats]) -> String {
    let called_for = render::called_for(scene, &scene.settings, Outputs::default());
    let effects = Effect::ALL.iter().copied().zip(called_for.switches());
    let off = effects.filter(|&(effect, on)| !on && effect != Effect::independent_sampler).map(|(effect, _)| effect);
    let changes = |&effect: &Effect| {
        let other =
            Renderer::specialised(gpu, scene, &scene.settings, Outputs::default(), called_for.toggled(effect)).unwrap();
        bits(&support::render(gpu, &other)) != bits(expected)
    };
    off.filter(changes).map(Effect::name).collect::<Vec<_>>().join(", ")
}

/// What is called for, and all effects.
fn plain_and_all(gpu: &Gpu, scene: &Loaded) -> [Renderer; 2] {
    let outputs = Outputs::FILTERED;
    let all = Renderer::specialised(gpu, scene, &scene.settings, outputs, render::all_effects(scene, &scene.settings));
    [Renderer::new(gpu, scene, &scene.settings, outputs).unwrap(), all.unwrap()]
}

/// llvmpipe rounds as the source says. Other drivers fuse and reorder arithmetic in one kernel and not in another; what
/// they make of the same samples must then be alike, by a z-test.
fn alike_with_all_effects(gpu: &Gpu, file: &str, renders: usize) -> Result<(), String> {
    if gpu.info().name.contains("llvmpipe") {
        return Err("the bits differ".to_owned());
    }
    let scene = scene(file, more_samples);
    let [a, b] = plain_and_all(gpu, &scene).map(|renderer| support::render(gpu, &renderer));
    println!("{file}: the bits differ with all effects compiled in; judged by a z-test");
    alike(&a, &b, renders)
}

/// As many as know their own error.
fn more_samples(s: &mut Settings) {
    small(s);
    s.spp = 16;
}

/// Those with the same random numbers share a kernel with all effects, and most of the time those are compiled: each by one thread.
#[test]
fn every_scene_renders_finite_pixels_and_the_same_with_all_effects() {
    let files = scenes();
    let mut groups: HashMap<Effects, Vec<(&str, Loaded)>> = HashMap::new();
    for file in &files {
        let mut scene = scene(file, small);
        scene.stack = scene.stack.max(16); // for all depths one kernel
        groups.entry(render::all_effects(&scene, &scene.settings)).or_default().push((file, scene));
    }
    let mut groups: Vec<_> = groups.into_values().collect();
    groups.sort_by_key(Vec::len);
    let groups = Mutex::new(groups);
    let next = || groups.lock().unwrap().pop();
    let render_groups = || {
        let gpu = support::gpu();
        for (file, scene) in std::iter::from_fn(next).flatten() {
            renders_the_same_with_all_effects(&gpu, file, &scene, files.len());
        }
        support::assert_silent(&gpu);
    };
    std::thread::scope(|scope| {
        scope.spawn(render_groups);
        render_groups();
    });
}

fn renders_the_same_with_all_effects(gpu: &Gpu, file: &str, scene: &Loaded, renders: usize) {
    let [plain, all] = plain_and_all(gpu, scene);
    let (a, b) = (support::render(gpu, &plain), support::render(gpu, &all));
    assert!(a.iter().all(|s| s.mean.iter().chain(&s.m2).all(|v| v.is_finite())), "{file}: broken pixels");
    assert!(a.iter().any(|s| s.mean != [0.0; 3]), "{file}: black");
    if bits(&a) != bits(&b) {
        alike_with_all_effects(gpu, file, renders)
            .unwrap_or_else(|e| panic!("{file}: {e}; effects that change it: {}", culprits(gpu, scene, &a)));
    }
    let light = plain.film().tiles[0].light.read().unwrap();
    assert!(light.iter().all(|l| l.direct.iter().chain(&l.albedo).all(|v| v.is_finite())), "{file}");
}

/// The z-test that other devices are judged by, on any device.
#[test]
fn renders_that_rounding_tells_apart_are_alike_and_faults_are_not() {
    let gpu = support::gpu();
    let render = |file: &str, seed: u32, change: fn(&mut Effects)| {
        let scene = scene(file, |s| {
            more_samples(s);
            s.seed = seed;
        });
        let mut effects = render::called_for(&scene, &scene.settings, Outputs::default());
        change(&mut effects);
        support::render(
            &gpu,
            &Renderer::specialised(&gpu, &scene, &scene.settings, Outputs::default(), effects).unwrap(),
        )
    };
    let scaled = |s: PixelStats, by: f32| PixelStats { mean: s.mean.map(|v| v * by), ..s };
    for file in ["cornell-box/scene.toml", "cornell-box/glass.toml", "grass/scene.toml"] {
        let (a, other) = (render(file, 1, |_| {}), render(file, 2, |_| {}));
        let changed = |change: &dyn Fn(PixelStats, PixelStats, usize) -> PixelStats| -> Vec<_> {
            (0..a.len()).map(|i| change(a[i], other[i], i)).collect()
        };
        let verdict = |b: &[PixelStats]| alike(&a, b, scenes().len());
        for (what, b) in [
            ("the same", a.clone()),
            ("another seed", other.clone()),
            ("paths that turn", changed(&|a, b, i| if i % 100 == 0 { b } else { a })),
            ("rounding", changed(&|a, _, _| scaled(a, 1.00005))),
        ] {
            verdict(&b).unwrap_or_else(|e| panic!("{file}: {what}: {e}"));
        }
        for (what, b) in [
            ("2 % brighter, and paths that turn", changed(&|a, b, i| scaled(if i % 100 == 0 { b } else { a }, 1.02))),
            ("broken pixels", changed(&|a, _, i| if i % 50 == 0 { scaled(a, 9.0) } else { a })),
        ] {
            assert!(verdict(&b).is_err(), "{file}: {what}");
        }
    }
    let without = render("cornell-box/scene.toml", 1, |effects| effects.emissive = false);
    assert!(alike(&render("cornell-box/scene.toml", 1, |_| {}), &without, 1).is_err(), "an effect that is left out");
    support::assert_silent(&gpu);
}

#[test]
fn the_cut_into_batches_changes_no_bit() {
    let gpu = support::gpu();
    let scene = scene("cornell-box/scene.toml", small);
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let whole = support::render(&gpu, &renderer);
    let pixels = 33 * 17;
    for (run, depth) in [(1, 4), (31, 1), (64, 3), (65, 2), (pixels, 1)] {
        let mut steps = vec![Step::Start];
        for first_sample in (0..4).step_by(depth as usize) {
            for first_pixel in (0..pixels).step_by(run as usize) {
                let (pixels, samples) = (run.min(pixels - first_pixel), depth.min(4 - first_sample));
                steps.push(Step::Uniform(Batch { first_pixel, pixels, first_sample, samples }));
            }
        }
        assert!(bits(&support::render_steps(&gpu, &renderer, &steps)) == bits(&whole), "{run} x {depth}");
    }
    // A step of a larger renderer would be written beyond this one's buffers.
    let foreign = Step::Uniform(Batch { first_pixel: 1, pixels, first_sample: 0, samples: 1 });
    let refused = renderer.run(&mut FrameResources::new(&gpu).unwrap(), &foreign).unwrap_err();
    assert!(refused.to_string().contains("of another renderer"), "{refused}");
    // Control: one sample left out must show.
    let part = Step::Uniform(Batch { first_pixel: 0, pixels, first_sample: 0, samples: 3 });
    assert!(bits(&support::render_steps(&gpu, &renderer, &[Step::Start, part])) != bits(&whole));
    support::assert_silent(&gpu);
}

/// Mean over the film and its standard error, per channel.
fn mean(stats: &[PixelStats]) -> [(f64, f64); 3] {
    let n = stats.len() as f64;
    std::array::from_fn(|c| {
        let sum: f64 = stats.iter().map(|s| f64::from(s.mean[c])).sum();
        let spread: f64 =
            stats.iter().map(|s| f64::from(s.m2[c]) / (f64::from(s.count) * f64::from(s.count - 1))).sum();
        (sum / n, spread.sqrt() / n)
    })
}

fn furnace(file: &str, depth: u32, spp: u32) -> [(f64, f64); 3] {
    let gpu = support::gpu();
    let scene = scene(file, |s| {
        (s.width, s.height, s.spp, s.max_depth, s.roulette_depth) = (64, 64, spp, depth, 0);
    });
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let stats = support::render(&gpu, &renderer);
    support::assert_silent(&gpu);
    mean(&stats)
}

/// An object that absorbs nothing, in a constant environment of radiance 1, cannot be seen: every path that leaves
/// carries 1. Cut at d edges, a diffuse body loses what its paths would have carried on; a convex one loses nothing.
fn is_invisible(file: &str, depth: u32) {
    for (mean, error) in furnace(file, depth, 64) {
        println!("{file}: {mean:.6} +- {error:.6}");
        assert!((mean - 1.0).abs() <= 1e-3, "{file}: {mean} +- {error}");
    }
}

#[test]
fn a_white_body_vanishes_in_the_furnace() {
    is_invisible("furnace/scene.toml", 8);
}

#[test]
fn a_coated_white_body_vanishes_in_the_furnace() {
    is_invisible("furnace/coated.toml", 8);
}

#[test]
fn a_mirror_vanishes_in_the_furnace() {
    is_invisible("furnace/mirror.toml", 8);
}

#[test]
fn glass_vanishes_in_the_furnace() {
    is_invisible("furnace/glass.toml", 64);
}

/// Rays that meet the rim of a sphere are mirrored into the sky as others are: there is no facet to look past.
#[test]
fn every_pixel_of_a_mirror_in_the_furnace_is_white() {
    let gpu = support::gpu();
    let worst = |specular: f32| {
        let mut scene = scene("furnace/mirror.toml", |s| (s.width, s.height, s.spp) = (64, 64, 32));
        scene.materials.iter_mut().for_each(|m| m.specular = [specular; 3]);
        let stats = support::render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap());
        support::largest(stats.iter().flat_map(|s| s.mean).map(|v| (v - 1.0).abs()))
    };
    let off = worst(1.0);
    // Reflectances of GPUs round by more than lavapipe's.
    assert!(off < 1e-4, "off by {off:e}");
    assert!(worst(0.999) > 5e-4, "control: a mirror that absorbs");
    support::assert_silent(&gpu);
}

/// Entering glass scales radiance by 1 / eta^2 = 0.44, and leaving it by eta^2. Roulette that took the former for a loss would
/// end more than half of all paths through the ball, and the variance of a sample be above 1; it ends 5 % at each surface.
#[test]
fn roulette_knows_that_glass_loses_no_light() {
    let gpu = support::gpu();
    let scene = scene("furnace/glass.toml", |s| {
        (s.width, s.height, s.spp, s.max_depth, s.roulette_depth) = (64, 64, 64, 512, 1);
    });
    let stats = support::render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap());
    for (mean, error) in mean(&stats) {
        assert!((mean - 1.0).abs() <= 4.0 * error + 1e-3, "{mean} +- {error}");
    }
    let middle = |i: &usize| (24..40).contains(&(i % 64)) && (24..40).contains(&(i / 64));
    let variance = (0..64 * 64).filter(middle).map(|i| stats[i].m2[1] / 63.0).sum::<f32>() / 256.0;
    assert!((0.05..0.3).contains(&variance), "{variance}");
    support::assert_silent(&gpu);
}

/// Whether a mesh is stored where it stands, or placed when rays meet it, is the renderer's choice, and shows nowhere.
#[test]
fn smooth_normals_are_those_of_a_stretched_mesh_however_it_is_placed() {
    let gpu = support::gpu();
    let text = "[film]\nwidth = 33\nheight = 33\n[camera]\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nfov = 30\n[environment]\n\
                [[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 16\n[[instance]]\nmesh = 'ball'\n\
                transform = { rotate = [20, 50, 0], scale = [1, -0.8, 0.2] }\n";
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("ball.toml");
    std::fs::write(&file, text).unwrap();
    let guides = |stays: bool| {
        let mut file = SceneFile::open(&file).unwrap();
        if stays {
            file.stays_still();
        }
        let scene = file.load().unwrap();
        assert_eq!(scene.instances.is_empty(), stays, "control");
        apart(&gpu, &scene).2
    };
    let [stored, placed] = [true, false].map(guides);
    let hit = || stored.iter().zip(&placed).filter(|(a, b)| a.depth > 0.0 && b.depth > 0.0);
    let off = hit().map(|(a, b)| glam::Vec3::from(a.normal).distance(b.normal.into()));
    assert!(hit().count() > 200 && support::largest(off.clone()) < 2e-4, "{}", support::largest(off));
    support::assert_silent(&gpu);
}

/// Roulette adds noise and takes no light: whoever survives by the number that also chose where a path goes on would carry the light
/// of some directions alone.
#[test]
fn roulette_leaves_the_light_of_every_part_of_a_room() {
    const SIDE: usize = 32;
    let gpu = support::gpu();
    let render = |roulette_depth, seed| {
        let scene = scene("cornell-box/scene.toml", |s| {
            (s.width, s.height, s.spp, s.max_depth) = (SIDE as u32, SIDE as u32, 2048, 8);
            (s.roulette_depth, s.seed) = (roulette_depth, seed);
        });
        support::render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap())
    };
    let [whole, ended] = [render(0, 0), render(1, 1)];
    let shares = |stats: &[PixelStats]| mean_of(stats).map(|(mean, _)| mean);
    assert!((0..3).all(|c| shares(&whole)[c] > 0.02), "control: there is light: {:?}", shares(&whole));
    for (part, of) in quarters(SIDE) {
        let [a, b] = [&whole, &ended].map(|stats| mean_of(&of.iter().map(|&i| stats[i]).collect::<Vec<_>>()));
        for ((a, error_a), (b, error_b)) in a.into_iter().zip(b) {
            let error = (error_a * error_a + error_b * error_b).sqrt();
            // Twelve comparisons at 4.3 standard errors, and the seeds are chosen: by chance one in 5000 such tests fails.
            assert!((a - b).abs() <= 4.3 * error, "{part}: {a} without, {b} with roulette, +- {error}");
            assert!(error < 0.01 * a, "control: {part} is known to a hundredth");
        }
    }
    support::assert_silent(&gpu);
}

/// Mean of pixels and its standard error, by channel.
fn mean_of(stats: &[PixelStats]) -> [(f64, f64); 3] {
    let n = stats.len() as f64;
    [0, 1, 2].map(|c| {
        let sum = stats.iter().map(|s| f64::from(s.mean[c])).sum::<f64>();
        let error2 = |s: &PixelStats| f64::from(s.m2[c]) / (f64::from(s.count) * f64::from(s.count - 1));
        (sum / n, stats.iter().map(error2).sum::<f64>().sqrt() / n)
    })
}

/// The pixels of the quarters of a square film, with their names.
fn quarters(side: usize) -> [(&'static str, Vec<usize>); 4] {
    let of = |right: usize, below: usize| {
        let half = |i: usize| (i % side / (side / 2), i / side / (side / 2));
        (0..side * side).filter(|&i| half(i) == (right, below)).collect()
    };
    [("upper left", of(0, 0)), ("upper right", of(1, 0)), ("lower left", of(0, 1)), ("lower right", of(1, 1))]
}

/// A Cornell box whose floor is black plastic, or black without a coat.
fn black_floor(coated: bool) -> Loaded {
    let mut scene = scene("cornell-box/scene.toml", |s| (s.width, s.height, s.spp) = (32, 32, 64));
    let plastic = Material {
        kind: if coated { BSDF_COATED } else { BSDF_DIFFUSE },
        base_color: [0.005; 3],
        eta: [1.5; 3],
        specular: [1.0; 3],
        internal_fresnel: tallow::scene::mean_internal_fresnel(1.5),
        ..scene.materials[0]
    };
    let own = scene.materials.len() as u32;
    scene.materials.push(plastic);
    scene.names.materials.push("plastic".to_owned());
    let lies = |t: &Triangle| [t.v0, t.v1, t.v2].iter().all(|v| v[1].abs() < 1e-3);
    scene.triangles.iter_mut().filter(|t| lies(t)).for_each(|t| t.material = own);
    scene
}

/// Renders, and returns radiance, light and guides.
fn apart(gpu: &Gpu, scene: &Loaded) -> (Vec<PixelStats>, Vec<PixelLight>, Vec<Guide>) {
    let renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::FILTERED).unwrap();
    let stats = support::render(gpu, &renderer);
    let tile = &renderer.film().tiles[0];
    (stats, tile.light.read().unwrap(), tile.guide.read().unwrap())
}

/// Behind the surface of glass of index 1.5 at head on, light is 1 / 1.5^2 of what it is in it. 4 % is mirrored, which counts as white,
/// by whichever ways the samples of a pixel went: the albedo has no noise of that choice, but where all went the rare way. A tint counts,
/// but no channel as less than three tenths of the strongest.
#[test]
fn what_lies_behind_glass_keeps_its_albedo() {
    let gpu = support::gpu();
    lies_behind_glass(&gpu, [1.0; 3], [1.0; 3]);
    lies_behind_glass(&gpu, [0.5, 0.001, 0.25], [0.5, 0.15, 0.25]);
    support::assert_silent(&gpu);
}

fn lies_behind_glass(gpu: &Gpu, transmission: [f32; 3], tint: [f32; 3]) {
    let text = format!(
        "[film]\nwidth = 32\nheight = 32\n[camera]\nposition = [0.0, 0.0, 1.0]\nfov = 2.0\n[render]\nspp = 4\nmax_depth = 3\n\
         [environment]\nradiance = 1.0\n[[material]]\nname = 'red'\ncolor = [0.8, 0.2, 0.1]\n[[material]]\nname = 'glass'\n\
         type = 'dielectric'\ntransmission = {transmission:?}\n[[mesh]]\nshape = 'rectangle'\nmaterial = 'glass'\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'red'\ntransform = {{ translate = [0.0, 0.0, -1.0] }}\n"
    );
    let scene = Scene::parse(Path::new("glass.toml"), &text).unwrap();
    let (_, light, _) = apart(gpu, &scene);
    let seen = [0.8f32, 0.2, 0.1].map(|a| (0.04 + 0.96 * a) / 2.25);
    let expected: [f32; 3] = std::array::from_fn(|c| seen[c] * tint[c]);
    let near = |l: &PixelLight| (0..3).all(|c| (l.albedo[c] - expected[c]).abs() < 2e-3);
    // Of 4 samples all go astray in .04^4 of the pixels; some in 1 - .96^4 = .15 of them.
    let other: Vec<_> = light.iter().filter(|l| !near(l)).map(|l| l.albedo).collect();
    assert!(other.is_empty(), "{} of {} differ from {expected:?}: {:?}", other.len(), light.len(), other[0]);
}

/// The image of the walls in a smooth coat, 4 % and more of their light, would be an irradiance of 8 times that light over the
/// base's albedo of 0.005: the coat's share is part of the albedo.
#[test]
fn what_a_smooth_coat_mirrors_is_light_over_the_share_that_it_mirrors() {
    let gpu = support::gpu();
    let [(coated, light, guide), (plain, plain_light, _)] =
        [true, false].map(|coated| apart(&gpu, &black_floor(coated)));
    let floor = |of: &dyn Fn(usize) -> f32| {
        let seen: Vec<f64> = (0..guide.len())
            .filter(|&i| guide[i].material != NONE && guide[i].position[1].abs() < 1e-3)
            .map(|i| f64::from(of(i)))
            .collect();
        assert!(seen.len() > 50, "{} pixels show the floor", seen.len());
        seen.iter().sum::<f64>() / seen.len() as f64
    };
    let indirect =
        |stats: &[PixelStats], light: &[PixelLight], i: usize| Pixel { stats: stats[i], light: light[i] }.indirect()[1];
    let share = floor(&|i| indirect(&coated, &light, i)) / floor(&|i| indirect(&plain, &plain_light, i));
    // A coat mirrors the light of one direction, which differs from the mean over all by less than a magnitude.
    assert!((0.1..2.0).contains(&share), "irradiance under the coat is {share} of that without it");
    assert!((0.04..0.3).contains(&floor(&|i| light[i].albedo[1])));
    let bare = floor(&|i| plain_light[i].albedo[1]);
    assert!(bare < 0.5 * floor(&|i| light[i].albedo[1]), "control: {bare} without a coat, rims of walls included");
    // Keeping light apart changes no bit of the radiance.
    let scene = black_floor(true);
    let whole = support::render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap());
    assert!(bits(&whole) == bits(&coated));
    support::assert_silent(&gpu);
}

/// A cube on a floor below a sky and a lamp of these radiances and a point light of so many W/sr.
fn sky_lamp_and_point([sky, lamp, intensity]: [f32; 3], change: impl Fn(&mut Settings)) -> Loaded {
    let text = format!(
        "[camera]\nposition = [0.0, 2.0, 5.0]\ntarget = [0.0, 0.5, 0.0]\nfov = 45.0\n[film]\nwidth = 16\nheight = 16\n\
         [environment]\nradiance = {sky}\n\
         [render]\nspp = 1024\nmax_depth = 4\n[[light]]\ntype = 'point'\nposition = [2.0, 3.0, 1.0]\nintensity = {intensity}\n\
         [[material]]\nname = 'lamp'\ncolor = 0\nemission = {lamp}\n[[material]]\nname = 'grey'\ncolor = 0.6\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'grey'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 6.0 }}\n\
         [[mesh]]\nshape = 'cube'\nmaterial = 'grey'\ntransform = {{ scale = 0.5, translate = [0.0, 0.5, 0.0] }}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\ntransform = {{ rotate = [90.0, 0.0, 0.0], translate = [-1.0, 3.0, 0.0] }}\n"
    );
    Scene::parse(Path::new("sky.toml"), &text).map(|scene| scene.with(change)).unwrap()
}

#[test]
fn light_of_lamps_and_sky_is_kept_apart_from_that_of_point_lights() {
    let gpu = support::gpu();
    // The camera sees the lamp from behind, and what is above the floor in the upper rows alone.
    let sum_from = |first: usize, of: &dyn Fn(usize) -> f32| (first..256).map(of).map(f64::from).sum::<f64>();
    let (stats, light, _) = apart(&gpu, &sky_lamp_and_point([0.0, 5.0, 80.0], |_| ()));
    let alone = sky_lamp_and_point([0.0, 0.0, 80.0], |s| s.max_depth = 2);
    let expected = support::render(&gpu, &Renderer::new(&gpu, &alone, &alone.settings, Outputs::default()).unwrap());
    let floor = 16 * 7;
    let (direct, point) = (sum_from(floor, &|i| light[i].direct[1]), sum_from(floor, &|i| expected[i].mean[1]));
    assert!((direct / point - 1.0).abs() < 0.01, "direct light {direct}, the point light's {point}");
    // The floor's albedo, and the bits of the image do not depend on what is kept.
    let albedo = sum_from(floor, &|i| light[i].albedo[1]) / (256 - floor) as f64;
    assert!((albedo - 0.6).abs() < 1e-3, "{albedo}");
    let scene = sky_lamp_and_point([0.0, 5.0, 80.0], |_| ());
    let unsplit = support::render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap());
    assert!(bits(&unsplit) == bits(&stats));
    // Control: with indirect light alone apart, direct light is that of all lights.
    let (_, light, _) = apart(&gpu, &sky_lamp_and_point([0.0, 5.0, 80.0], |s| s.split = Split::Indirect));
    let all = sum_from(floor, &|i| light[i].direct[1]);
    assert!(all > 1.02 * point, "control: {all} of {point}");
    // So it is beside a sky, where part of the samples choose that; but of one that few choose a share goes with lamps and sky, or all.
    let beside_sky = |intensity: f32| {
        let scene = sky_lamp_and_point([0.5, 1.0, intensity], |_| ());
        let (stats, light, _) = apart(&gpu, &scene);
        let unsplit = support::render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap());
        assert!(bits(&unsplit) == bits(&stats), "{intensity}");
        let chosen = scene.lights.iter().find(|l| l.kind == LIGHT_POINT).unwrap().probability;
        (chosen, sum_from(floor, &|i| light[i].direct[1]))
    };
    let (chosen, direct) = beside_sky(80.0);
    assert!(chosen < 0.8 && (direct / point - 1.0).abs() < 0.01, "{chosen} {direct} {point}");
    let (chosen, direct) = beside_sky(0.1);
    let (kept, share) = (direct / point * 80.0 / 0.1, f64::from(chosen / KEY_PROBABILITY) - 1.0);
    assert!((0.05..0.5).contains(&share) && (kept / share - 1.0).abs() < 0.02, "{chosen}: {kept}, expected {share}");
    let (chosen, direct) = beside_sky(0.05);
    assert!(chosen < KEY_PROBABILITY && direct == 0.0, "{chosen} {direct}");
    support::assert_silent(&gpu);
}

/// A point light so near to a floor, below what pixel 2, 2 of 5 x 5 shows, that its irradiance is no number there: 1e30 W/sr
/// over (1e-5)^2.
fn too_bright(change: impl Fn(&mut Settings)) -> Loaded {
    let text = "[camera]\nposition = [0.0, 0.0, 2.0]\ntarget = [0.0, 0.0, 0.0]\nfov = 45.0\n\
                [film]\nwidth = 5\nheight = 5\n[render]\nspp = 4\nmax_depth = 2\n\
                [[light]]\ntype = 'point'\nposition = [0.0, 0.0, 1e-5]\nintensity = [1e30, 1e30, 1e30]\n\
                [[mesh]]\nshape = 'rectangle'\n";
    let centres = |s: &mut Settings| {
        s.filter = PixelFilter::Point;
        change(s);
    };
    Scene::parse(Path::new("too_bright.toml"), text).map(|scene| scene.with(centres)).unwrap()
}

#[test]
fn samples_that_are_no_numbers_are_black_and_told() {
    let gpu = support::gpu();
    for policy in ["uniform", "variance", "both"] {
        let scene =
            too_bright(|s| (s.allocate.policy, s.first_sample) = (tallow::allocate::policy(policy).unwrap(), 10));
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        let mut frame = FrameResources::new(&gpu).unwrap();
        Job::new(&renderer).run_to_end(&mut frame).unwrap();
        let (stats, broken) = (support::stats(&renderer), renderer.broken_samples().unwrap().unwrap());
        let expected = BrokenSamples { count: stats[12].count.into(), pixel: [2, 2], sample: 10, seed: 0 };
        assert_eq!(broken, expected, "{policy}");
        assert!(stats[12].count > 0 && stats[12].mean == [0.0; 3], "{policy}: {:?}", stats[12]);
        let (others, light) = ([&stats[..12], &stats[13..]].concat(), renderer.film().tiles[0].light.read().unwrap());
        assert!(others.iter().all(|s| s.mean[0] > 1e20 && s.mean[0].is_finite()), "control: {policy}");
        assert!(stats.iter().all(|s| s.m2.iter().all(|v| v.is_finite())), "{policy}");
        assert!(light.iter().all(|l| l.indirect_m2.is_finite()), "{policy}");
        // Whatever is in the film before, a start forgets it.
        renderer.run(&mut frame, &Step::Start).unwrap();
        assert_eq!(renderer.broken_samples().unwrap(), None);
    }
    support::assert_silent(&gpu);
}

/// So many triangles, each from one face of a cube to the opposite one and as thin as a hair: boxes around them tell rays little.
fn hair(count: usize) -> Loaded {
    let strand = |i: usize| {
        let mut random = Random::stream(i);
        let (mut root, mut tip) = (random.point(), random.point());
        (root[i % 3], tip[i % 3]) = (-1.0, 1.0);
        [root, root + 4e-4 * Vec3::AXES[(i + 1) % 3], tip]
    };
    Workplace::new().obj("hair.obj", &(0..count).map(strand).collect::<Vec<_>>()).scene(
        "[camera]\nposition = [0, 1.2, 4]\ntarget = [0, 0, 0]\nfov = 35\n[film]\nwidth = 8\nheight = 8\n\
         [render]\nspp = 1\nmax_depth = 4\n[environment]\nradiance = 1\n[[mesh]]\nfile = 'hair.obj'\nflat = true\n",
    )
}

/// llvmpipe of Mesa 22.3 ends the loops of paths whose rays meet tens of thousands of boxes and triangles. Their light is wrong then,
/// mostly too much: a shadow ray that is cut blocks nothing. That of 25.0 ends none, and has the picture of a wavefront, which leaves each
/// ray all that a driver gives to a path.
#[test]
fn paths_that_a_driver_ends_early_are_told() {
    let rendered = |scene: &Loaded, tuning: Tuning| {
        let gpu = support::tuned_gpu(tuning);
        let renderer = Renderer::new(&gpu, scene, &scene.settings, Outputs::default()).unwrap();
        Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
        support::assert_silent(&gpu);
        (support::stats(&renderer), renderer.broken_samples().unwrap().is_some_and(|broken| broken.count > 0))
    };
    let [short, hairy] = [2_000, 150_000].map(hair);
    for deals in [Tuning::CPU.deals, false] {
        let tuning = Tuning { deals, ..Tuning::CPU };
        assert!(!rendered(&short, tuning).1, "{tuning:?}");
        let (stats, told) = rendered(&hairy, tuning);
        let whole = || bits(&stats) == bits(&rendered(&hairy, Tuning { wavefront: true, deals: false, ..tuning }).0);
        assert!(told || whole(), "{tuning:?}");
        assert!(stats.iter().all(|s| s.count == 1 && s.mean.iter().all(|v| v.is_finite())));
        assert!(stats.iter().any(|s| s.mean[0] > 0.0), "what was found until then counts");
    }
}

/// Whatever batches the work is cut into, it is the first of the lowest pixel that is told.
#[test]
fn the_first_broken_sample_does_not_depend_on_batches() {
    let gpu = support::gpu();
    let scene = too_bright(|_| {});
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    let batch = |first_pixel, pixels, first_sample, samples| Batch { first_pixel, pixels, first_sample, samples };
    let cuts = [
        vec![batch(0, 25, 0, 4)],
        (0..4).map(|k| batch(0, 25, k, 1)).collect(),
        (0..25).rev().map(|pixel| batch(pixel, 1, 0, 4)).collect(),
    ];
    for cut in cuts {
        renderer.run(&mut frame, &Step::Start).unwrap();
        cut.iter().for_each(|&batch| drop(renderer.run(&mut frame, &Step::Uniform(batch)).unwrap()));
        let expected = BrokenSamples { count: 4, pixel: [2, 2], sample: 0, seed: 0 };
        assert_eq!(renderer.broken_samples().unwrap(), Some(expected), "{cut:?}");
    }
}

/// A closed box that emits E = 1 everywhere and reflects rho = 0.5: after d edges the radiance is
/// E (1 + rho + ... + rho^(d - 1)) = E (1 - rho^d) / (1 - rho).
#[test]
fn a_closed_box_holds_the_geometric_series() {
    for depth in 1..=6 {
        let expected = (1.0 - 0.5f64.powi(depth as i32)) / 0.5;
        for (mean, error) in furnace("furnace/box.toml", depth, 64) {
            println!("depth {depth}: {mean:.5} +- {error:.5}, expected {expected:.5}");
            assert!((mean - expected).abs() <= 4.0 * error + 1e-4 * expected, "depth {depth}: {mean}, not {expected}");
        }
    }
}

#[test]
fn filters_and_samplers_agree_on_the_mean() {
    let gpu = support::gpu();
    let render = |filter: PixelFilter, sampler: Sampler| {
        let scene = scene("cornell-box/scene.toml", |s| {
            (s.width, s.height, s.spp, s.max_depth, s.filter, s.sampler) = (64, 64, 64, 3, filter, sampler);
        });
        mean(&support::render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap()))
    };
    let reference = render(PixelFilter::Box, Sampler::Sobol);
    let independent = render(PixelFilter::Box, Sampler::Independent);
    for ((a, _), (b, error)) in reference.iter().zip(&independent) {
        // Sobol's own error is far below what its samples' variance says.
        assert!((a - b).abs() < 4.0 * error, "sampler: {a} {b} +- {error}");
    }
    for filter in [PixelFilter::Tent, PixelFilter::Gaussian] {
        for ((a, _), (b, error)) in reference.iter().zip(&render(filter, Sampler::Sobol)) {
            // The filters look past the film's border, which here is black on all sides.
            assert!((a - b).abs() < 0.03 * a + 4.0 * error, "{filter:?}: {a} {b}");
        }
    }
    support::assert_silent(&gpu);
}
