//! Renders every glTF model of the outside data in the light and view of the published pictures of path tracers, writes a
//! sheet with all of them side by side, and prints how far ours are from the nearest of those, and those from each other.
use anyhow::Context;
use clap::Parser;
use std::path::{Path, PathBuf};
use tallow::gpu::{DeviceOptions, FrameResources, Gpu};
use tallow::image::Samples;
use tallow::layout::NONE;
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::SceneFile;
use tallow::scene::description::EnvironmentTable;

#[path = "gltf/display.rs"]
mod display;
#[path = "gltf/golden.rs"]
mod golden;
#[path = "gltf/letters.rs"]
mod letters;
#[path = "gltf/scenario.rs"]
mod scenario;
#[path = "gltf/sheet.rs"]
mod sheet;

use display::Shown;
use scenario::Scenario;

#[derive(Parser)]
#[command(about = "Renders all glTF models beside the pictures of other path tracers")]
struct Args {
    /// Models, by parts of their names; all when nothing is named
    names: Vec<String>,
    /// The sheet to write
    #[arg(short, long, default_value = "out/gltf.png")]
    output: PathBuf,
    /// Folder of the outside data
    #[arg(long, env = "TALLOW_DATA")]
    data: PathBuf,
    /// Width of each picture in pixels
    #[arg(long, default_value_t = 128)]
    width: u32,
    /// How many times as wide ours are rendered, before they are shrunk as displays show them. The others' pictures were 1024 pixels
    /// wide and more, and shrinking what is shown makes small black letters on white darker than shrinking their light
    #[arg(long, default_value_t = 8)]
    detail: u32,
    /// Samples per pixel of the large picture
    #[arg(long, default_value_t = 16)]
    spp: u32,
    /// Device, by index or part of its name
    #[arg(long)]
    device: Option<String>,
}

/// A model with all pictures of it, ours first.
struct Row {
    name: String,
    pictures: Vec<(String, Shown)>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    sheet::check(&args.output)?;
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let goldens = args.data.join("scenes/gltf-samples/goldens");
    let scenarios = scenario::read(&goldens.join("scenarios.json"))?;
    println!(
        "| model | ours from the nearest | of | they from each other | | covered otherwise |\n|---|---|---|---|---|---|"
    );
    let mut rows = Vec::new();
    for path in models(&args.data.join("scenes"))? {
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        if !args.names.is_empty() && !args.names.iter().any(|part| name.contains(part.as_str())) {
            continue;
        }
        let scenario = scenarios.get(&name).cloned().unwrap_or_default();
        let ours = render(&gpu, &path, &scenario, &args).with_context(|| name.clone())?;
        let others = golden::read(&goldens.join(&name), ours.size)?;
        let row = Row { name, pictures: std::iter::once(("tallow".to_owned(), ours)).chain(others).collect() };
        println!("{}", verdict(&row, &scenario));
        rows.push(row);
    }
    sheet::write(&args.output, args.width, &rows)?;
    println!("\n{}: of each model ours, then the others", args.output.display());
    Ok(())
}

/// All files of models; of one that is there in several forms, one of those that the published pictures show.
fn models(scenes: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let (mut found, mut open) = (Vec::new(), vec![scenes.join("gltf"), scenes.join("gltf-samples")]);
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let path = entry?.path();
            let is_model = path.extension().is_some_and(|e| e == "gltf" || e == "glb");
            if path.is_dir() {
                open.push(path)
            } else if is_model {
                found.push(path)
            }
        }
    }
    found.sort_by_key(|path| (path.file_stem().map(ToOwned::to_owned), std::cmp::Reverse(path.clone())));
    found.dedup_by_key(|path| path.file_stem().map(ToOwned::to_owned));
    Ok(found)
}

fn render(gpu: &Gpu, path: &Path, scenario: &Scenario, args: &Args) -> anyhow::Result<Shown> {
    let mut file = SceneFile::open(path)?;
    let description = file.description_mut();
    let sky = args.data.join("scenes/gltf-samples/goldens/environment/lightroom_14b_1k.hdr");
    // Turned so that its first column lies along -x, as the pictures' README says.
    description.environment = Some(EnvironmentTable { file: Some(sky), rotation: 90.0, ..Default::default() });
    description.camera = scenario.camera.clone().unwrap_or_else(|| description.camera.clone());
    let loaded = file.load()?.with(|settings| {
        (settings.width, settings.height) = size(args.width, scenario.aspect).map(|n| args.detail * n).into();
        settings.spp = args.spp;
    });
    loaded.warnings.iter().for_each(|line| eprintln!("{}: {line}", path.display()));
    let renderer = Renderer::new(gpu, &loaded, &loaded.settings, Outputs { guides: true, ..Outputs::default() })?;
    let job = Job::new(&renderer);
    let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
    let film = job.film(&status)?;
    let mut ours = Shown::of(&film.picture(None).map_err(|what| anyhow::anyhow!(what))?);
    if !scenario.sky {
        let Some(Samples::U32(objects)) = film.channel("id") else { anyhow::bail!("no channel id") };
        ours.cut_out(objects.iter().map(|&object| if object == NONE { 0.0 } else { 1.0 }).collect());
    }
    Ok(ours.smaller(args.detail))
}

/// Whole pixels of a shape, as wide as may be: a picture of another shape would show more or less at its sides.
fn size(most: u32, aspect: f64) -> [u32; 2] {
    let height = |width: u32| f64::from(width) / aspect;
    let hundredths = |width: &u32| (100.0 * (height(*width) - height(*width).round()).abs()).round() as u32;
    let best = (most - most / 4..=most).rev().min_by_key(hundredths).unwrap_or(most);
    [best, (height(best).round() as u32).max(1)]
}

/// The environment map that there is.
const LIGHTING: &str = "lightroom_14b.hdr";

/// A line of the table: root mean square differences of display values in [0, 1] where both show the model, and the share of
/// the pixels of either in which one shows it and the other does not.
fn verdict(row: &Row, scenario: &Scenario) -> String {
    let ((_, ours), others) = row.pictures.split_first().expect("ours is the first");
    let name = &row.name;
    if !others.is_empty() && scenario.lighting != LIGHTING {
        return format!("| {name} | | | | lit by {}, which is not here | |", scenario.lighting);
    }
    let (others, empty): (Vec<_>, Vec<_>) = others.iter().partition(|(_, other)| other.alpha.iter().any(|&a| a > 0.0));
    let empty: String = empty.iter().map(|(engine, _)| format!("; {engine} shows nothing")).collect();
    let nearest = others.iter().map(|(engine, other)| (ours.difference(other), engine, ours.covered_otherwise(other)));
    let Some((nearest, engine, otherwise)) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return format!("| {name} | | | | no picture to compare with{empty} | |");
    };
    let pairs = others.iter().enumerate().flat_map(|(i, (_, a))| others[..i].iter().map(move |(_, b)| a.difference(b)));
    let (spread, word) = match pairs.reduce(f64::max) {
        None => (String::new(), "only one"),
        Some(spread) if nearest <= spread => (format!("{spread:.4}"), "within"),
        Some(spread) => (format!("{spread:.4}"), "beyond"),
    };
    format!("| {name} | {nearest:.4} | {engine} | {spread} | {word}{empty} | {:.1} % |", 100.0 * otherwise)
}
