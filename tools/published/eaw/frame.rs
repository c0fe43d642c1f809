//! The parts of a frame's time, beside EAW's table 1. (There, À-Trous ran on an NVIDIA GTX 285, rays were traced on an Intel Core 2
//! Duo E6850, and guides were drawn by a GPU.)
use super::VIEWS;
use crate::Args;
use crate::published::view::View;
use crate::published::{Section, push};
use tallow::denoise::filter::{self, FilterSettings, firefly::Fireflies};
use tallow::denoise::{Demodulation, Denoiser};
use tallow::gpu::{FrameResources, Gpu, PassTime};
use tallow::render::{Outputs, Renderer};
use tallow::report::html::Table;

/// Number of frames to average over, as in the paper, after a first one in which drivers compile.
const FRAMES: usize = 16;
/// The paper's resolution, which software devices render in time too.
const SIZE: [u32; 2] = [512, 512];

/// Times of tracing, drawing the guides, uploading and filtering.
type Milliseconds = [f64; 4];

/// Of each scene, the paper's milliseconds and frames per second.
const PUBLISHED: [(Milliseconds, f64); 4] = [
    ([307.6, 2.9, 5.8, 5.6], 3.2),
    ([835.2, 35.5, 4.4, 5.6], 1.13),
    ([510.2, 8.5, 5.2, 5.6], 1.9),
    ([316.4, 2.6, 6.3, 5.6], 3.0),
];

/// # Errors
/// When a scene cannot be found, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let mut section = Section::new(
        "EAW, table 1: where the time of a frame goes",
        &[
            "512x512, one path per pixel, one indirect bounce, 5 levels, 3 weights: milliseconds of the device, means of 16 frames, \
           ours / published for a scene of that kind. The paper traced rays on a processor of two cores, drew guides and filtered \
           on a GTX 285; demodulation and remodulation stand where it uploads.",
        ],
    );
    let mut table = Table::new("", &["scene", "paths", "guides", "demodulation", "À-Trous", "frames a second"]);
    for ((view, theirs), (published, rate)) in VIEWS.iter().zip(PUBLISHED) {
        let ours = one(gpu, args, view)?;
        let cells = ours.iter().zip(published).map(|(ours, theirs)| format!("{ours:.2} / {theirs:.1}"));
        let rate = format!("{:.2} / {rate:.2}", 1e3 / ours.iter().sum::<f64>());
        push(&mut table, [format!("{} ({theirs})", view.name)].into_iter().chain(cells).chain([rate]));
    }
    section.tables.push(table);
    Ok(section)
}

fn one(gpu: &Gpu, args: &Args, view: &View) -> anyhow::Result<Milliseconds> {
    let scene = view.load(args, |s| ([s.width, s.height], s.spp) = (SIZE, 1))?;
    let renderer = Renderer::new(gpu, &scene, &scene.settings, Outputs::FILTERED)?;
    let row = filter::find("atrous").expect("a row of the table");
    let denoiser = Denoiser::new(gpu, &renderer, row, &FilterSettings::default(), Demodulation::Light, Fireflies::Off)?;
    let mut frame = FrameResources::new(gpu)?;
    let mut sums = Milliseconds::default();
    for i in 0..=FRAMES {
        let passes = gpu.run(&mut frame, |rec| {
            renderer.steps().try_for_each(|step| renderer.record(rec, &step))?;
            denoiser.record(rec)
        })?;
        if i > 0 {
            passes.iter().for_each(|pass| sums[column(pass)] += pass.duration_ms() / FRAMES as f64);
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
