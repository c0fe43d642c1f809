//! Characters and a machine that move on a ground: whether hierarchies, filters and samples follow.
use anyhow::{Context, Result, anyhow};
use std::path::Path;
use std::time::Instant;
use tallow::allocate::policy;
use tallow::denoise::filter::Method;
use tallow::denoise::{Filtered, Noisy, Recipe};
use tallow::gpu::{FrameResources, Gpu, total_ms};
use tallow::image::{Film, Picture, Samples, metrics};
use tallow::layout::NONE;
use tallow::profile::median;
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer, traces_paths};
use tallow::report::table;
use tallow::scene::{Loaded, Scene};

/// The engine with its keys, behind the last `[[mesh]]` of its scene.
const ENGINE: &str = include_str!("../../scenes/two-cylinder-engine.toml");

/// A name, and the tables of a scene file whose paths are relative to the data's `scenes` folder.
const SUBJECTS: [(&str, &str); 3] = [
    ("fox, joints", "[[mesh]]\nname = 'it'\nfile = 'gltf/Fox/Fox.glb'\nclip = 'Run'\n"),
    (
        "fox, file per pose",
        "[[mesh]]\nname = 'it'\nfile = 'animation/fox_run/fox_00.obj'\n\
         [[animation]]\nmesh = 'it'\nfile = 'animation/fox_run/fox_##.obj'\nlast = 15\nrepeat = true\n",
    ),
    ("engine, turning", ENGINE),
];

/// Samples of a frame, and of what it is compared with.
const SPP: u32 = 4;
const REFERENCE_SPP: u32 = 256;
/// Time between frames in seconds.
const STEP: f64 = 1.0 / 12.0;

/// Prints what becomes of every subject.
pub fn report(gpu: &Gpu, data: &Path, frames: u32) -> Result<()> {
    let (mut trees, mut pictures) = (Vec::new(), Vec::new());
    for (name, tables) in SUBJECTS {
        let tables = &tables[tables.rfind("[[mesh]]").context("a mesh")?..];
        let scene = on_ground(&data.join("scenes/moving.toml"), tables).context(name)?;
        trees.push(hierarchies(gpu, name, &scene, frames)?);
        pictures.push(pictures_of(gpu, name, &scene, frames)?);
    }
    println!("Refit against rebuild, 320 x 200, 1 sample per pixel, medians of {frames} frames");
    let head = ["scene", "triangles", "pose refitted", "built anew", "Mray/s refitted", "built anew", "cost"];
    println!("{}", table::text(&head, &trees));
    println!("pose: milliseconds of the host; cost: the largest of a refitted hierarchy over that when it was built\n");
    println!("Filter and samples, 160 x 100, {SPP} samples per pixel, means of relMSE over {frames} frames");
    let head =
        ["scene", "uniform", "placed", "of uniform", "guided", "of placed", "last frame's", "on it", "on the ground"];
    println!("{}", table::text(&head, &pictures));
    println!(
        "placed: by the policy `both`; guided: those, filtered; of uniform, of placed: in the best and the worst frame"
    );
    println!("last frame's: the filtered picture of the frame before, in this one's place");
    println!("on it, on the ground: placed samples per pixel; the sky has the rest");
    Ok(())
}

/// The subject on a ground, seen from the side and above.
fn on_ground(path: &Path, tables: &str) -> Result<Loaded> {
    let alone = Scene::parse(path, tables)?;
    let [low, high] = alone.bounds.map(|b| glam::Vec3::from(b).as_dvec3());
    let (middle, size) = ((low + high) / 2.0, (high - low).length());
    let eye = middle + glam::DVec3::new(0.7, 0.35, 0.8).normalize() * (1.5 * size);
    let text = format!(
        "[camera]\nposition = {:?}\ntarget = {:?}\nfov = 40\n[environment]\nradiance = 1\n\
         [[material]]\nname = 'ground'\ncolor = 0.4\n[[mesh]]\nname = 'ground'\nshape = 'rectangle'\nmaterial = 'ground'\n\
         transform = {{ scale = {size}, rotate = [-90, 0, 0], translate = {:?} }}\n{tables}",
        eye.to_array(),
        middle.to_array(),
        [middle.x, low.y, middle.z],
    );
    Ok(Scene::parse(path, &text)?)
}

fn film(scene: &Loaded, [width, height]: [u32; 2], spp: u32) -> Settings {
    Settings { width, height, spp, max_depth: 6, ..scene.settings.clone() }
}

/// Moves a copy of the scene through the frames; `seen` gets it after each, with the milliseconds of the move and the cost of the worst
/// refitted hierarchy.
fn play(
    loaded: &Loaded,
    frames: u32,
    rebuild_above: f32,
    mut seen: impl FnMut(&Scene, &tallow::scene::Change, f64) -> Result<()>,
) -> Result<f32> {
    let (mut scene, mut worst) = (loaded.scene.clone(), 1.0f32);
    for number in 0..frames {
        let mut pose = loaded.animation.at(f64::from(number) * STEP)?;
        pose.rebuild_above = rebuild_above;
        let begun = Instant::now();
        let change = scene.apply(&pose)?;
        let ms = begun.elapsed().as_secs_f64() * 1e3;
        worst = change.deformed.iter().map(|d| d.cost).fold(worst, f32::max);
        seen(&scene, &change, ms)?;
    }
    Ok(worst)
}

fn hierarchies(gpu: &Gpu, name: &str, loaded: &Loaded, frames: u32) -> Result<Vec<String>> {
    let settings = film(loaded, [320, 200], 1);
    let mut found = Vec::new();
    let mut cost = 1.0;
    for rebuild_above in [f32::INFINITY, 0.0] {
        let outputs = Outputs { counters: true, ..Outputs::default() };
        let mut renderer = Renderer::new(gpu, loaded, &settings, outputs)?;
        let (mut frame, mut poses, mut speeds) = (FrameResources::new(gpu)?, Vec::new(), Vec::new());
        let worst = play(loaded, frames + 1, rebuild_above, |scene, change, ms| {
            gpu.run(&mut frame, |rec| renderer.update(rec, scene, change))?;
            let mut path_ms = 0.0;
            for step in renderer.steps() {
                let times = renderer.run(&mut frame, &step)?;
                path_ms += total_ms(times.iter().filter(|t| traces_paths(t.name)));
            }
            poses.push(ms);
            speeds.push(renderer.counters()?.rays() as f64 * 1e-3 / path_ms);
            Ok(())
        })?;
        cost = worst.max(cost);
        // The first frame compiles kernels.
        found.push([median(&poses[1..]), median(&speeds[1..])]);
    }
    let [refitted, built] = [found[0], found[1]];
    let triangles = loaded.triangles.len().to_string();
    let ms = [refitted[0], built[0]].map(|v| format!("{v:.2}"));
    let speed = [refitted[1], built[1]].map(|v| format!("{v:.2}"));
    Ok([vec![name.to_owned(), triangles], ms.to_vec(), speed.to_vec(), vec![format!("{cost:.2}")]].concat())
}

fn pictures_of(gpu: &Gpu, name: &str, loaded: &Loaded, frames: u32) -> Result<Vec<String>> {
    let size = [160, 100];
    let ground = loaded.names.objects.iter().position(|n| n == "ground").context("the ground")? as u32;
    let (mut errors, mut samples, mut last) = ([const { Vec::new() }; 4], [const { Vec::new() }; 2], None);
    play(loaded, frames, f32::INFINITY, |scene, _, _| {
        let reference = picture(gpu, scene, &Settings { seed: 1, ..film(loaded, size, REFERENCE_SPP) })?.0;
        let error = |picture: &Picture| metrics::compare(picture, &reference).relmse;
        errors[0].push(error(&picture(gpu, scene, &film(loaded, size, SPP))?.0));
        let mut settings = film(loaded, size, SPP);
        settings.allocate.policy = policy("both").context("a policy of that name")?;
        let (noisy, film, filtered) = picture(gpu, scene, &settings)?;
        errors[1].push(error(&noisy));
        errors[2].push(error(&filtered));
        errors[3].extend(last.replace(filtered).map(|last| error(&last)));
        let [on_it, on_ground] = samples_on(&film, ground)?;
        samples[0].push(on_it);
        samples[1].push(on_ground);
        Ok(())
    })?;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let [uniform, placed, guided, last] = &errors;
    let [e_uniform, e_placed, e_guided, e_last] = [uniform, placed, guided, last].map(|e| format!("{:.4}", mean(e)));
    let [on_it, on_ground] = samples.map(|s| format!("{:.2}", mean(&s)));
    let (of_uniform, of_placed) = (ratios(placed, uniform), ratios(guided, placed));
    Ok(vec![name.to_owned(), e_uniform, e_placed, of_uniform, e_guided, of_placed, e_last, on_it, on_ground])
}

/// The smallest and the largest ratio of two errors of a frame.
fn ratios(of: &[f64], to: &[f64]) -> String {
    let all = || of.iter().zip(to).map(|(a, b)| a / b);
    format!("{:.2} to {:.2}", all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max))
}

/// The noisy picture, its film, and what the guided filter makes of it.
fn picture(gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<(Picture, Film, Picture)> {
    let renderer = Renderer::new(gpu, scene, settings, Outputs::FILTERED)?;
    let job = Job::new(&renderer);
    let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
    let film = job.film(&status)?;
    let noisy = film.picture(None).map_err(|what| anyhow!(what))?;
    let method = Method::all().find(|method| method.name() == "guided").context("a filter of that name")?;
    let clean = Filtered::new(gpu, Noisy::of_film(&renderer)?, &Recipe::new(method))?.join(gpu)?;
    let filtered = Picture::of_planes(noisy.size(), &clean.colour);
    Ok((noisy, film, filtered))
}

/// Samples per pixel on the subject and on the ground.
fn samples_on(film: &Film, ground: u32) -> Result<[f64; 2]> {
    let words = |name| match film.channel(name) {
        Some(Samples::U32(words)) => Ok(words),
        _ => Err(anyhow!("no channel {name}")),
    };
    let (ids, counts) = (words("id")?, words("samples")?);
    let mean = |of: &dyn Fn(u32) -> bool| {
        let found: Vec<u32> = ids.iter().zip(counts).filter(|(id, _)| of(**id)).map(|(_, n)| *n).collect();
        found.iter().map(|&n| f64::from(n)).sum::<f64>() / found.len().max(1) as f64
    };
    Ok([mean(&|id| id != ground && id != NONE), mean(&|id| id == ground)])
}
