//! Error against time: every point with its intervals, and the Pareto front.
use super::chart;
use super::number::{interval, short};
use crate::cost::document::{Document, Errors, Estimate, Point, Summary};
use kuva::plot::scatter::MarkerShape;
use kuva::plot::{LinePlot, ScatterPlot};
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;

/// A metric that is drawn over time; lower is better.
#[derive(Clone, Copy)]
pub struct Metric {
    /// Its name.
    pub name: &'static str,
    /// Where it stands among the errors of a point.
    pub of: fn(&Errors<Estimate>) -> Option<Estimate>,
}

/// The metrics that have a chart, the default first.
pub const METRICS: [Metric; 2] =
    [Metric { name: "relMSE", of: |errors| errors.relmse }, Metric { name: "FLIP", of: |errors| errors.flip }];

/// A chart of one metric.
pub struct Chart {
    pub name: &'static str,
    /// The drawing; empty if there is no point to draw.
    pub svg: String,
    /// Points that logarithmic axes cannot show.
    pub missing: Vec<String>,
}

/// One measured point on the axes.
struct Mark<'a> {
    point: &'a Point,
    summary: &'a Summary,
    time: Estimate,
    error: Estimate,
}

/// Draws one metric over GPU time on logarithmic axes.
pub fn draw(document: &Document, metric: Metric) -> Chart {
    let measured = document.points.iter().filter_map(|point| Some((point, point.summary.as_ref()?)));
    let (marks, others): (Vec<_>, Vec<_>) = measured
        .map(|(point, summary)| (point, summary, (metric.of)(&summary.errors)))
        .partition(|(_, summary, error)| {
            chart::is_drawn(summary.gpu_ms.value) && error.is_some_and(|error| chart::is_drawn(error.value))
        });
    let missing = others.into_iter().map(|(point, ..)| point.method.label()).collect();
    let marks: Vec<Mark> = marks
        .into_iter()
        .filter_map(|(point, summary, error)| Some(Mark { point, summary, time: summary.gpu_ms, error: error? }))
        .collect();
    let svg = if marks.is_empty() { String::new() } else { plot(&marks, metric.name) };
    Chart { name: metric.name, svg, missing }
}

fn plot(marks: &[Mark], name: &str) -> String {
    let mut lines = Vec::new();
    let mut scatters = Vec::new();
    for series in series(marks) {
        let path = LinePlot::new().with_data(series.marks.iter().map(|m| (m.time.value, m.error.value)));
        lines.push(Plot::Line(path.with_color(series.colour.clone()).with_stroke_width(1.0)));
        scatters.push(Plot::Scatter(scatter(&series, name)));
    }
    let front = LinePlot::new().with_data(front(marks)).with_step().with_dashed();
    let front = front.with_color(chart::INK).with_stroke_width(1.5).with_legend("Pareto front");
    let plots: Vec<Plot> = lines.into_iter().chain([Plot::Line(front)]).chain(scatters).collect();
    let layout = chart::layout(&plots, 560.0).with_log_scale();
    let layout = limits(layout, marks).with_x_label("GPU time in ms").with_y_label(name);
    chart::svg(
        plots,
        chart::plain_ticks(layout),
        &format!("{name} against GPU time, both logarithmic, with the Pareto front"),
    )
}

/// Points of one method, which differ only in their samples per pixel.
struct Series<'a> {
    name: String,
    colour: String,
    shape: MarkerShape,
    marks: Vec<&'a Mark<'a>>,
}

/// Methods in the order of the document. Each filter has a colour, and all else that makes a method has a shape.
fn series<'a>(marks: &'a [Mark<'a>]) -> Vec<Series<'a>> {
    let mut filters = Vec::new();
    let mut others = Vec::new();
    let mut all: Vec<Series> = Vec::new();
    for mark in marks {
        let method = &mark.point.method;
        let name = method.name();
        if let Some(series) = all.iter_mut().find(|series| series.name == name) {
            series.marks.push(mark);
            continue;
        }
        let colour = chart::colour(index_of(&mut filters, &method.filter));
        let other = index_of(&mut others, &(&method.allocate, method.rounds, &method.reproject, &method.options));
        all.push(Series { name, colour, shape: chart::shape(other), marks: vec![mark] });
    }
    all
}

/// The place of an item in the list, at the end of which it is put if it is new.
fn index_of<T: PartialEq + Clone>(list: &mut Vec<T>, item: &T) -> usize {
    list.iter().position(|known| known == item).unwrap_or_else(|| {
        list.push(item.clone());
        list.len() - 1
    })
}

fn scatter(series: &Series, name: &str) -> ScatterPlot {
    let at = |m: &&Mark| (m.time.value, m.error.value);
    let plot = ScatterPlot::new()
        .with_data(series.marks.iter().map(at))
        .with_x_err_asymmetric(series.marks.iter().map(|m| arms(&m.time)))
        .with_y_err_asymmetric(series.marks.iter().map(|m| arms(&m.error)))
        .with_color(series.colour.clone())
        .with_marker(series.shape)
        .with_size(5.0)
        .with_tooltips()
        .with_tooltip_labels(series.marks.iter().map(|m| tooltip(m, name)));
    // The many single points of an ablation have a chart of their own.
    let is_step = series.marks.len() == 1 && !series.marks[0].point.method.options.is_empty();
    if is_step { plot.with_size(3.0) } else { plot.with_legend(series.name.clone()) }
}

/// Lengths of an error bar. It ends at a tenth of the value, because a logarithmic axis has no 0, and at its tenfold, so that a
/// point of few runs does not push all others together.
fn arms(estimate: &Estimate) -> (f64, f64) {
    let low = estimate.low.unwrap_or(estimate.value).max(0.1 * estimate.value);
    let high = estimate.high.unwrap_or(estimate.value).min(10.0 * estimate.value);
    ((estimate.value - low).max(0.0), (high - estimate.value).max(0.0))
}

/// The first line is the point's name, by which scripts find its image.
fn tooltip(mark: &Mark, name: &str) -> String {
    let with_interval = |estimate: &Estimate| match interval(estimate) {
        Some(interval) => format!("{} ({interval})", short(estimate.value)),
        None => short(estimate.value),
    };
    let mut lines = vec![mark.point.method.label()];
    lines.push(format!("GPU time {} ms", with_interval(&mark.time)));
    lines.push(format!("{name} {}", with_interval(&mark.error)));
    if let Some(factor) = &mark.summary.speed_up {
        lines.push(format!("{} times as fast as uniform, unfiltered", short(factor.estimate.value)));
    }
    lines.push(format!("{} runs", mark.point.runs.len()));
    lines.join("\n")
}

/// Points that no other point beats in both time and error, the fastest first.
fn front(marks: &[Mark]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<(f64, f64)> = marks.iter().map(|m| (m.time.value, m.error.value)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut best = f64::INFINITY;
    sorted.retain(|&(_, error)| {
        let better = error < best;
        best = best.min(error);
        better
    });
    sorted
}

/// Axes that hold every point and its bars with a margin.
fn limits(layout: Layout, marks: &[Mark]) -> Layout {
    let range = |of: fn(&Mark) -> Estimate| {
        let ends = marks.iter().map(of).map(|e| (e.value - arms(&e).0, e.value + arms(&e).1));
        let (low, high) = ends.fold((f64::INFINITY, 0.0_f64), |all, end| (all.0.min(end.0), all.1.max(end.1)));
        // Ticks are at 1, 2 and 5, so that at least two are within a factor of 5.
        let margin = (5.0 * low / high).sqrt().max(1.25);
        (low / margin, high * margin)
    };
    let ((left, right), (bottom, top)) = (range(|m| m.time), range(|m| m.error));
    layout.with_x_axis_min(left).with_x_axis_max(right).with_y_axis_min(bottom).with_y_axis_max(top)
}
