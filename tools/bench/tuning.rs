//! Times the choices of `gpu::Tuning` on a device: each alone, in turn with what suits devices of its kind, whose time is 1.
//!   cargo run --release --example bench-tuning -- [--rounds N] [--width N] [--height N] [--spp N] [--only WHAT] SCENE...
#![allow(missing_docs)]
use anyhow::{Context, Result};
use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use tallow::denoise::filter::{FILTERS, FilterSettings, firefly::Fireflies};
use tallow::denoise::{Demodulation, Denoiser};
use tallow::gpu::{DeviceOptions, FrameResources, Gpu, Tuning, total_ms};
use tallow::profile::{median, wake};
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer, traces_paths};
use tallow::scene::{Loaded, Scene};

#[derive(Parser)]
struct Args {
    /// Scenes, at their own settings but for the film's size and the samples
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// How often each is timed
    #[arg(long, default_value_t = 7)]
    rounds: usize,
    #[arg(long, default_value_t = 640)]
    width: u32,
    #[arg(long, default_value_t = 360)]
    height: u32,
    /// Samples per pixel
    #[arg(long, default_value_t = 16)]
    spp: u32,
    /// Time the choices of these alone
    #[arg(long)]
    only: Option<What>,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum What {
    Paths,
    Placing,
    Filters,
}

/// Filters whose kernels [`Tuning::filter_workgroup`] or [`Tuning::windows`] is for.
const TIMED: [&str; 6] = ["atrous", "svgf", "wavelet", "bilateral", "guided", "auto"];

/// Passes that place samples and depend on [`Tuning::interleaves`].
const PLACING: [&str; 5] = ["quantise_priority", "lack", "quota", "radix_select", "reduce"];

/// A choice by its name, on a device that was opened for it.
type Choice = (String, Gpu);

/// What runs some passes, and returns their GPU time in milliseconds.
type Run = Box<dyn FnMut() -> Result<f64>>;

/// Choices that paths depend on. Where triangles are dealt, few rays have a limit of them a step.
fn of_paths(own: Tuning) -> Vec<(String, Tuning)> {
    let dealt = |name: &str| if own.deals { format!("{name}, not dealt") } else { name.to_owned() };
    let alone = Tuning { deals: false, ..own };
    let (native_bits, wavefront) = (!own.native_bits, !own.wavefront);
    let mut all = vec![("own".to_owned(), own), (format!("native_bits {native_bits}"), Tuning { native_bits, ..own })];
    if own.deals {
        all.push(("deals false".to_owned(), alone));
    }
    for triangles_a_step in [0, 1, 2, 4] {
        let name = dealt(&format!("triangles_a_step {triangles_a_step}"));
        all.push((name, Tuning { triangles_a_step, ..alone }));
    }
    all.extend([32, 64, 128].map(|n| (format!("workgroup {n}"), Tuning { workgroup: n, ..own })));
    for triangles_a_step in [0, 2] {
        let name = format!("wavefront {wavefront}, triangles_a_step {triangles_a_step}");
        all.push((name, Tuning { wavefront, triangles_a_step, ..own }));
    }
    differing(all)
}

/// Choices that the placing of samples depends on.
fn of_placing(own: Tuning) -> Vec<(String, Tuning)> {
    let items = |interleaves: bool| {
        let name = move |n: u32| format!("thread_items {n}{}", if interleaves { ", interleaved" } else { "" });
        [4, 16, 64].map(|thread_items| (name(thread_items), Tuning { thread_items, interleaves, ..own }))
    };
    differing([("own".to_owned(), own)].into_iter().chain(items(false)).chain(items(true)).collect())
}

/// Choices that filters depend on.
fn of_filters(own: Tuning) -> Vec<(String, Tuning)> {
    let mut all = vec![("own".to_owned(), own)];
    all.extend([32, 64, 128, 256].map(|n| (format!("filter_workgroup {n}"), Tuning { filter_workgroup: n, ..own })));
    all.extend([0, 1, 2, 3, 4].map(|n| (format!("windows {n}"), Tuning { windows: n, ..own })));
    differing(all)
}

/// The first, and those that differ from it.
fn differing(all: Vec<(String, Tuning)>) -> Vec<(String, Tuning)> {
    let own = all[0].1;
    all.into_iter().enumerate().filter(|(i, (_, tuning))| *i == 0 || *tuning != own).map(|(_, choice)| choice).collect()
}

fn open(tuning: Option<Tuning>) -> Result<Gpu> {
    let device = std::env::var("TALLOW_DEVICE").ok();
    Ok(Gpu::open(&DeviceOptions { device, tuning, ..DeviceOptions::default() })?)
}

fn choices(all: Vec<(String, Tuning)>) -> Result<Vec<Choice>> {
    all.into_iter().map(|(name, tuning)| Ok((name, open(Some(tuning))?))).collect()
}

fn paths(gpu: &Gpu, scene: &Loaded) -> Result<Run> {
    let renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::default())?;
    let mut frame = FrameResources::new(gpu)?;
    Ok(Box::new(move || {
        let times = Job::new(&renderer).run_to_end(&mut frame)?.times;
        Ok(total_ms(times.iter().filter(|pass| traces_paths(pass.name))))
    }))
}

/// What order-free passes take of a render that places its samples by noise and geometry.
fn placing(gpu: &Gpu, scene: &Loaded) -> Result<Run> {
    let mut settings = scene.settings.clone();
    settings.allocate.policy = tallow::allocate::policy("both").context("no such policy")?;
    let renderer = Renderer::new(gpu, scene, &settings, Outputs::FILTERED)?;
    let mut frame = FrameResources::new(gpu)?;
    Ok(Box::new(move || {
        let times = Job::new(&renderer).run_to_end(&mut frame)?.times;
        Ok(total_ms(times.iter().filter(|pass| PLACING.contains(&pass.name))))
    }))
}

fn filter(gpu: &Gpu, scene: &Loaded, name: &str) -> Result<Run> {
    let renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::FILTERED)?;
    let mut frame = FrameResources::new(gpu)?;
    Job::new(&renderer).run_to_end(&mut frame)?;
    let row = FILTERS.iter().find(|row| row.name == name).context("no such filter")?;
    let denoiser = Denoiser::new(gpu, &renderer, row, &FilterSettings::default(), Demodulation::Light, Fireflies::Off)?;
    let gpu = gpu.clone();
    Ok(Box::new(move || Ok(total_ms(&gpu.run(&mut frame, |rec| denoiser.record(rec))?))))
}

/// Prints the median time of each choice, and its ratio to the first's, or why a device refuses it.
fn compare(what: &str, choices: &[Choice], rounds: usize, run: impl Fn(&Gpu) -> Result<Run>) -> Result<()> {
    if choices.is_empty() {
        return Ok(());
    }
    let warm = |mut run: Run| run().map(|_| run); // drivers may compile more on the first dispatch
    let mut runs: Vec<_> = choices.iter().map(|(_, gpu)| run(gpu).and_then(warm)).collect();
    let mut times = vec![Vec::new(); runs.len()];
    for _ in 0..rounds {
        wake(&choices[0].1)?;
        for (run, times) in runs.iter_mut().zip(&mut times) {
            if let Ok(run) = run {
                times.push(run()?);
            }
        }
    }
    println!("{what}, median of {rounds}:");
    for (((name, _), run), taken) in choices.iter().zip(&runs).zip(&times) {
        match run {
            Ok(_) => {
                let ms = median(taken);
                println!("  {name:64} {ms:10.3} ms {:7.3}", ms / median(&times[0]));
            }
            Err(why) => println!("  {name:64} {why}"),
        }
    }
    Ok(())
}

fn main() -> Result<()> {
    let Args { scenes, rounds, width, height, spp, only } = Args::parse();
    let device = open(None)?;
    println!("{}", device.info().name);
    let own = *device.tuning();
    let of = |what, all: Vec<_>| choices(if only.is_none_or(|only| only == what) { all } else { Vec::new() });
    let (for_paths, for_placing) = (of(What::Paths, of_paths(own))?, of(What::Placing, of_placing(own))?);
    let for_filters = of(What::Filters, of_filters(own))?;
    let small = |s: &mut Settings| (s.width, s.height, s.spp) = (width, height, spp);
    for file in scenes {
        let scene = Scene::load(&file)?.with(small);
        println!("{}, {width} x {height}, {spp} samples", file.display());
        compare("paths", &for_paths, rounds, |gpu| paths(gpu, &scene))?;
        compare("placing", &for_placing, rounds, |gpu| placing(gpu, &scene))?;
        for name in TIMED {
            compare(name, &for_filters, rounds, |gpu| filter(gpu, &scene, name))?;
        }
    }
    Ok(())
}
