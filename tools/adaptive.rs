//! Measures the cost and the benefit of adaptive sampling, and prints the tables of the papers with our figures beside the
//! published ones. The script `tools/adaptive` builds what this needs and runs it.
use anyhow::Context;
use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use tallow::gpu::{DeviceOptions, Gpu};

mod placed;
mod scenes;
mod view;

use placed::{geometry, overhead, policies, spread};

/// The tables that can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// GEO's tables 1 and 2: what importance and placing cost.
    Overhead,
    /// GEO's result: errors of uniform and placed samples, filtered and not.
    Geometry,
    /// RAS's result: the spread of errors against time.
    Spread,
    /// Every policy on five scenes.
    Policies,
}

#[derive(Parser)]
#[command(about = "Measures what placing samples costs and gains")]
struct Args {
    /// What to measure; everything when nothing is named
    #[arg(value_enum)]
    parts: Vec<Part>,
    /// Folder for references and plots; references that it holds are used again
    #[arg(short, long, default_value = "out/adaptive")]
    output: PathBuf,
    /// Folder of the outside data
    #[arg(long, env = "TALLOW_DATA")]
    data: PathBuf,
    /// Device, by index or part of its name
    #[arg(long)]
    device: Option<String>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    std::fs::create_dir_all(&args.output).with_context(|| format!("{}", args.output.display()))?;
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let info = gpu.info();
    println!("device: {}, {} {}\n", info.name, info.driver_name, info.driver_info);
    let all = Part::value_variants().to_vec();
    for part in if args.parts.is_empty() { all } else { args.parts.clone() } {
        match part {
            Part::Overhead => overhead::print(&gpu, &args)?,
            Part::Geometry => geometry::print(&gpu, &args)?,
            Part::Spread => spread::print(&gpu, &args)?,
            Part::Policies => policies::print(&gpu, &args)?,
        }
    }
    Ok(())
}
