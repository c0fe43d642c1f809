//! `tallow explain`: what a scene calls for, and what that costs.
use super::{Exit, print, print_json};
use crate::error::Result;
use crate::gpu::{DeviceOptions, FrameResources, Gpu};
use crate::renderer::{Outputs, Renderer};
use crate::report::table::{self, milliseconds};
use crate::scene::{self, Scene};
use crate::settings::Settings;
use serde::Serialize;
use std::path::PathBuf;

/// List every effect: on or off, what calls for it, and what it costs
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (.toml) or model (.obj)
    pub scene: PathBuf,
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Print one JSON array
    #[arg(long)]
    pub json: bool,
}

/// One effect. Costs are none where they were not measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// Name of the effect.
    pub effect: &'static str,
    /// Whether the scene calls for it.
    pub on: bool,
    /// Object, material or setting that does; empty when off.
    pub called_for_by: String,
    /// GPU time of one sample per pixel with the effect compiled in.
    pub gpu_ms_with: Option<f64>,
    /// The same without it.
    pub gpu_ms_without: Option<f64>,
    /// Time to compile the pipelines that the effect adds.
    pub compile_ms: Option<f64>,
    /// Device memory that the effect adds.
    pub bytes: Option<u64>,
}

/// Runs the subcommand.
///
/// # Errors
/// As a render of the scene.
pub fn run(args: &Args) -> Result<Exit> {
    let rows = rows(args)?;
    if args.json {
        print_json(&rows)?;
    } else {
        print(&text(&rows))?;
    }
    Ok(Exit::Done)
}

fn rows(args: &Args) -> Result<Vec<Row>> {
    let scene = Scene::load(&args.scene, &shrink)?;
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), validation: false })?;
    let outputs = Outputs { split_light: true, guides: true, counters: false };
    let (base, reasons) = scene::effects(&scene, outputs.split_light, outputs.counters);
    let usual = Renderer::new(&gpu, &scene, outputs)?;
    let sizes = usual.scene().sizes();
    let mut frame = FrameResources::new(&gpu)?;
    let usual_compile_ms = compile_ms(&usual, gpu_ms(&usual, &mut frame)?, gpu_ms(&usual, &mut frame)?);
    let mut rows = Vec::new();
    for (effect, id, on) in base.entries() {
        let reason = reasons.iter().find(|(name, _)| *name == effect);
        let called_for_by = reason.map_or_else(String::new, |(_, object)| object.clone());
        if effect == "adaptive" {
            // With and without it are different renders, not one picture at two prices: tools/adaptive compares those.
            rows.push(Row { effect, on, called_for_by, ..Row::default() });
            continue;
        }
        let other_effects = base.toggled(id);
        let (split_light, counters) = (other_effects.split_light, other_effects.counters);
        let other = Renderer::specialised(&gpu, &scene, Outputs { split_light, counters, ..outputs }, other_effects)?;
        let first_ms = gpu_ms(&other, &mut frame)?;
        let (usual_ms, other_ms) = in_turn(&usual, &other, &mut frame)?;
        let usual = (usual_ms, usual_compile_ms);
        let other = (other_ms, compile_ms(&other, first_ms, other_ms));
        let (with, without) = if on { (usual, other) } else { (other, usual) };
        rows.push(Row {
            effect,
            on,
            called_for_by,
            gpu_ms_with: Some(with.0),
            gpu_ms_without: Some(without.0),
            compile_ms: Some(with.1 - without.1),
            bytes: bytes_of(effect, &sizes).filter(|_| on),
        });
    }
    Ok(rows)
}

/// A small film tells enough about cost, and a kernel per effect is timed.
fn shrink(settings: &mut Settings) {
    let scale = (65_536.0 / settings.pixels() as f64).sqrt().min(1.0);
    let shrunk = |edge: u32| ((f64::from(edge) * scale) as u32).max(1);
    (settings.width, settings.height) = (shrunk(settings.width), shrunk(settings.height));
    settings.spp = 1;
}

/// GPU time of the paths of one sample per pixel.
fn gpu_ms(renderer: &Renderer, frame: &mut FrameResources) -> Result<f64> {
    let mut ns = 0;
    for step in renderer.steps() {
        let times = renderer.run(frame, &step)?;
        ns += times.iter().filter(|t| t.name == "path").map(|t| t.duration_ns()).sum::<u64>();
    }
    Ok(ns as f64 * 1e-6)
}

/// Best of three each, in turn, so that a machine that changes its speed changes both.
fn in_turn(a: &Renderer, b: &Renderer, frame: &mut FrameResources) -> Result<(f64, f64)> {
    let (mut best_a, mut best_b) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..3 {
        best_a = best_a.min(gpu_ms(a, frame)?);
        best_b = best_b.min(gpu_ms(b, frame)?);
    }
    Ok((best_a, best_b))
}

/// Creation of the pipelines, and what the first run took longer than a later one: compilation that the driver put off.
/// A driver that keeps its own cache on disk (Mesa's: MESA_SHADER_CACHE_DISABLE=true) hides what it has compiled before.
fn compile_ms(renderer: &Renderer, first_ms: f64, later_ms: f64) -> f64 {
    renderer.compile_times().iter().map(|(_, ms)| ms).sum::<f64>() + (first_ms - later_ms).max(0.0)
}

/// Device memory of the arrays that exist only for this effect.
fn bytes_of(effect: &str, sizes: &[(&'static str, u64)]) -> Option<u64> {
    let part = match effect {
        "textures" => "texels",
        "smooth_normals" => "shading",
        "instances" => "instances",
        "environment_map" => "environment",
        "emissive" => "lights",
        _ => return None,
    };
    sizes.iter().find(|(name, _)| *name == part).map(|(_, bytes)| *bytes)
}

/// The rows as a table; a dash stands for what was not measured.
pub fn text(rows: &[Row]) -> String {
    let ms = |value: Option<f64>| value.map_or("-".to_owned(), milliseconds);
    let cells = |r: &Row| {
        vec![
            r.effect.to_owned(),
            if r.on { "on" } else { "off" }.to_owned(),
            ms(r.gpu_ms_with),
            ms(r.gpu_ms_without),
            ms(r.compile_ms),
            r.bytes.map_or("-".to_owned(), |b| b.to_string()),
            r.called_for_by.clone(),
        ]
    };
    let header = ["effect", "", "GPU ms with", "GPU ms without", "compile ms", "bytes", "called for by"];
    table::text(&header, &rows.iter().map(cells).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::{Row, text};

    #[test]
    fn costs_not_measured_are_dashes() {
        let on = Row { effect: "ggx", on: true, called_for_by: "vase".to_owned(), bytes: Some(64), ..Row::default() };
        let table = text(&[on, Row { effect: "lens", ..Row::default() }]);
        let last = |line: usize| table.lines().nth(line).unwrap().split_whitespace().collect::<Vec<_>>();
        assert_eq!(last(1), ["ggx", "on", "-", "-", "-", "64", "vase"]);
        assert_eq!(last(2), ["lens", "off", "-", "-", "-", "-"]);
    }
}
