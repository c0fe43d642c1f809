//! Measures the mean squared error of every filter on the indirect light of a scene, at its default settings and over a
//! small sweep.
//!   cargo run --release --example bench-quality -- SCENE [SIDE SPP REFERENCE_SPP]
#![allow(missing_docs)]
use anyhow::{Context, Result};
use std::path::Path;
use tallow::denoise::filter::{FILTERS, FilterInput, FilterSettings, run};
use tallow::gpu::{DeviceOptions, FrameResources, Gpu};
use tallow::image::{Picture, metrics};
use tallow::layout::{Guide, PixelLight, PixelStats, vec3, vec4};
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::Scene;
use tallow::statistics::Pixel;

/// Renders a scene and returns its guides, statistics and light.
fn render(
    gpu: &Gpu,
    file: &str,
    side: u32,
    spp: u32,
    seed: u32,
) -> Result<(Vec<Guide>, Vec<PixelStats>, Vec<PixelLight>)> {
    let settings = |s: &mut Settings| (s.width, s.height, s.spp, s.seed, s.max_depth) = (side, side, spp, seed, 4);
    let scene = Scene::load(Path::new(file)).map(|scene| scene.with(settings))?;
    let renderer = Renderer::new(gpu, &scene, &scene.settings, Outputs::FILTERED)?;
    Job::new(&renderer).run_to_end(&mut FrameResources::new(gpu)?)?;
    let tile = renderer.film().tiles.first().context("a film has a tile")?;
    Ok((tile.guide.read()?, tile.stats.read()?, tile.light.read()?))
}

/// Returns (MSE, relMSE).
fn errors(image: &[vec4], reference: &Picture) -> (f64, f64) {
    let image = Picture { pixels: image.iter().map(|&[r, g, b, _]| [r, g, b]).collect(), ..*reference };
    (metrics::mse(&image, reference), metrics::relmse(&image, reference))
}

/// The settings that matter most to a filter.
fn sweep(filter: &str, base: FilterSettings) -> Vec<FilterSettings> {
    let levels = [3, 4, 5].map(|levels| base.with(|s| s.footprint.levels = levels));
    let radii = [6, 12, 24].map(|radius| base.with(|s| s.footprint.radius = radius));
    match filter {
        "atrous" => levels
            .iter()
            .flat_map(|s| [0.5, 1.0, f32::INFINITY].map(|sigma_rt| s.with(|s| s.edge.sigma_rt = sigma_rt)))
            .collect(),
        "svgf" => levels.iter().flat_map(|s| [2.0, 4.0, 8.0].map(|l| s.with(|s| s.svgf.sigma_l = l))).collect(),
        "bilateral" => radii[..2].iter().map(|s| s.with(|s| s.edge.sigma_rt = f32::INFINITY)).collect(),
        "guided" => {
            radii.iter().flat_map(|s| [0.001, 0.01].map(|e| s.with(|s| s.guided.eps = [e, e, e, 2.0 * e]))).collect()
        }
        _ => vec![base],
    }
}

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let file = args.first().context("name a scene file")?;
    let number = |i: usize, or: u32| args.get(i).map_or(Ok(or), |a| a.parse());
    let (side, spp, many) = (number(1, 256)?, number(2, 4)?, number(3, 1024)?);
    let gpu = Gpu::open(&DeviceOptions { device: std::env::var("TALLOW_DEVICE").ok(), ..DeviceOptions::default() })?;
    let of_pixels = |stats: &[PixelStats], light: &[PixelLight]| -> Vec<vec3> {
        stats.iter().zip(light).map(|(&stats, &light)| Pixel { stats, light }.indirect()).collect()
    };
    let (_, stats, light) = render(&gpu, file, side, many, 1)?;
    let reference = Picture { width: side, height: side, pixels: of_pixels(&stats, &light) };
    let (guide, stats, light) = render(&gpu, file, side, spp, 0)?;
    // The statistics include direct light, so the filter estimates the variance of the indirect light itself.
    let light = of_pixels(&stats, &light);
    let radiance = light.iter().zip(&stats).map(|(&[r, g, b], s)| [r, g, b, s.count as f32]);
    let input = FilterInput { width: side, height: side, radiance: radiance.collect(), guide, variance: None };
    let base = FilterSettings::default().scaled_to(&input);
    println!("{file}, {side}x{side}, {spp} spp against {many}: MSE, relMSE at default settings; least MSE of a sweep");
    for row in FILTERS {
        let default = errors(&run(&gpu, row, &input, &base)?.0, &reference);
        let mut best = (f64::INFINITY, 0.0, base);
        for settings in sweep(row.name, base) {
            let (mse, relative) = errors(&run(&gpu, row, &input, &settings)?.0, &reference);
            if mse < best.0 {
                best = (mse, relative, settings);
            }
        }
        let (mse, relative, s) = best;
        println!(
            "{:10} {:10.3e} {:9.5}   {mse:10.3e} {relative:9.5}  levels {} sigma_rt {} sigma_l {} radius {} eps {}",
            row.name,
            default.0,
            default.1,
            s.footprint.levels,
            s.edge.sigma_rt,
            s.svgf.sigma_l,
            s.footprint.radius,
            s.guided.eps[0]
        );
    }
    Ok(())
}
