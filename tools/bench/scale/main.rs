//! Measures how time and memory grow with the number of triangles, lamps, instances and meshes, and with the edges of textures and of the
//! film. Every row is measured in a process of its own, so that the peak of memory is its own.
//!   [TALLOW_DATA=../shared] cargo run --release --example bench-scale [triangles|lamps|instances|meshes|texture|film|real ...]
#![allow(missing_docs)]
use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use tallow::gpu::{DeviceOptions, FrameResources, Gpu};
use tallow::render::{Job, Outputs, Renderer};
use tallow::report::table;
use tallow::scene::Scene;

mod made;

/// What grows: its name, what its sizes count, the power of a size that the work should grow with, and the sizes.
type Row = (&'static str, &'static str, i32, &'static [u32]);

const ROWS: [Row; 6] = [
    ("triangles", "of an OBJ file", 1, &[100_000, 1_000_000, 10_000_000]),
    ("lamps", "triangles that emit light", 1, &[10_000, 100_000, 1_000_000]),
    ("instances", "of a sphere of 960 triangles", 1, &[1_000, 10_000, 100_000]),
    ("meshes", "of 12 triangles and a material each, placed twice", 1, &[100, 1_000, 10_000]),
    ("texture", "texels along the edge of a PNG file", 2, &[1_024, 4_096, 8_192, 16_384]),
    ("film", "pixels along the edge, Cornell box, all layers", 2, &[1_024, 4_096, 8_192]),
];

/// Real scenes below the folder of outside data.
const REAL: [&str; 2] = ["scenes/forest/forest_instanced.gltf", "scenes/stanford/buddha_1087716_upsampled.ply.gz"];

/// What a process has measured.
#[derive(Serialize, Deserialize)]
struct Measured {
    /// Seconds until the scene is loaded, then until it is on the device and its kernels are compiled, then until one sample of each
    /// pixel is traced and read back.
    seconds: [f64; 3],
    /// Most memory that the process held, in GiB.
    peak: f64,
    triangles: usize,
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [flag, what, size] = &arguments[..]
        && flag == "--one"
    {
        println!("{}", serde_json::to_string(&one(what, size)?)?);
        return Ok(());
    }
    let chosen = |name: &str| arguments.is_empty() || arguments.iter().any(|argument| argument == name);
    let mut cells = Vec::new();
    for (name, counts, power, sizes) in ROWS.iter().filter(|row| chosen(row.0)) {
        let mut before = None;
        for &size in *sizes {
            let measured = child(name, &size.to_string());
            let seconds = measured.as_ref().ok().map(|m| m.seconds.iter().sum::<f64>());
            let growth = before.zip(seconds).map(|((s, t), now): ((u32, f64), f64)| {
                (now / t).ln() / (f64::from(size) / f64::from(s)).powi(*power).ln()
            });
            before = seconds.map(|seconds| (size, seconds));
            cells.push(row(&format!("{name}: {counts}"), &size.to_string(), measured, growth));
        }
    }
    match std::env::var("TALLOW_DATA") {
        Ok(data) if chosen("real") => {
            cells.extend(REAL.map(|file| row(file, "", child("file", &format!("{data}/{file}")), None)));
        }
        _ => println!("without real scenes: TALLOW_DATA names no folder of outside data, or others were asked for"),
    }
    let head = ["what", "size", "triangles", "load s", "upload s", "frame s", "peak GiB", "growth"];
    println!("{}", table::text(&head, &cells));
    println!("upload: with the compilation of kernels; frame: one sample a pixel, read back");
    println!("growth: exponent of the time in the number of things (of a texture and a film, of texels and pixels)");
    Ok(())
}

fn row(what: &str, size: &str, measured: Result<Measured>, growth: Option<f64>) -> Vec<String> {
    let (what, size) = (what.to_owned(), size.to_owned());
    match measured {
        Ok(Measured { seconds: [load, upload, frame], peak, triangles }) => {
            let growth = growth.map_or(String::new(), |exponent| format!("{exponent:.2}"));
            let numbers = [load, upload, frame, peak].map(|v| format!("{v:.2}"));
            [what, size, triangles.to_string()].into_iter().chain(numbers).chain([growth]).collect()
        }
        Err(error) => [what, size, format!("{error:#}")].into_iter().chain(vec![String::new(); 5]).collect(),
    }
}

/// Measures a row in another process.
fn child(what: &str, size: &str) -> Result<Measured> {
    let output = Command::new(std::env::current_exe()?).args(["--one", what, size]).output()?;
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "{}", said.lines().next().unwrap_or("failed without a word"));
    Ok(serde_json::from_slice(&output.stdout)?)
}

fn one(what: &str, size: &str) -> Result<Measured> {
    let folder = tempfile::tempdir()?;
    let load = if what == "file" { None } else { Some(made::make(what, size.parse()?, folder.path())?) };
    let begun = Instant::now();
    let scene = match load {
        Some(load) => load()?,
        None => Scene::load(Path::new(size))?.with(made::small),
    };
    let loaded = begun.elapsed();
    let (gpu, begun) = (Gpu::open(&DeviceOptions::default())?, Instant::now());
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED)?;
    let uploaded = begun.elapsed();
    frame(&gpu, &renderer)?;
    let seconds = [loaded, uploaded, begun.elapsed() - uploaded].map(|time| time.as_secs_f64());
    Ok(Measured { seconds, peak: peak()?, triangles: scene.triangles.len() })
}

fn frame(gpu: &Gpu, renderer: &Renderer) -> Result<()> {
    let job = Job::new(renderer);
    let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
    let film = job.film(&status)?;
    ensure!(film.channels.iter().any(|channel| channel.name == "samples"), "the film is empty");
    Ok(())
}

fn peak() -> Result<f64> {
    let status = std::fs::read_to_string("/proc/self/status").context("the peak of memory is known on Linux alone")?;
    let kib =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().split(' ').next()?.parse::<f64>().ok());
    Ok(kib.context("the system does not tell the peak of memory")? / f64::from(1 << 20))
}
