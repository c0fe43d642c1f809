//! What options change: a chart of time against error relative to the same point without them, and the table of it.
use super::chart;
use super::number::{interval, short};
use super::page::{Cell, Row, Table};
use crate::cost::changes::{option, plain};
use crate::cost::document::{Change, Document, Estimate, Point};
use kuva::plot::{LinePlot, ScatterPlot};
use kuva::render::plots::Plot;

/// A point that has options, and what they change.
type Changed<'a> = (&'a Point, &'a Change);

/// All that was measured with options, beside the same without.
fn changed(document: &Document) -> Vec<Changed<'_>> {
    let points = document.points.iter();
    points.filter_map(|point| Some((point, point.summary.as_ref()?.change.as_ref()?))).collect()
}

/// A row for each point with options, and the points without them that they are compared with first.
pub fn table(document: &Document) -> Table {
    let mut table = Table::new("", &["method", "option", "GPU time", "relMSE", "relMSE × time"]);
    for (point, change) in changed(document) {
        let method = plain(&document.points, point).map_or_else(String::new, |plain| plain.method.label());
        let factors = [change.time, change.relmse, change.product].map(factor);
        let cells = [Cell::text(method), Cell::text(option(point))].into_iter().chain(factors).collect();
        let is_better = change.product.is_some_and(|product| product.high.is_some_and(|high| high < 1.0));
        table.rows.push(Row { cells, image: Some(point.method.label()), strong: is_better });
    }
    table
}

fn factor(estimate: Option<Estimate>) -> Cell {
    let cell = |e: Estimate| Cell {
        text: format!("{} ×", short(e.value)),
        small: interval(&e).unwrap_or_default(),
        value: Some(e.value),
    };
    estimate.map_or_else(|| Cell::text("–"), cell)
}

/// Factors of time and error on logarithmic axes; empty without a point that has options. What lies below the line has a lower
/// product of both than without options.
pub fn draw(document: &Document) -> String {
    let marks: Vec<(Changed, f64, f64)> = changed(document)
        .into_iter()
        .filter_map(|(point, change)| Some(((point, change), change.time?.value, change.relmse?.value)))
        .filter(|(_, time, relmse)| [time, relmse].into_iter().all(|&factor| chart::is_drawn(factor)))
        .collect();
    if marks.is_empty() {
        return String::new();
    }
    let range = |of: fn(&(Changed, f64, f64)) -> f64| {
        let (low, high) = marks.iter().map(of).fold((1.0_f64, 1.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        (low / 1.5, high * 1.5)
    };
    let ((left, right), (bottom, top)) = (range(|m| m.1), range(|m| m.2));
    let equal = [left.max(1.0 / top), right.min(1.0 / bottom)].map(|time| (time, 1.0 / time));
    let line = LinePlot::new().with_data(equal).with_color(chart::FAINT).with_stroke_width(1.0).with_dashed();
    let mut plots = vec![Plot::Line(line.with_legend("same relMSE × time"))];
    plots.extend(scatters(&marks).into_iter().map(Plot::Scatter));
    let layout = chart::layout(&plots, 520.0).with_log_scale().with_x_axis_min(left).with_x_axis_max(right);
    let layout = layout.with_y_axis_min(bottom).with_y_axis_max(top);
    let layout = chart::plain_ticks(layout).with_x_label("GPU time, of that without the option");
    let layout = layout.with_y_label("relMSE, of that without the option");
    chart::svg(plots, layout, "Factors of GPU time and of relMSE that each option makes, both logarithmic")
}

/// A series for each knob.
fn scatters(marks: &[(Changed, f64, f64)]) -> Vec<ScatterPlot> {
    let knob = |mark: &(Changed, f64, f64)| option(mark.0.0).split(' ').next().unwrap_or_default().to_owned();
    let mut names: Vec<String> = Vec::new();
    marks.iter().map(knob).for_each(|name| {
        if !names.contains(&name) {
            names.push(name)
        }
    });
    let scatter = |(index, name): (usize, &String)| {
        let own: Vec<_> = marks.iter().filter(|mark| knob(mark) == *name).collect();
        ScatterPlot::new()
            .with_data(own.iter().map(|(_, time, error)| (*time, *error)))
            .with_color(chart::colour(index))
            .with_marker(chart::shape(index / chart::COLOURS))
            .with_size(5.0)
            .with_legend(name.clone())
            .with_tooltips()
            .with_tooltip_labels(own.iter().map(|((point, change), ..)| tooltip(point, change)))
    };
    names.iter().enumerate().map(scatter).collect()
}

/// The first line is the point's name, by which scripts find its image.
fn tooltip(point: &Point, change: &Change) -> String {
    let line = |name: &str, estimate: Option<Estimate>| {
        let estimate = estimate?;
        let interval = interval(&estimate).map_or_else(String::new, |interval| format!(" ({interval})"));
        Some(format!("{name} {} ×{interval}", short(estimate.value)))
    };
    let lines = [line("GPU time", change.time), line("relMSE", change.relmse), line("relMSE × time", change.product)];
    let lines: Vec<String> = [point.method.label()].into_iter().chain(lines.into_iter().flatten()).collect();
    lines.join("\n")
}
