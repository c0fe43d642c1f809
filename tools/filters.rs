//! Measures every filter, writes the pictures, and prints the tables of the papers with our figures beside the published
//! ones. The script `tools/filters` builds what this needs and runs it.
use anyhow::Context;
use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use tallow::gpu::{DeviceOptions, Gpu};

mod measure;
mod scenes;
mod view;

use measure::{breakdown, energy, lookup, neural, ranking, textures, times};

/// The tables and sets of pictures that can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// Times beside those of EAW's tables 1 and 2 and GIF's table 2.
    Times,
    /// Errors on the bust, the dragon and Sibenik beside GIF's, and a sheet of pictures per scene.
    Ranking,
    /// How much light À-Trous keeps, by form.
    Energy,
    /// The Cornell box against Open Image Denoise.
    Neural,
    /// Sponza's textures with and without demodulation.
    Textures,
    /// GIF's supersampling: filtered light looked up along eye rays.
    Lookup,
}

#[derive(Parser)]
#[command(about = "Measures the filters and writes tables and pictures")]
struct Args {
    /// What to measure; everything when nothing is named
    #[arg(value_enum)]
    parts: Vec<Part>,
    /// Folder for renders and pictures; renders that it holds are used again
    #[arg(short, long, default_value = "out/filters")]
    output: PathBuf,
    /// Folder of the outside data
    #[arg(long, env = "TALLOW_DATA")]
    data: PathBuf,
    /// Folder of the peers that the data's peers/setup.sh installs; without it, Open Image Denoise is left out
    #[arg(long)]
    peers: Option<PathBuf>,
    /// The program that renders
    #[arg(long)]
    tallow: PathBuf,
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
            Part::Times => {
                breakdown::print(&gpu, &args)?;
                times::print(&gpu)?;
            }
            Part::Ranking => ranking::print(&gpu, &args)?,
            Part::Energy => energy::print(&gpu, &args)?,
            Part::Neural => neural::print(&gpu, &args)?,
            Part::Textures => textures::print(&gpu, &args)?,
            Part::Lookup => lookup::print(&gpu, &args)?,
        }
    }
    Ok(())
}
