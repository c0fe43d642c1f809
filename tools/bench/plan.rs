//! Measures how well `--time` and `--error` are kept: renders what is planned for several times and errors, with several seeds, and
//! prints GPU time over the time that was given, and true relMSE over the error that was asked for.
//!   cargo run --release --example bench-plan -- [--reference-spp N] [--runs N] SCENE...
#![allow(missing_docs)]
use anyhow::{Context, Result};
use clap::Parser;
use std::path::PathBuf;
use tallow::denoise::{Filtered, Noisy, Recipe};
use tallow::gpu::{DeviceOptions, FrameResources, Gpu, total_ms};
use tallow::image::{Picture, metrics};
use tallow::plan::{Plan, Target, plan, usual_methods};
use tallow::profile::median;
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::{Loaded, Scene};

#[derive(Parser)]
struct Args {
    /// Scenes, at their own settings but for the size
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Film size
    #[arg(long, default_value_t = 256)]
    width: u32,
    #[arg(long, default_value_t = 192)]
    height: u32,
    /// GPU times in milliseconds
    #[arg(long, value_delimiter = ',', default_values_t = [500.0, 2000.0])]
    times: Vec<f64>,
    /// Values of relMSE
    #[arg(long, value_delimiter = ',', default_values_t = [0.05, 0.01])]
    errors: Vec<f64>,
    /// Allocation policy
    #[arg(long, default_value = "uniform")]
    allocate: String,
    /// Seeds
    #[arg(long, default_value_t = 10)]
    runs: u32,
    #[arg(long, default_value_t = 1024)]
    reference_spp: u32,
}

/// GPU milliseconds and image of a planned render, as the command line makes it.
fn rendered(gpu: &Gpu, scene: &Loaded, plan: &Plan) -> Result<(f64, Picture)> {
    let method = plan.method()?;
    let renderer = Renderer::new(gpu, scene, &plan.settings, Outputs::for_filter(method.is_some()))?;
    let mut times = Job::new(&renderer).run_to_end(&mut FrameResources::new(gpu)?)?.times;
    let mut picture = renderer.picture()?;
    if let Some(method) = method {
        let clean = Filtered::new(gpu, Noisy::of_film(&renderer)?, &Recipe::new(method))?.join(gpu)?;
        times.extend(clean.times);
        picture = Picture::of_planes(picture.size(), &clean.colour);
    }
    Ok((total_ms(&times), picture))
}

fn line(what: &str, plans: &[Plan], ratios: &[f64], limits: [f64; 2]) {
    let told = |plan: &Plan, ratio: f64| match plan.target {
        Target::RelMse(error) => ratio * error / plan.chosen.relmse,
        Target::GpuMs(ms) => ratio * ms / plan.chosen.gpu_ms,
    };
    let told: Vec<f64> = plans.iter().zip(ratios).map(|(plan, &ratio)| told(plan, ratio)).collect();
    let within = |limit: f64| ratios.iter().filter(|r| (1.0 / limit..=limit).contains(*r)).count();
    let [near, far] = limits.map(within);
    let spp: Vec<_> = plans.iter().map(|p| p.chosen.spp.to_string()).collect();
    let filtered = plans.iter().filter(|p| p.chosen.denoise.is_some()).count();
    let all: Vec<_> = ratios.iter().map(|r| format!("{r:.2}")).collect();
    println!(
        "  {what}: median {:.3} (of what was told {:.3}), {near} of {} within {}, {far} within {}; filtered {filtered}; spp {}; ratios {}",
        median(ratios),
        median(&told),
        ratios.len(),
        limits[0],
        limits[1],
        spp.join(" "),
        all.join(" ")
    );
}

fn main() -> Result<()> {
    let args = Args::parse();
    let gpu = Gpu::open(&DeviceOptions::default())?;
    println!("device: {}, {}", gpu.info().name, gpu.info().driver_info);
    for path in &args.scenes {
        let policy = tallow::allocate::policy(&args.allocate).context("no policy of this name")?;
        let size = |s: &mut Settings| (s.width, s.height, s.allocate.policy) = (args.width, args.height, policy);
        let scene = Scene::load(path).with_context(|| path.display().to_string())?.with(size);
        println!("{}, {}x{}", path.display(), args.width, args.height);
        for &ms in &args.times {
            measure(&gpu, &scene, args.runs, Target::GpuMs(ms), None)?;
        }
        if args.errors.is_empty() {
            continue;
        }
        let reference = reference(&gpu, &scene, args.reference_spp)?;
        for &error in &args.errors {
            measure(&gpu, &scene, args.runs, Target::RelMse(error), Some(&reference))?;
        }
    }
    Ok(())
}

fn reference(gpu: &Gpu, scene: &Loaded, spp: u32) -> Result<Picture> {
    let mut settings = Settings { spp, seed: 99_991, ..scene.settings.clone() };
    settings.allocate.policy = &tallow::allocate::uniform::ROW;
    let renderer = Renderer::new(gpu, scene, &settings, Outputs::default())?;
    Job::new(&renderer).run_to_end(&mut FrameResources::new(gpu)?)?;
    Ok(renderer.picture()?)
}

fn measure(gpu: &Gpu, scene: &Loaded, runs: u32, target: Target, reference: Option<&Picture>) -> Result<()> {
    let (mut plans, mut ratios) = (Vec::new(), Vec::new());
    for run in 0..runs {
        let settings = Settings { seed: 10 * run, ..scene.settings.clone() };
        let planned = plan(gpu, scene, &settings, Outputs::default(), &usual_methods(), target)?;
        let (ms, picture) = rendered(gpu, scene, &planned)?;
        ratios.push(match (target, reference) {
            (Target::RelMse(error), Some(reference)) => metrics::relmse(&picture, reference) / error,
            (Target::GpuMs(given), _) => ms / given,
            (Target::RelMse(_), None) => f64::NAN,
        });
        plans.push(planned);
    }
    match target {
        Target::GpuMs(ms) => line(&format!("{ms} ms"), &plans, &ratios, [1.1, 1.2]),
        Target::RelMse(error) => line(&format!("relMSE {error}"), &plans, &ratios, [1.5, 2.0]),
    }
    Ok(())
}
