//! The Cornell box against Open Image Denoise: the same image, albedo and normals, in one run.
use super::case::{self, Case};
use super::frames::{REFERENCE, View};
use super::{sweep, times};
use crate::Args;
use anyhow::{Context, bail};
use std::path::Path;
use std::process::Command;
use tallow::composition::Demodulation;
use tallow::filter::FILTERS;
use tallow::gpu::Gpu;
use tallow::image::metrics;
use tallow::image::{self, Picture};
use tallow::report::table;

const VIEW: View = View { name: "cornell", scene: "scenes/cornell-box/scene.toml", size: [256, 256], depth: 3 };
const SPP: u32 = 16;

/// # Errors
/// When the scene cannot be rendered, or the device or the peer fails.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    let (noisy, reference) = (VIEW.render(args, SPP)?, VIEW.render(args, REFERENCE)?);
    println!("Cornell box, 256x256, {SPP} samples per pixel, depth 3, against {REFERENCE} samples per pixel");
    let cases = [
        ("indirect light", Case::new(&noisy, &reference, Demodulation::Light)?),
        ("all light", Case::new(&noisy, &reference, Demodulation::Albedo)?),
    ];
    let truth = &cases[0].1.reference;
    let mut rows = vec![line("noisy", &cases[0].1.noisy, truth, None, "")];
    for (kind, case) in &cases {
        for row in FILTERS.iter().filter(|row| row.name != "none") {
            let relmse = |p: &Picture| metrics::compare(p, truth).relmse;
            let best = sweep::best(row, case.start(), |s| Ok(relmse(&case.whole(&case.run(gpu, row, s)?))))?;
            let picture = case.whole(&case.run(gpu, row, &best.settings)?);
            let ms = times::milliseconds(gpu, row, &best.settings, &case.parts.input)?;
            rows.push(line(&format!("{}, {kind}", row.name), &picture, truth, Some(ms), &best.text));
            case::write(&picture, &args.output.join(format!("cornell-{}-{}.png", row.name, kind.replace(' ', "-"))))?;
        }
    }
    match &args.peers {
        Some(peers) => rows.extend(denoised(peers, args, truth)?),
        None => println!("(no --peers: Open Image Denoise is left out)"),
    }
    println!("{}", table::text(&["filter", "relMSE", "SSIM", "FLIP", "ms", "best settings"], &rows));
    Ok(())
}

fn line(name: &str, picture: &Picture, truth: &Picture, ms: Option<f64>, settings: &str) -> Vec<String> {
    let m = metrics::compare(picture, truth);
    let ssim = m.ssim.unwrap_or_default();
    let ms = ms.map_or("-".to_owned(), |ms| format!("{ms:.1}"));
    vec![
        name.to_owned(),
        format!("{:.5}", m.relmse),
        format!("{ssim:.4}"),
        format!("{:.4}", m.flip),
        ms,
        settings.to_owned(),
    ]
}

/// Runs the peer, which prints `QUALITY MILLISECONDS FILE` per line.
fn denoised(peers: &Path, args: &Args, truth: &Picture) -> anyhow::Result<Vec<Vec<String>>> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/measure/oidn.py");
    let shell = r#". "$0/env.sh" && exec "$0/venv/bin/python" "$@""#;
    let mut command = Command::new("bash");
    command.args(["-c", shell]).arg(peers).arg(script).arg(VIEW.file(args, SPP)).arg(&args.output);
    let output = command.output().context("bash")?;
    if !output.status.success() {
        bail!("Open Image Denoise: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    let text = String::from_utf8(output.stdout)?;
    let row = |line: &str| {
        let [quality, ms, file] = line.split_whitespace().collect::<Vec<_>>()[..] else { return Ok(None) };
        let picture = image::read(Path::new(file))?.picture(None).map_err(anyhow::Error::msg)?;
        let name = format!("Open Image Denoise, {quality}");
        Ok(Some(self::line(&name, &picture, truth, Some(ms.parse()?), "colour, albedo, normal")))
    };
    text.lines().filter_map(|line| row(line).transpose()).collect()
}
