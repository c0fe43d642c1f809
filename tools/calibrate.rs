//! Measures how often `tallow compare --statistical` errs on renders that are the same, and what it finds of small changes.
use anyhow::Context;
use clap::{Parser, ValueEnum};
use std::path::Path;
use tallow::gpu::{DeviceOptions, FrameResources, Gpu};
use tallow::image::significance::{Estimate, Options, Outcome, Verdict, test};
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::{Loaded, Scene, SceneFile};

/// The tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// False alarms of renders with as many samples everywhere.
    Same,
    /// False alarms beside placed samples.
    Placed,
    /// How often a change of 1 % is found.
    Changes,
}

#[derive(Parser)]
#[command(about = "Calibrates the test whether two renders have the same expectation")]
struct Args {
    /// What to measure; everything when nothing is named
    #[arg(value_enum)]
    parts: Vec<Part>,
    /// Renders of each scene and number of samples
    #[arg(long, default_value_t = 24)]
    seeds: u32,
    /// Edge of the images in pixels
    #[arg(long, default_value_t = 64)]
    edge: u32,
    /// Device, by index or part of its name
    #[arg(long)]
    device: Option<String>,
}

/// Scenes whose renders are compared with each other.
const SCENES: [&str; 4] =
    ["cornell-box/scene.toml", "cornell-box/glass.toml", "veach-mis/scene.toml", "grass/scene.toml"];

/// Numbers of samples of both images.
const SAMPLES: [[u32; 2]; 4] = [[4, 4], [16, 16], [16, 64], [16, 256]];

/// Materials of the Cornell box, and their colours in its file.
const COLOURS: [(&str, &str); 3] =
    [("red wall", "0.65, 0.05, 0.05"), ("green wall", "0.12, 0.45, 0.15"), ("white", "0.73, 0.73, 0.73")];

/// Rates of false alarms that are asked for.
const RATES: [f64; 2] = [0.01, 0.05];

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let info = gpu.info();
    println!("device: {}, {} {}\n", info.name, info.driver_name, info.driver_info);
    let all = Part::value_variants().to_vec();
    for part in if args.parts.is_empty() { all } else { args.parts.clone() } {
        match part {
            Part::Same => same(&gpu, &args)?,
            Part::Placed => placed(&gpu, &args)?,
            Part::Changes => changes(&gpu, &args)?,
        }
        println!();
    }
    Ok(())
}

fn heading() {
    println!("{:<24} {:>9} {:>6} {:>14} {:>14}", "the same", "samples", "pairs", "at 1 %", "at 5 %");
}

fn same(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    heading();
    for scene in SCENES {
        for samples in SAMPLES {
            false_alarms(gpu, args, scene, samples)?;
        }
    }
    Ok(())
}

/// A scene of the repository.
fn load(name: &str, args: &Args, change: &dyn Fn(&mut Settings)) -> anyhow::Result<Loaded> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name);
    let small = |s: &mut Settings| {
        (s.width, s.height) = (args.edge, args.edge);
        change(s);
    };
    Ok(Scene::load(&path).with_context(|| name.to_owned())?.with(small))
}

fn render(gpu: &Gpu, scene: &Loaded) -> anyhow::Result<Estimate> {
    let outputs = Outputs { guides: true, ..Outputs::default() };
    let renderer = Renderer::new(gpu, scene, &scene.settings, outputs)?;
    let job = Job::new(&renderer);
    let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
    Estimate::of_film(&job.film(&status)?).map_err(anyhow::Error::msg)
}

/// Renders that differ in their seeds alone.
fn seeds(gpu: &Gpu, args: &Args, scene: &str, first: u32, spp: u32, policy: &str) -> anyhow::Result<Vec<Estimate>> {
    let of = |seed| {
        let scene = load(scene, args, &|s| {
            (s.spp, s.seed) = (spp, seed);
            s.allocate.policy = tallow::allocate::policy(policy).expect("a policy");
        })?;
        render(gpu, &scene)
    };
    (first..first + args.seeds).map(of).collect()
}

fn false_alarms(gpu: &Gpu, args: &Args, scene: &str, [a, b]: [u32; 2]) -> anyhow::Result<()> {
    let (a_images, b_images) =
        (seeds(gpu, args, scene, 0, a, "uniform")?, seeds(gpu, args, scene, 1000, b, "uniform")?);
    row(scene, &format!("{a} and {b}"), &a_images, &b_images)
}

/// Samples that were placed by what earlier ones showed have a bias of their own.
fn placed(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    heading();
    for scene in SCENES {
        let (a, b) = (seeds(gpu, args, scene, 0, 64, "uniform")?, seeds(gpu, args, scene, 1000, 64, "both")?);
        row(scene, "64, both", &a, &b)?;
    }
    Ok(())
}

/// All pairs of a first and a second image; they share images, so that their errors do as well.
fn row(scene: &str, samples: &str, a: &[Estimate], b: &[Estimate]) -> anyhow::Result<()> {
    let mut counts = Vec::new();
    for false_alarms in RATES {
        let mut different = 0;
        for a in a {
            for b in b {
                different += usize::from(verdict(a, b, false_alarms)?.verdict == Verdict::Different);
            }
        }
        counts.push(format!("{different} ({:.1} %)", 100.0 * different as f64 / (a.len() * b.len()) as f64));
    }
    println!("{scene:<24} {samples:>9} {:>6} {:>14} {:>14}", a.len() * b.len(), counts[0], counts[1]);
    Ok(())
}

fn verdict(a: &Estimate, b: &Estimate, false_alarms: f64) -> anyhow::Result<Outcome> {
    test(a, b, &Options { false_alarms, ..Options::default() }).map_err(anyhow::Error::msg)
}

/// How often a change of 1 % of one colour of the Cornell box is found, at a rate of false alarms of 1 %.
fn changes(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    println!("{:<24} {:>9} {:>6} {:>14} {:>14}", "1 % brighter", "samples", "pairs", "found", "too noisy");
    for spp in [16, 32, 64, 128, 256] {
        let originals = seeds(gpu, args, "cornell-box/scene.toml", 0, spp, "uniform")?;
        for (name, colour) in COLOURS {
            let (mut found, mut open) = (0, 0);
            for (seed, original) in (1000..).zip(&originals) {
                let changed = render(gpu, &changed(colour, args, spp, seed)?)?;
                let verdict = verdict(&changed, original, RATES[0])?.verdict;
                found += u32::from(verdict == Verdict::Different);
                open += u32::from(matches!(verdict, Verdict::TooNoisy { .. }));
            }
            println!("{name:<24} {spp:>9} {:>6} {found:>14} {open:>14}", args.seeds);
        }
    }
    Ok(())
}

/// The Cornell box with one colour brighter by 1 %.
fn changed(colour: &str, args: &Args, spp: u32, seed: u32) -> anyhow::Result<Loaded> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box");
    let brighter = |v: &str| Ok::<_, std::num::ParseFloatError>(format!("{}", 1.01 * v.parse::<f64>()?));
    let brighter = colour.split(", ").map(brighter).collect::<Result<Vec<_>, _>>()?.join(", ");
    let text = std::fs::read_to_string(folder.join("scene.toml"))?.replace(colour, &brighter);
    let text = text.replace("file = \"", &format!("file = \"{}/", folder.display()));
    let file = tempfile::Builder::new().suffix(".toml").tempfile()?;
    std::fs::write(file.path(), text)?;
    let loaded = SceneFile::open(file.path())?.load()?;
    Ok(loaded.with(|s| (s.width, s.height, s.spp, s.seed) = (args.edge, args.edge, spp, seed)))
}
