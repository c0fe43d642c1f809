//! Plots of error, both axes logarithmic where that can be.
use anyhow::{Result, anyhow};
use plotters::prelude::*;
use std::path::Path;

type Series = (String, Vec<(f64, f64)>);

/// Writes lines as .svg.
pub fn lines(path: &Path, title: &str, axes: [&str; 2], series: &[Series]) -> Result<()> {
    draw(path, title, axes, series).map_err(|e| anyhow!("{}: {e}", path.display()))?;
    println!("plot: {}", path.display());
    Ok(())
}

fn draw(
    path: &Path,
    title: &str,
    [across, up]: [&str; 2],
    series: &[Series],
) -> Result<(), Box<dyn std::error::Error>> {
    let points = || series.iter().flat_map(|(_, line)| line.iter().copied());
    let bounds =
        |of: fn((f64, f64)) -> f64| points().map(of).fold((f64::INFINITY, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
    let ((left, right), (low, high)) = (bounds(|p| p.0), bounds(|p| p.1));
    let root = SVGBackend::new(path, (800, 500)).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(70)
        .build_cartesian_2d(left..right * 1.02, (low.max(1e-9) * 0.8..high * 1.25).log_scale())?;
    chart.configure_mesh().x_desc(across).y_desc(up).draw()?;
    for (i, (name, line)) in series.iter().enumerate() {
        let colour = Palette99::pick(i).to_rgba();
        let drawn = chart.draw_series(LineSeries::new(line.iter().copied(), colour.stroke_width(2)))?;
        drawn.label(name).legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
    }
    chart.configure_series_labels().background_style(WHITE.mix(0.8)).border_style(BLACK).draw()?;
    root.present()?;
    Ok(())
}
