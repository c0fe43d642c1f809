//! Compares the filters with Open Image Denoise on the Cornell box, with the same image, albedo and normals, in one run.
use super::case::Case;
use super::frames::View;
use super::sheet::{self, Tile};
use super::{sweep, times};
use crate::Args;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::process::Command;
use tallow::denoise::Demodulation;
use tallow::denoise::filter::FILTERS;
use tallow::gpu::Gpu;
use tallow::image::source::Source;
use tallow::image::{self, Picture, metrics};
use tallow::report::table;

const VIEW: View =
    View { name: "cornell", scene: "scenes/cornell-box/scene.toml", size: [256, 256], depth: 3, reference: 1024 };
const SPP: u32 = 16;

/// # Errors
/// When the scene cannot be rendered, or the device or a peer fails.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    println!("Cornell box, 256x256, {SPP} samples per pixel, depth 3, against {} samples per pixel\n", VIEW.reference);
    let (noisy, reference) = (VIEW.render(args, SPP)?, VIEW.render(args, VIEW.reference)?);
    let indirect = Case::new(&noisy, &reference, Demodulation::Light)?;
    let all = Case::new(&noisy, &reference, Demodulation::Albedo)?;
    let cases = [("indirect light", indirect), ("all light", all)];
    one(gpu, args, "Tallow's image", &VIEW.file(args, SPP), &cases)?;
    let Some(peers) = &args.peers else {
        println!("(no --peers: Open Image Denoise and Mitsuba's image are left out)\n");
        return Ok(());
    };
    let files = [SPP, VIEW.reference].map(|spp| args.output.join(format!("cornell-mitsuba-{spp}spp.exr")));
    for (spp, file) in [SPP, VIEW.reference].iter().zip(&files).filter(|(_, file)| !file.exists()) {
        let scene = args.data.join("references/cornell_diffuse.xml");
        python(peers, "cornell_mitsuba.py", &[&scene, Path::new(&spp.to_string()), file])?;
    }
    let case = Case::new(&Source::read(&files[0])?, &Source::read(&files[1])?, Demodulation::Light)?;
    one(gpu, args, "Mitsuba's image", &files[0], &[("all light", case)])
}

/// Denoises one noisy image with every filter and prints the results.
fn one(gpu: &Gpu, args: &Args, title: &str, noisy: &Path, cases: &[(&str, Case)]) -> anyhow::Result<()> {
    let truth = &cases[0].1.reference;
    let unfiltered = &cases[0].1.noisy;
    let mut rows = vec![line("unfiltered", unfiltered, truth, None, "")];
    let mut tiles = vec![Tile::new("unfiltered", unfiltered)];
    for (kind, case) in cases {
        for row in FILTERS.iter().filter(|row| row.name != "none") {
            let relmse = |p: &Picture| metrics::relmse(p, truth);
            let best = sweep::best(row, case.start(), |s| Ok(relmse(&case.whole(&case.run(gpu, row, s)?))))?;
            let picture = case.whole(&case.run(gpu, row, &best.settings)?);
            let ms = times::milliseconds(gpu, row, &best.settings, &case.parts.input)?;
            let name = format!("{}, {kind}", row.name);
            rows.push(line(&name, &picture, truth, Some(ms), &best.text));
            tiles.push(Tile::new(&name, &picture));
        }
    }
    if let Some(peers) = &args.peers {
        for (name, picture, ms) in denoised(peers, &args.output, noisy)? {
            rows.push(line(&name, &picture, truth, Some(ms), "colour, albedo, normal"));
            tiles.push(Tile::new(&name, &picture));
        }
    }
    println!("{title}\n{}", table::text(&["filter", "relMSE", "SSIM", "FLIP", "ms", "best settings"], &rows));
    let stem = noisy.file_stem().unwrap_or_default().to_string_lossy();
    sheet::write(&args.output.join(format!("{stem}-sheet.png")), &tiles, truth)
}

fn line(name: &str, picture: &Picture, truth: &Picture, ms: Option<f64>, settings: &str) -> Vec<String> {
    let m = metrics::compare(picture, truth);
    let ssim = m.ssim.unwrap_or_default();
    let ms = ms.map_or("-".to_owned(), |ms| format!("{ms:.1}"));
    let figures = [format!("{:.5}", m.relmse), format!("{ssim:.4}"), format!("{:.4}", m.flip), ms];
    [&[name.to_owned()], &figures[..], &[settings.to_owned()]].concat()
}

/// Runs Open Image Denoise, which prints lines of `QUALITY MILLISECONDS FILE`, and returns name, picture and milliseconds.
fn denoised(peers: &Path, output: &Path, noisy: &Path) -> anyhow::Result<Vec<(String, Picture, f64)>> {
    let text = python(peers, "oidn.py", &[noisy, output])?;
    let row = |line: &str| {
        let [quality, ms, file] = line.split_whitespace().collect::<Vec<_>>()[..] else { return Ok(None) };
        let picture = image::read(&PathBuf::from(file))?.picture(None).map_err(anyhow::Error::msg)?;
        Ok(Some((format!("Open Image Denoise, {quality}"), picture, ms.parse()?)))
    };
    text.lines().filter_map(|line| row(line).transpose()).collect()
}

/// Runs a script of this folder with the Python that the set-up of the peers installed, and returns its output.
fn python(peers: &Path, script: &str, words: &[&Path]) -> anyhow::Result<String> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/measure").join(script);
    let shell = r#". "$0/env.sh" && exec "$0/venv/bin/python" "$@""#;
    let output = Command::new("bash").args(["-c", shell]).arg(peers).arg(&script).args(words).output();
    let output = output.context("cannot start bash")?;
    if !output.status.success() {
        bail!("{}: {}", script.display(), String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(String::from_utf8(output.stdout)?)
}
