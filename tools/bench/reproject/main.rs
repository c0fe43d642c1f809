//! Measures what it is worth to carry samples from frame to frame.
//!   cargo run --release --example bench-reproject -- turn scenes/cornell-box/scene.toml --degrees 20
//!   cargo run --release --example bench-reproject -- frames sponza.toml
//! Both print tables; `--plot` writes what they show as .svg.
#![allow(missing_docs)]
mod film;
mod frames;
mod plot;
mod reference;
mod seen;
mod turn;

use anyhow::Result;
use clap::{Parser, Subcommand};
use std::path::PathBuf;
use tallow::gpu::{DeviceOptions, Gpu};
use tallow::render::History;
use tallow::scene::{Loaded, Scene};

#[derive(Parser)]
struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// The experiment of Schalk 2018: the camera turns by 100 degrees in steps, then rests; error against time after the last step
    Turn(turn::Args),
    /// Frames of a camera that moves, and of what the scene animates: error and flicker of each, and how they look
    Frames(frames::Args),
}

#[derive(clap::Args)]
struct View {
    /// Scene file
    scene: PathBuf,
    #[arg(long, default_value_t = 128)]
    width: u32,
    #[arg(long, default_value_t = 128)]
    height: u32,
    #[arg(long, default_value_t = 4)]
    max_depth: u32,
    /// Samples a pixel of reference images
    #[arg(long, default_value_t = 512)]
    reference_spp: u32,
    /// File of the plot
    #[arg(long)]
    plot: Option<PathBuf>,
}

impl View {
    fn load(&self) -> Result<Loaded> {
        let size = |s: &mut tallow::render::settings::Settings| {
            (s.width, s.height, s.max_depth) = (self.width, self.height, self.max_depth);
        };
        Ok(Scene::load(&self.scene)?.with(size))
    }

    fn tell(&self, gpu: &Gpu) {
        let info = gpu.info();
        let (w, h) = (self.width, self.height);
        println!("{}, {w} x {h}, {} ({} {})", self.scene.display(), info.name, info.driver_name, info.driver_info);
        let bytes = [false, true].map(History::bytes_per_pixel);
        println!("history: {} bytes a pixel, {} with direct and indirect light apart", bytes[0], bytes[1]);
    }
}

fn main() -> Result<()> {
    let args = Args::parse();
    let gpu = Gpu::open(&DeviceOptions::default())?;
    match &args.command {
        Command::Turn(args) => turn::run(&gpu, args),
        Command::Frames(args) => frames::run(&gpu, args),
    }
}
