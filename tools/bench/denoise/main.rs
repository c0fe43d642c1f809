//! Measures what `tallow render --denoise` makes of real scenes at the defaults, beside Open Image Denoise where it is installed:
//! errors against converged images, times, and pictures side by side.
//!   cargo run --release --example bench-denoise -- --data ../shared [-o FOLDER] [SCENE...]
#![allow(missing_docs)]
use anyhow::{Context, Result, bail};
use clap::Parser;
use std::path::PathBuf;
use tallow::denoise::filter::{self, Method, OidnQuality};
use tallow::gpu::{DeviceOptions, Gpu, Oidn};

mod contest;
mod reference;
mod results;
#[path = "../../scenes/mod.rs"]
mod scenes;
mod strip;
mod view;

use contest::Contender;
use results::Results;
use view::{VIEWS, View};

#[derive(Parser)]
#[command(about = "Compares filters at their defaults with converged images and with Open Image Denoise")]
struct Args {
    /// Scenes to measure; all when none is named
    scenes: Vec<String>,
    /// Folder for pictures, for references and for a file of all figures
    #[arg(short, long, default_value = "out/denoise")]
    output: PathBuf,
    /// Folder of converged images NAME.exr, which are rendered where they are missing [default: a folder of the output]
    #[arg(long)]
    references: Option<PathBuf>,
    /// Samples per pixel of references that are missing
    #[arg(long, default_value_t = 1024)]
    reference_spp: u32,
    /// Folder of the outside data; without it, only scenes of the repository are measured
    #[arg(long, env = "TALLOW_DATA")]
    data: Option<PathBuf>,
    /// Samples per pixel of the noisy images
    #[arg(long, value_delimiter = ',', default_values_t = [2, 4, 8, 16, 32, 64])]
    spp: Vec<u32>,
    /// Filters to measure beside Open Image Denoise
    #[arg(long, value_delimiter = ',', default_value = "auto")]
    filters: Vec<String>,
    /// Runs of every filter behind a first one; the time shown is the median of theirs
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    runs: u32,
    /// Device, by index or part of its name
    #[arg(long)]
    device: Option<String>,
}

impl Args {
    fn views(&self) -> Result<Vec<&'static View>> {
        if let Some(unknown) = self.scenes.iter().find(|name| VIEWS.iter().all(|view| view.name != name.as_str())) {
            let known: Vec<_> = VIEWS.iter().map(|view| view.name).collect();
            bail!("no scene is called {unknown}: choose of {}", known.join(", "));
        }
        let wanted = |view: &&View| self.scenes.is_empty() || self.scenes.iter().any(|name| name == view.name);
        Ok(VIEWS.iter().filter(wanted).filter(|view| self.data.is_some() || view.is_of_repository()).collect())
    }

    /// The filters that are named, then Open Image Denoise.
    fn contenders(&self) -> Result<Vec<Contender>> {
        let of = |name: &String| {
            let row = filter::find(name).with_context(|| format!("no filter is called {name}"))?;
            Ok(Contender { name: name.clone(), method: row.into(), quality: OidnQuality::default() })
        };
        let mut all = self.filters.iter().map(of).collect::<Result<Vec<_>>>()?;
        match Oidn::open() {
            Ok(oidn) => {
                println!("Open Image Denoise {}, on the processor", oidn.version());
                let of =
                    |(name, quality): (&str, _)| Contender { name: name.to_owned(), method: Method::Oidn, quality };
                all.extend([("OIDN Fast", OidnQuality::Fast), ("OIDN High", OidnQuality::High)].map(of));
            }
            Err(missing) => println!("Open Image Denoise is left out. {missing}"),
        }
        Ok(all)
    }
}

fn main() -> Result<()> {
    let args = Args::parse();
    let views = args.views()?;
    std::fs::create_dir_all(&args.output).with_context(|| format!("{}", args.output.display()))?;
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let info = gpu.info();
    println!("device: {}, {} {}", info.name, info.driver_name, info.driver_info);
    let contenders = args.contenders()?;
    println!("{}\n", results::LEGEND);
    let mut results = Results::default();
    for view in views {
        let rows = contest::of_view(&gpu, &args, view, &contenders)?;
        println!("{}", results::table(view, &rows, &contenders));
        results.rows.extend(rows);
        results.write(&contenders, &args.output.join("figures.csv"))?;
    }
    println!("{}", results.summary(&contenders));
    Ok(())
}
