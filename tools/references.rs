//! Renders every scene that has an independent reference with the `tallow` program, compares, prints a table, and writes
//! the differences. Exit code 1 when a row fails. `tools/references` builds what this needs and runs it.
use anyhow::{Context, bail, ensure};
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

mod compare;
mod scenes;
mod visibility;

use Reference::{Constant, Mean, Normals, Visibility};

/// What a render is compared with. Paths are below the data's folder.
#[derive(Clone, Copy)]
enum Reference {
    /// An image; each channel's mean and the structure of the difference are judged.
    Mean(&'static str),
    /// Every pixel has this value, by derivation.
    Constant(f32),
    /// An image of the absolute values of the shading normal.
    Normals(&'static str),
    /// An image of the average visibility within so many world units.
    Visibility(&'static str, f32),
}

/// One line of the table.
struct Row {
    /// A name known to the converter, or a scene file of the repository.
    scene: &'static str,
    /// Path edges, where they are not those of the scene file. Square renders of 128 pixels go with it.
    depth: Option<u32>,
    spp: u32,
    /// Both images are this many times smaller each way than the reference file: for scenes of long paths.
    reduce: usize,
    reference: Reference,
    /// Relative; structure may be three times as large.
    tolerance: f64,
}

const fn row(scene: &'static str, spp: u32, reference: Reference, tolerance: f64) -> Row {
    Row { scene, depth: None, spp, reduce: 1, reference, tolerance }
}

const fn cornell(scene: &'static str, depth: u32, reference: &'static str) -> Row {
    Row { depth: Some(depth), ..row(scene, 1024, Mean(reference), 5e-3) }
}

const CORNELL: &str = "scenes/cornell-box/scene.toml";
const CONDUCTOR: &str = "scenes/cornell-box/conductor.toml";
const POINT: &str = "scenes/cornell-box/point.toml";

/// 2 % where the reference is itself noisy: few samples, or small lights in nearly smooth surfaces.
const ROWS: &[Row] = &[
    cornell(CORNELL, 2, "references/ref_diffuse_d2.exr"),
    cornell(CORNELL, 3, "references/ref_diffuse_d3.exr"),
    cornell(CORNELL, 4, "references/ref_diffuse_d4.exr"),
    cornell(CONDUCTOR, 2, "references/ref_conductor_d2.exr"),
    cornell(CONDUCTOR, 3, "references/ref_conductor_d3.exr"),
    cornell(CONDUCTOR, 4, "references/ref_conductor_d4.exr"),
    cornell(POINT, 2, "references/ref_point_d2.exr"),
    cornell(POINT, 3, "references/ref_point_d3.exr"),
    cornell(POINT, 4, "references/ref_point_d4.exr"),
    row("cornell-box-ignis", 256, Mean("scenes/cornell-box/ignis/ref-cbox-d6-4096.exr"), 0.01),
    row("bitterli-cornell-box", 64, Mean("scenes/bitterli-cornell-box/TungstenRender.exr"), 0.01),
    row("bitterli-veach-mis", 64, Mean("scenes/bitterli-veach-mis/TungstenRender.exr"), 0.02),
    Row { reduce: 4, ..row("nori-table", 1024, Mean("scenes/nori-table/table_path_mis_512spp.exr"), 0.01) },
    row("bunny-normals", 16, Normals("scenes/nori-bunny-normals/bunny_normals_ref.exr"), 0.01),
    row("dabrovic-direct", 16, Mean("scenes/dabrovic-sponza/reference/sponza-direct-4spp.exr"), 0.01),
    row("dabrovic-direct", 16, Visibility("scenes/dabrovic-sponza/reference/sponza-av-1024spp.exr", 5.0), 0.01),
    row("mitsuba-arealight", 8192, Mean("scenes/mitsuba-tests/refs/test_arealight_ref_rgb.exr"), 0.02),
    row("mitsuba-constant", 4096, Mean("scenes/mitsuba-tests/refs/test_constant_ref_rgb.exr"), 0.01),
    row("mitsuba-directional", 4096, Mean("scenes/mitsuba-tests/refs/test_directional_ref_rgb.exr"), 0.01),
    row("mitsuba-envmap", 4096, Mean("scenes/mitsuba-tests/refs/test_envmap_ref_rgb.exr"), 0.01),
    row("mitsuba-pointlight", 8192, Mean("scenes/mitsuba-tests/refs/test_pointlight_ref_rgb.exr"), 0.02),
    row("mitsuba-roughdielectric", 8192, Mean("scenes/mitsuba-tests/refs/test_roughdielectric_ref_rgb.exr"), 0.02),
    row("mitsuba-textured-diffuse", 4096, Mean("scenes/mitsuba-tests/refs/test_textured_diffuse_ref_rgb.exr"), 0.01),
    row("ignis-plane", 256, Mean("scenes/ignis-eval/refs/ref-plane-d6-4096.exr"), 0.01),
    row("ignis-point", 256, Mean("scenes/ignis-eval/refs/ref-point-4096.exr"), 0.01),
    row("ignis-room", 1024, Mean("scenes/ignis-eval/refs/ref-room-4096.exr"), 0.01),
    row("furnace-sphere", 64, Constant(1.0), 1e-3),
    row("furnace-box", 64, Constant(2.0), 1e-3),
    row("scenes/furnace/scene.toml", 256, Constant(1.0), 1e-3),
    row("scenes/furnace/mirror.toml", 64, Constant(1.0), 1e-3),
    row("scenes/furnace/glass.toml", 256, Constant(1.0), 1e-3),
    row("scenes/furnace/coated.toml", 256, Constant(1.0), 1e-3),
    row("scenes/furnace/box.toml", 64, Constant(2.0), 1e-3),
];

#[derive(Parser)]
#[command(about = "Compares renders with independent references")]
struct Args {
    /// Only the rows whose scene contains one of these words; all when none is given
    only: Vec<String>,
    /// Folder for scene files, renders and differences
    #[arg(short, long, default_value = "out/references")]
    output: PathBuf,
    /// Folder of the outside data
    #[arg(long, env = "TALLOW_DATA")]
    data: PathBuf,
    /// The program to test
    #[arg(long)]
    tallow: PathBuf,
    /// Compares the renders that an earlier run left in the output folder
    #[arg(long)]
    again: bool,
}

fn main() -> anyhow::Result<ExitCode> {
    let args = Args::parse();
    let chosen = |row: &&Row| args.only.is_empty() || args.only.iter().any(|word| row.scene.contains(word.as_str()));
    let rows: Vec<&Row> = ROWS.iter().filter(chosen).collect();
    ensure!(!rows.is_empty(), "no row's scene contains {}", args.only.join(" or "));
    std::fs::create_dir_all(&args.output).with_context(|| format!("{}", args.output.display()))?;
    println!(
        "{:<34} {:>5} {:>26} {:>8} {:>9}  verdict",
        "scene", "spp", "image mean / reference", "median", "structure"
    );
    let failed = rows.iter().filter(|row| !report(row, &args)).count();
    println!("{} of {} rows agree; differences are in {}", rows.len() - failed, rows.len(), args.output.display());
    Ok(if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Prints a row and says whether it passed.
fn report(row: &Row, args: &Args) -> bool {
    let name = title(row);
    print!("{name:<34} {:>5} ", row.spp);
    let c = match judge(row, args) {
        Ok(c) => c,
        Err(error) => {
            println!("FAILED: {error:#}");
            return false;
        }
    };
    let ratios = c.ratio.map(|r| format!("{r:.4}")).join(" ");
    let (figures, passed) = match row.reference {
        Normals(_) => (format!("mean absolute difference {:.5}", c.absolute), c.absolute <= row.tolerance),
        _ => (format!("{ratios:>26} {:>8.4} {:>9.4}", c.median, c.structure), passes(row, &c)),
    };
    println!("{figures:<45}  {}", if passed { "ok" } else { "FAILED" });
    passed
}

/// The scene's name, with the depth where the row sets it.
fn title(row: &Row) -> String {
    let short = row.scene.trim_start_matches("scenes/").trim_end_matches(".toml");
    match (row.depth, row.reference) {
        (Some(depth), _) => format!("{short} d{depth}"),
        (_, Visibility(..)) => format!("{short} visibility"),
        _ => short.to_owned(),
    }
}

fn passes(row: &Row, c: &compare::Comparison) -> bool {
    let near = |ratio: f64| (ratio - 1.0).abs() <= row.tolerance;
    c.ratio.into_iter().all(near) && c.structure <= 3.0 * row.tolerance
}

/// Renders, writes the difference, and measures.
fn judge(row: &Row, args: &Args) -> anyhow::Result<compare::Comparison> {
    let file = |suffix| args.output.join(title(row).replace('/', "_").replace(' ', "-") + suffix);
    let scene = match row.scene.ends_with(".toml") {
        true => Path::new(env!("CARGO_MANIFEST_DIR")).join(row.scene),
        false => scenes::convert(row.scene, &args.data, &args.output)?,
    };
    let render = file(".exr");
    if !args.again && !matches!(row.reference, Visibility(..)) {
        run(row, &scene, &render, &args.tallow)?;
    }
    let data = |path: &str, channels| compare::read(&args.data.join(path), channels);
    let rgb = ["R", "G", "B"];
    let image = match row.reference {
        Normals(_) => absolute(compare::read(&render, ["N.X", "N.Y", "N.Z"])?),
        Visibility(_, reach) => visibility::render(&scene, row.spp, reach)?,
        _ => compare::read(&render, rgb)?,
    };
    let reference = match row.reference {
        Mean(path) | Visibility(path, _) => data(path, rgb)?.reduced(row.reduce),
        Normals(path) => absolute(data(path, rgb)?),
        Constant(value) => compare::Picture { rgb: vec![[value; 3]; image.rgb.len()], ..image },
    };
    let comparison = compare::compare(&image, &reference)?;
    compare::write_difference(&compare::difference(&image, &reference), &reference, &file("-difference"))?;
    Ok(comparison)
}

fn absolute(mut picture: compare::Picture) -> compare::Picture {
    picture.rgb.iter_mut().flatten().for_each(|v| *v = v.abs());
    picture
}

fn run(row: &Row, scene: &Path, render: &Path, tallow: &Path) -> anyhow::Result<()> {
    let mut command = Command::new(tallow);
    command.arg("render").arg(scene).arg("-o").arg(render).arg("--spp").arg(row.spp.to_string());
    if let Some(depth) = row.depth {
        command.args(["--width", "128", "--height", "128", "--max-depth"]).arg(depth.to_string());
    }
    if row.reduce > 1 {
        command.args(reduced_film(scene, row.reduce)?);
    }
    let output = command.output().with_context(|| format!("cannot start {}", tallow.display()))?;
    if !output.status.success() {
        bail!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(())
}

/// Options for a film so many times smaller than that of the scene file.
fn reduced_film(scene: &Path, factor: usize) -> anyhow::Result<[String; 4]> {
    let scene: toml::Table = std::fs::read_to_string(scene)?.parse()?;
    let extent = |key: &str| scene.get("film").and_then(|film| film.get(key)).and_then(toml::Value::as_integer);
    let [width, height] = ["width", "height"].map(|key| extent(key).map(|n| (n as usize / factor).to_string()));
    let silent = "the scene file does not say how large its film is";
    Ok(["--width".into(), width.context(silent)?, "--height".into(), height.context(silent)?])
}
