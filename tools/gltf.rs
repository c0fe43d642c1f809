//! Renders every glTF model of the outside data in the light and view of the published pictures of path tracers, writes a
//! sheet with all of them side by side, and prints how far ours are from the nearest of those, and those from each other.
use anyhow::Context;
use clap::Parser;
use std::path::{Path, PathBuf};
use tallow::gpu::{DeviceOptions, FrameResources, Gpu};
use tallow::image::Picture;
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
    /// Samples per pixel of a picture that is four times as large, and is shrunk as it is shown
    #[arg(long, default_value_t = 32)]
    spp: u32,
    /// Device, by index or part of its name
    #[arg(long)]
    device: Option<String>,
}

/// The others' pictures are several times as large as those that are compared, and are shrunk as displays show them, which makes small
/// black letters on white darker than shrinking their light would: ours are rendered so many times as wide.
const DETAIL: u32 = 4;

/// A model with all pictures of it, ours first.
struct Row {
    name: String,
    pictures: Vec<(String, Shown)>,
    /// Which pixels are compared. Where a model covers a part of one, ours show the sky beside it, and the others nothing.
    compared: Vec<bool>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let goldens = args.data.join("scenes/gltf-samples/goldens");
    let scenarios = scenario::read(&goldens.join("scenarios.json"))?;
    println!("| model | ours from the nearest | of | they from each other | |\n|---|---|---|---|---|");
    let mut rows = Vec::new();
    for path in models(&args.data.join("scenes"))? {
        let name = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        if !args.names.is_empty() && !args.names.iter().any(|part| name.contains(part.as_str())) {
            continue;
        }
        let scenario = scenarios.get(&name).cloned().unwrap_or_default();
        let ours = render(&gpu, &path, &scenario, &args).with_context(|| name.clone())?;
        let others = golden::read(&goldens.join(&name), [ours.width, ours.height].map(|n| n / DETAIL))?;
        let pictures = shown(&ours, others, &scenario);
        let covered = |pixel: usize| pictures.iter().all(|(_, shown)| shown.alpha[pixel] > WHOLE);
        let compared = (0..pictures[0].1.pixels.len()).map(|pixel| scenario.sky || covered(pixel)).collect();
        let row = Row { name, pictures, compared };
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

fn render(gpu: &Gpu, path: &Path, scenario: &Scenario, args: &Args) -> anyhow::Result<Picture> {
    let mut file = SceneFile::open(path)?;
    let description = file.description_mut();
    let sky = args.data.join("scenes/gltf-samples/goldens/environment/lightroom_14b_1k.hdr");
    // Turned so that its first column lies along -x, as the pictures' README says.
    description.environment = Some(EnvironmentTable { file: Some(sky), rotation: 90.0, ..Default::default() });
    description.camera = scenario.camera.clone().unwrap_or_else(|| description.camera.clone());
    let loaded = file.load()?.with(|settings| {
        let height = (f64::from(args.width) / scenario.aspect).round().max(1.0) as u32;
        (settings.width, settings.height) = (DETAIL * args.width, DETAIL * height);
        settings.spp = args.spp;
    });
    loaded.warnings.iter().for_each(|line| eprintln!("{}: {line}", path.display()));
    let renderer = Renderer::new(gpu, &loaded, &loaded.settings, Outputs::default())?;
    let job = Job::new(&renderer);
    let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
    job.film(&status)?.picture(None).map_err(|what| anyhow::anyhow!(what))
}

/// All pictures of a model. Ours are cut out as the others are, since they show no sky.
fn shown(ours: &Picture, others: Vec<(String, Shown)>, scenario: &Scenario) -> Vec<(String, Shown)> {
    let mut ours = Shown::of(ours).smaller(DETAIL);
    if let (Some((_, first)), false) = (others.first(), scenario.sky) {
        ours.cut_out(&first.alpha);
    }
    std::iter::once(("tallow".to_owned(), ours)).chain(others).collect()
}

/// The environment map that there is.
const LIGHTING: &str = "lightroom_14b.hdr";

/// Least alpha of a pixel that shows nothing but the model.
const WHOLE: f32 = 0.995;

/// A line of the table: root mean square differences of display values in [0, 1].
fn verdict(row: &Row, scenario: &Scenario) -> String {
    let (ours, others) = row.pictures.split_first().expect("ours is the first");
    if !others.is_empty() && scenario.lighting != LIGHTING {
        return format!("| {} | | | | lit by {}, which is not here |", row.name, scenario.lighting);
    }
    let from_ours = others.iter().map(|(name, other)| (ours.1.difference(other, &row.compared), name));
    let Some((nearest, engine)) = from_ours.min_by(|a, b| a.0.total_cmp(&b.0)) else {
        return format!("| {} | | | | no picture to compare with |", row.name);
    };
    let pairs = others
        .iter()
        .enumerate()
        .flat_map(|(i, (_, a))| others[..i].iter().map(move |(_, b)| a.difference(b, &row.compared)));
    let spread = pairs.fold(0.0, f64::max);
    let word = match others.len() {
        1 => "only one",
        _ if nearest <= spread => "within",
        _ => "beyond",
    };
    format!("| {} | {nearest:.4} | {engine} | {spread:.4} | {word} |", row.name)
}
