//! Measures what the four papers published, on our scenes, and writes one report with our figures beside theirs: as text, and as
//! a page with the pictures. The script `tools/papers` builds what this needs and runs it.
use anyhow::Context;
use clap::{Parser, ValueEnum};
use std::path::PathBuf;
use tallow::gpu::{DeviceOptions, Gpu};
use tallow::profile::Host;
use tallow::report::html::Page;

mod published;
mod scenes;

use published::{Section, eaw, filter_times, geo, gif_lookup, not_reproduced, policies, ranking, ras_spread, textures};

/// The parts of the report. The last two are ours alone and are measured only when they are named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Part {
    /// EAW's table 1: where the time of a frame goes.
    EawFrame,
    /// EAW's figures 10 and 12: errors of the filters behind one path per pixel.
    EawErrors,
    /// EAW's figure 9: light traced for some pixels only.
    EawStride,
    /// How much light EAW's filter keeps.
    EawEnergy,
    /// EAW's table 2 and GIF's table 2: times of the filters.
    FilterTimes,
    /// GEO's tables 1 and 2: times of importance and placing.
    GeoTimes,
    /// GEO's errors of uniform and placed samples, filtered and not.
    GeoErrors,
    /// GIF's errors of three filters.
    GifErrors,
    /// GIF's supersampling.
    GifLookup,
    /// RAS's spread of errors against time.
    RasSpread,
    /// Every policy on five scenes.
    Policies,
    /// Sponza's textures with and without demodulation.
    Textures,
}

#[derive(Parser)]
#[command(about = "Measures what the papers published, and writes one report")]
struct Args {
    /// What to measure; what was published when nothing is named
    #[arg(value_enum)]
    parts: Vec<Part>,
    /// Folder for renders and the report; renders that it holds of the same commit, program and scene file are used again
    #[arg(short, long, default_value = "out/papers")]
    output: PathBuf,
    /// Render in the papers' sizes, for graphics cards; else in sizes that take a software device minutes
    #[arg(long)]
    full: bool,
    /// Folder of the outside data
    #[arg(long, env = "TALLOW_DATA")]
    data: PathBuf,
    /// The program that renders
    #[arg(long)]
    tallow: PathBuf,
    /// Commit that the program was built from
    #[arg(long, default_value = "unknown")]
    commit: String,
    /// Device, by index or part of its name
    #[arg(long)]
    device: Option<String>,
}

impl Part {
    fn is_published(self) -> bool {
        !matches!(self, Self::Policies | Self::Textures)
    }

    fn measure(self, gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
        match self {
            Self::EawFrame => eaw::frame(gpu, args),
            Self::EawErrors => ranking::eaw(gpu, args),
            Self::EawStride => eaw::stride(gpu, args),
            Self::EawEnergy => eaw::energy(gpu, args),
            Self::FilterTimes => filter_times::measure(gpu),
            Self::GeoTimes => geo::times(gpu, args),
            Self::GeoErrors => geo::errors(gpu, args),
            Self::GifErrors => ranking::gif(gpu, args),
            Self::GifLookup => gif_lookup::measure(gpu, args),
            Self::RasSpread => ras_spread::measure(gpu, args),
            Self::Policies => policies::measure(gpu, args),
            Self::Textures => textures::measure(gpu, args),
        }
    }
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    std::fs::create_dir_all(&args.output).with_context(|| args.output.display().to_string())?;
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let facts = facts(&gpu, &args);
    facts.iter().for_each(|(name, value)| println!("- {name}: {value}"));
    println!();
    let published = Part::value_variants().iter().copied().filter(|part| part.is_published());
    let parts = if args.parts.is_empty() { published.collect() } else { args.parts.clone() };
    let mut sections = Vec::new();
    for part in &parts {
        let section = part.measure(&gpu, &args).with_context(|| format!("{part:?}"))?;
        println!("{}", section.text());
        sections.push(section);
    }
    if args.parts.is_empty() {
        sections.push(not_reproduced());
        println!("{}", sections[sections.len() - 1].text());
    }
    let title = "The published tables again".to_owned();
    let page = Page { title, facts, sections: sections.iter().map(Section::html).collect() };
    let file = args.output.join("papers.html");
    std::fs::write(&file, page.html()).with_context(|| file.display().to_string())?;
    eprintln!("written: {}", file.display());
    Ok(())
}

fn facts(gpu: &Gpu, args: &Args) -> Vec<(String, String)> {
    let Host { device, driver, cpu } = Host::of(gpu);
    let sizes = if args.full { "the papers'" } else { "reduced" };
    let facts = [
        ("device", device),
        ("driver", driver),
        ("processor", cpu),
        ("commit", args.commit.clone()),
        ("sizes", sizes.to_owned()),
    ];
    facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}
