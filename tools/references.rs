//! Renders every scene that has an independent reference with the program `tallow`, compares the two, prints a table and
//! writes the differences. The exit code is 1 if a row fails. The script `tools/references` builds what this needs and
//! runs it.
use anyhow::{Context, bail, ensure};
use clap::Parser;
use significance::Significance;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use tallow::image::Picture;

mod compare;
mod scenes;
mod significance;
#[path = "../tests/support/statistics.rs"]
mod statistics;
mod visibility;

use Reference::{Constant, Mean, Normals, Visibility};

/// The reference of a render. Paths are relative to the data folder.
#[derive(Clone, Copy)]
enum Reference {
    /// An image. The mean of each channel and the structure of the difference are judged, in units of the standard error if a
    /// file beside the image contains it.
    Mean(&'static str),
    /// A value that every pixel has by derivation.
    Constant(f32),
    /// An image of the absolute values of the shading normal.
    Normals(&'static str),
    /// An image of the average visibility within this distance in world units.
    Visibility(&'static str, f32),
}

/// One row of the table: a render and its reference.
struct Scenario {
    /// A name known to the converter, or a scene file of the repository.
    scene: &'static str,
    /// Largest number of path edges, if not that of the scene file.
    depth: Option<u32>,
    /// Width and height in pixels, if not those of the scene file.
    size: Option<u32>,
    spp: u32,
    reference: Reference,
    /// Relative tolerance of the means; the structure may be three times as large.
    tolerance: f64,
    /// Relative difference of a block that has a known reason; only the excess is judged by standard errors.
    known: f64,
}

const fn row(scene: &'static str, spp: u32, reference: Reference, tolerance: f64) -> Scenario {
    Scenario { scene, depth: None, size: None, spp, reference, tolerance, known: significance::COLOUR }
}

const fn known(known: f64, row: Scenario) -> Scenario {
    Scenario { known, ..row }
}

/// A reference by Mitsuba 3, whose scene has exactly the same numbers.
const fn cornell(scene: &'static str, depth: u32, reference: &'static str) -> Scenario {
    Scenario { depth: Some(depth), size: Some(128), known: 1e-5, ..row(scene, 1024, Mean(reference), 5e-3) }
}

const CORNELL: &str = "scenes/cornell-box/scene.toml";
const CONDUCTOR: &str = "scenes/cornell-box/conductor.toml";
const POINT: &str = "scenes/cornell-box/point.toml";

/// A render by Ignis that shows only the lamp.
const IGNIS_EMITTED: &str = "scenes/cornell-box/ignis/ref-cbox-d1-4096.exr";
/// The reference was rendered with a larger texture than the copy in the outside data.
const WOOD: &str = "scenes/mitsuba-tests/refs/test_textured_diffuse_ref_rgb.exr";

/// All rows. The tolerance is 2 % for a reference that is itself noisy.
const ROWS: &[Scenario] = &[
    cornell(CORNELL, 2, "references/ref_diffuse_d2.exr"),
    cornell(CORNELL, 3, "references/ref_diffuse_d3.exr"),
    cornell(CORNELL, 4, "references/ref_diffuse_d4.exr"),
    cornell(CONDUCTOR, 2, "references/ref_conductor_d2.exr"),
    cornell(CONDUCTOR, 3, "references/ref_conductor_d3.exr"),
    cornell(CONDUCTOR, 4, "references/ref_conductor_d4.exr"),
    cornell(POINT, 2, "references/ref_point_d2.exr"),
    cornell(POINT, 3, "references/ref_point_d3.exr"),
    cornell(POINT, 4, "references/ref_point_d4.exr"),
    Scenario { depth: Some(1), ..row("cornell-box-ignis", 256, Mean(IGNIS_EMITTED), 0.01) },
    row("cornell-box-ignis", 256, Mean("scenes/cornell-box/ignis/ref-cbox-d6-4096.exr"), 0.01),
    row("bitterli-cornell-box", 64, Mean("scenes/bitterli-cornell-box/TungstenRender.exr"), 0.01),
    row("bitterli-veach-mis", 64, Mean("scenes/bitterli-veach-mis/TungstenRender.exr"), 0.02),
    row("nori-table", 64, Mean("scenes/nori-table/table_path_mis_512spp.exr"), 0.01),
    row("bunny-normals", 16, Normals("scenes/nori-bunny-normals/bunny_normals_ref.exr"), 0.01),
    row("dabrovic-direct", 16, Mean("scenes/dabrovic-sponza/reference/sponza-direct-4spp.exr"), 0.01),
    row("dabrovic-direct", 16, Visibility("scenes/dabrovic-sponza/reference/sponza-av-1024spp.exr", 5.0), 0.01),
    row("mitsuba-arealight", 8192, Mean("scenes/mitsuba-tests/refs/test_arealight_ref_rgb.exr"), 0.01),
    row("mitsuba-constant", 4096, Mean("scenes/mitsuba-tests/refs/test_constant_ref_rgb.exr"), 0.01),
    row("mitsuba-directional", 4096, Mean("scenes/mitsuba-tests/refs/test_directional_ref_rgb.exr"), 0.01),
    // Mitsuba counts passing a mask as a hit, so at depth 2 no light comes through the leaves.
    known(0.01, row("mitsuba-envmap", 4096, Mean("scenes/mitsuba-tests/refs/test_envmap_ref_rgb.exr"), 0.01)),
    // Mitsuba tabulates the transmission of a rough coat: at the terminator it is twice that of a smooth one.
    known(2e-3, row("mitsuba-pointlight", 8192, Mean("scenes/mitsuba-tests/refs/test_pointlight_ref_rgb.exr"), 0.01)),
    row("mitsuba-roughdielectric", 8192, Mean("scenes/mitsuba-tests/refs/test_roughdielectric_ref_rgb.exr"), 0.01),
    known(5e-3, row("mitsuba-textured-diffuse", 4096, Mean(WOOD), 0.01)),
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
    let chosen =
        |row: &&Scenario| args.only.is_empty() || args.only.iter().any(|word| row.scene.contains(word.as_str()));
    let rows: Vec<&Scenario> = ROWS.iter().filter(chosen).collect();
    ensure!(!rows.is_empty(), "no row's scene contains {}", args.only.join(" or "));
    std::fs::create_dir_all(&args.output).with_context(|| format!("{}", args.output.display()))?;
    println!(
        "{:<34} {:>5} {:>26} {:>8} {:>9} {:>13} {:>13}  verdict",
        "scene", "spp", "image mean / reference", "median", "structure", "mean z (of)", "block z (of)"
    );
    let failed = rows.iter().filter(|row| !report(row, &args)).count();
    println!("{} of {} rows agree; differences are in {}", rows.len() - failed, rows.len(), args.output.display());
    Ok(if failed == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Prints a row and returns whether it passed.
fn report(row: &Scenario, args: &Args) -> bool {
    let name = title(row);
    print!("{name:<34} {:>5} ", row.spp);
    let (c, s) = match judge(row, args) {
        Ok(found) => found,
        Err(error) => {
            println!("FAILED: {error:#}");
            return false;
        }
    };
    let ratios = c.ratio.map(|r| format!("{r:.4}")).join(" ");
    let (figures, passed) = match row.reference {
        Normals(_) => (format!("mean absolute difference {:.5}", c.absolute), c.absolute <= row.tolerance),
        _ => (format!("{ratios:>26} {:>8.4} {:>9.4}", c.median, c.structure), passes(row, &c, s.as_ref())),
    };
    let z = |z: f64, limit: f64| format!("{:>13}", format!("{z:.1} ({limit:.1})"));
    let z = s.map(|s| format!("{} {}", z(s.mean, s.mean_limit), z(s.block, s.block_limit))).unwrap_or_default();
    println!("{figures:<45} {z:<27}  {}", if passed { "ok" } else { "FAILED" });
    passed
}

/// The scene's name, with the depth if the row sets it.
fn title(row: &Scenario) -> String {
    let short = row.scene.trim_start_matches("scenes/").trim_end_matches(".toml");
    match (row.depth, row.reference) {
        (Some(depth), _) => format!("{short} d{depth}"),
        (_, Visibility(..)) => format!("{short} visibility"),
        _ => short.to_owned(),
    }
}

fn passes(row: &Scenario, c: &compare::Comparison, s: Option<&Significance>) -> bool {
    let near = |ratio: f64| (ratio - 1.0).abs() <= row.tolerance;
    c.ratio.into_iter().all(near) && s.map_or(c.structure <= 3.0 * row.tolerance, Significance::passes)
}

/// Renders, writes the difference, and measures.
fn judge(row: &Scenario, args: &Args) -> anyhow::Result<(compare::Comparison, Option<Significance>)> {
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
        Mean(path) | Visibility(path, _) => data(path, rgb)?,
        Normals(path) => absolute(data(path, rgb)?),
        Constant(value) => Picture { pixels: vec![[value; 3]; image.pixels.len()], ..image },
    };
    let comparison = compare::compare(&image, &reference)?;
    compare::write_difference(&compare::difference(&image, &reference), &reference, &file("-difference"))?;
    let noise = match row.reference {
        Mean(path) => significance::of_reference(&args.data.join(path))?,
        _ => None,
    };
    let weigh = |noise| significance::test(&image, &reference, [&significance::of_render(&render)?, &noise], row.known);
    Ok((comparison, noise.map(weigh).transpose()?))
}

fn absolute(mut picture: Picture) -> Picture {
    picture.pixels.iter_mut().flatten().for_each(|v| *v = v.abs());
    picture
}

fn run(row: &Scenario, scene: &Path, render: &Path, tallow: &Path) -> anyhow::Result<()> {
    let mut command = Command::new(tallow);
    command.arg("render").arg(scene).arg("-o").arg(render).arg("--spp").arg(row.spp.to_string());
    for (option, value) in [("--width", row.size), ("--height", row.size), ("--max-depth", row.depth)] {
        command.args(value.iter().flat_map(|value| [option.to_owned(), value.to_string()]));
    }
    let output = command.output().with_context(|| format!("cannot start {}", tallow.display()))?;
    if !output.status.success() {
        bail!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(())
}
