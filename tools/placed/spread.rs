//! Reproduces RAS's result: the spread of errors against time, for its choices of least and most samples.
use super::{View, radiance, render};
use crate::Args;
use plotters::prelude::*;
use tallow::gpu::Gpu;
use tallow::layout::vec3;
use tallow::report::table;

const VIEWS: [View; 2] = [
    View { name: "cornell", scene: "scenes/cornell-box/scene.toml", size: [96, 96], depth: 4, reference: 1024 },
    View { name: "sponza", scene: "crytek-sponza", size: [112, 63], depth: 4, reference: 1024 },
];
/// Average number of samples per pixel; for the published scheme, the number of rounds with at most one sample each.
const BUDGETS: [u32; 4] = [8, 16, 32, 64];
/// The published limits: least and most samples per pixel.
const LIMITS: [(u32, u32); 6] = [(2, 16), (4, 16), (8, 16), (2, 32), (4, 32), (8, 32)];

/// Returns (name, policy, least, most), where most 0 is unlimited. Our policy needs no largest number, but it is also
/// measured with the published ones.
fn policies() -> Vec<(String, &'static str, u32, u32)> {
    let plain = [("uniform", "uniform", 0, 0), ("ours: min 4", "variance", 4, 0)];
    let limited = |(kind, policy)| move |(min, max)| (format!("{kind}: min {min}, max {max}"), policy, min, max);
    let plain = plain.map(|(name, policy, min, max)| (name.to_owned(), policy, min, max)).into_iter();
    let all = [("published", "threshold"), ("ours", "variance")];
    plain.chain(all.into_iter().flat_map(|of| LIMITS.map(limited(of)))).collect()
}

/// Variance over the pixels of the distance between colour and reference.
fn spread(image: &[vec3], reference: &[vec3]) -> f64 {
    let distance = |(a, b): (&vec3, &vec3)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>().sqrt();
    let all: Vec<f64> = image.iter().zip(reference).map(distance).collect();
    let mean = super::mean(&all);
    all.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / all.len() as f64
}

/// Prints a table and writes a plot per scene.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    for view in &VIEWS {
        let reference = &view.reference(gpu, args, |_| {})?[0];
        let mut lines = Vec::new();
        for (name, policy, min, max) in policies() {
            let mut line = Vec::new();
            let possible = |&spp: &u32| policy == "threshold" || max == 0 || spp <= max;
            for spp in BUDGETS.into_iter().filter(possible) {
                let scene = view.load(args, |s| {
                    (s.spp, s.allocate.policy) = (spp, tallow::allocate::policy(policy).unwrap());
                    (s.allocate.min_spp, s.allocate.max_spp) = (min, max);
                })?;
                let rendered = render(gpu, &scene)?;
                line.push((rendered.ms, spread(&radiance(&rendered.pixels), reference)));
            }
            lines.push((name, line));
        }
        let row = |(name, line): &(String, Vec<(f64, f64)>)| {
            let cells = line.iter().map(|(ms, spread)| format!("{spread:.2e} in {ms:.0} ms"));
            let empty = std::iter::repeat_n(String::new(), BUDGETS.len() - line.len());
            std::iter::once(name.clone()).chain(cells).chain(empty).collect()
        };
        println!(
            "Spread of the error (variance of the distance to the reference), {} {}x{}\n",
            view.name, view.size[0], view.size[1]
        );
        let header = ["samples", "8 on average", "16", "32", "64"];
        println!("{}", table::text(&header, &lines.iter().map(row).collect::<Vec<_>>()));
        let file = args.output.join(format!("spread-{}.svg", view.name));
        plot(&file, view.name, &lines).map_err(|e| anyhow::anyhow!("{}: {e}", file.display()))?;
        println!("plot: {}\n", file.display());
    }
    Ok(())
}

type Lines = [(String, Vec<(f64, f64)>)];

fn plot(file: &std::path::Path, scene: &str, lines: &Lines) -> Result<(), Box<dyn std::error::Error>> {
    let points = || lines.iter().flat_map(|(_, line)| line.iter().copied());
    let range = |of: fn((f64, f64)) -> f64| {
        let (low, high) = points().map(of).fold((f64::INFINITY, 0.0), |(l, h), v| (v.min(l), v.max(h)));
        low * 0.8..high * 1.25
    };
    let root = SVGBackend::new(file, (800, 500)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(format!("{scene}: spread of the error against time"), ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(70)
        .build_cartesian_2d(range(|p| p.0).log_scale(), range(|p| p.1).log_scale())?;
    chart.configure_mesh().x_desc("device time, ms").y_desc("variance of the distance").draw()?;
    for (i, (name, line)) in lines.iter().enumerate() {
        let colour = Palette99::pick(i).to_rgba();
        chart
            .draw_series(LineSeries::new(line.iter().copied(), colour.stroke_width(2)).point_size(3))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour));
    }
    chart.configure_series_labels().border_style(BLACK).background_style(WHITE).draw()?;
    root.present()?;
    Ok(())
}
