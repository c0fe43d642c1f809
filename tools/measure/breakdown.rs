//! Measures the parts of a frame's time, beside EAW's table 1. (There, À-Trous ran on an NVIDIA GTX 285, rays were traced on
//! an Intel Core 2 Duo E6850, and guides were drawn by a GPU.)
use super::frames::View;
use crate::Args;
use tallow::denoise::filter::{self, FilterSettings};
use tallow::denoise::{Demodulation, Denoiser};
use tallow::gpu::{FrameResources, Gpu, PassTime};
use tallow::render::{Outputs, Renderer};
use tallow::report::table;
use tallow::scene::Scene;

/// Number of frames to average over, as in the paper, after a first one in which drivers compile.
const FRAMES: usize = 16;

/// Times of tracing, drawing the guides, uploading and filtering.
type Milliseconds = [f64; 4];

/// Our view, the paper's scene, and its milliseconds and frames per second.
const VIEWS: &[(View, &str, Milliseconds, f64)] = &[
    (view("cornell", "scenes/cornell-box/scene.toml"), "Box", [307.6, 2.9, 5.8, 5.6], 3.2),
    (view("sponza", "crytek-sponza"), "Sponza", [835.2, 35.5, 4.4, 5.6], 1.13),
    (view("sibenik-lamps", "sibenik-lamps"), "Sibenik", [510.2, 8.5, 5.2, 5.6], 1.9),
    (view("grass", "scenes/grass/scene.toml"), "Outdoor", [316.4, 2.6, 6.3, 5.6], 3.0),
];

/// A view with one path per pixel and one indirect bounce.
const fn view(name: &'static str, scene: &'static str) -> View {
    View { name, scene, size: [512, 512], depth: 3, reference: 1 }
}

/// # Errors
/// When a scene cannot be found, or the device fails.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    println!("EAW, table 1, 512x512, one path per pixel, one indirect bounce, À-Trous with 5 levels and 3 weights:");
    println!("milliseconds of the device, means of {FRAMES} frames, ours / published for a scene of that kind;");
    println!("demodulation and remodulation stand where the paper uploads\n");
    let mut rows = Vec::new();
    for (view, theirs, published, rate) in VIEWS {
        let ours = one(gpu, args, view)?;
        let mut row = vec![format!("{} ({theirs})", view.name)];
        row.extend(ours.iter().zip(published).map(|(ours, theirs)| format!("{ours:.2} / {theirs:.1}")));
        row.push(format!("{:.2} / {rate:.2}", 1e3 / ours.iter().sum::<f64>()));
        rows.push(row);
    }
    println!("{}", table::text(&["scene", "paths", "guides", "demodulation", "À-Trous", "frames a second"], &rows));
    Ok(())
}

fn one(gpu: &Gpu, args: &Args, view: &View) -> anyhow::Result<Milliseconds> {
    let scene = Scene::load(&view.scene_file(&args.data, &args.output)?).map(|scene| {
        scene.with(|s| {
            [s.width, s.height] = view.size;
            (s.max_depth, s.spp) = (view.depth, 1);
        })
    })?;
    let outputs = Outputs { guides: true, split_light: true, counters: false };
    let renderer = Renderer::new(gpu, &scene, &scene.settings, outputs)?;
    let row = filter::find("atrous").expect("a row of the table");
    let denoiser = Denoiser::new(gpu, &renderer, row, &FilterSettings::default(), Demodulation::Light)?;
    let mut frame = FrameResources::new(gpu)?;
    let mut sums = Milliseconds::default();
    for i in 0..=FRAMES {
        let passes = gpu.run(&mut frame, |rec| {
            renderer.steps().try_for_each(|step| renderer.record(rec, &step))?;
            denoiser.record(rec)
        })?;
        if i > 0 {
            passes.iter().for_each(|pass| sums[column(pass)] += pass.duration_ns() as f64 * 1e-6 / FRAMES as f64);
        }
    }
    Ok(sums)
}

fn column(pass: &PassTime) -> usize {
    match pass.name {
        "primary_hit" => 1,
        "demodulate" | "remodulate" => 2,
        "pack" | "atrous" => 3,
        _ => 0,
    }
}
