//! Times by pass as stacked bars, one bar for each point.
use super::chart;
use super::number::short;
use crate::cost::document::{Document, Point, Summary};
use kuva::plot::BarPlot;
use kuva::render::layout::TickFormat;
use kuva::render::plots::Plot;

/// Number of passes that have a colour of their own.
const NAMED: usize = 8;
/// What all other passes are called.
const REST: &str = "other passes";

/// The passes of all points, with the most time first.
pub fn passes(document: &Document) -> Vec<String> {
    let mut totals: Vec<(String, f64)> = Vec::new();
    for pass in measured(document).flat_map(|(_, summary)| &summary.passes) {
        match totals.iter_mut().find(|(name, _)| *name == pass.pass) {
            Some((_, total)) => *total += pass.ms,
            None => totals.push((pass.pass.clone(), pass.ms)),
        }
    }
    totals.sort_by(|a, b| b.1.total_cmp(&a.1));
    totals.into_iter().map(|(name, _)| name).collect()
}

/// The points whose passes were timed.
pub fn measured(document: &Document) -> impl Iterator<Item = (&Point, &Summary)> {
    let measured = document.points.iter().filter_map(|point| Some((point, point.summary.as_ref()?)));
    measured.filter(|(_, summary)| !summary.passes.is_empty())
}

/// Median time of the pass in milliseconds; 0 if the point does not run it. Figures that no clock gives, which would make axes
/// endless, are cut.
pub fn time_of(summary: &Summary, pass: &str) -> f64 {
    const LONGEST: f64 = 1e12;
    summary.passes.iter().filter(|p| p.pass == pass).map(|p| if p.ms > 0.0 { p.ms.min(LONGEST) } else { 0.0 }).sum()
}

/// What the length of a bar is.
#[derive(Clone, Copy, PartialEq)]
pub enum Unit {
    /// Milliseconds, to compare points with each other.
    Milliseconds,
    /// Share of the point's own time, to compare passes within each point.
    Share,
}

/// One segment of a bar.
struct Segment {
    name: String,
    colour: String,
    ms: f64,
}

/// Draws the bars; empty if nothing was measured.
pub fn draw(document: &Document, unit: Unit) -> String {
    let passes = passes(document);
    // Bars are drawn from the bottom up.
    let points: Vec<_> = measured(document).collect();
    if points.is_empty() {
        return String::new();
    }
    let mut bars = BarPlot::new().with_horizontal(true).with_width(0.75);
    let mut labels = Vec::new();
    for (point, summary) in points.iter().rev() {
        let segments = segments(summary, &passes);
        let total: f64 = segments.iter().map(|s| s.ms).sum();
        let length = |ms: f64| if unit == Unit::Share { 100.0 * ms / total.max(f64::MIN_POSITIVE) } else { ms };
        let name = point.method.label();
        bars = bars.with_group(name.clone(), segments.iter().map(|s| (length(s.ms), s.colour.clone())));
        let share = |ms: f64| 100.0 * ms / total.max(f64::MIN_POSITIVE);
        labels.extend(segments.iter().map(|s| format!("{name}\n{} {} ms, {:.1} %", s.name, short(s.ms), share(s.ms))));
    }
    let legend = segments(points[0].1, &passes);
    let names = legend.iter().map(|segment| segment.name.as_str()).collect();
    let bars = bars.with_legend(names).with_stacked().with_tooltips().with_tooltip_labels(labels);
    let plots = vec![Plot::Bar(bars)];
    let (label, format) = match unit {
        Unit::Milliseconds => ("GPU time in ms", TickFormat::Auto),
        Unit::Share => ("share of GPU time in %", TickFormat::Integer),
    };
    let layout = chart::layout(&plots, 90.0 + 22.0 * points.len() as f64);
    let layout = layout.with_x_label(label).with_x_tick_format(format);
    let layout = if unit == Unit::Share { layout.with_x_axis_min(0.0).with_x_axis_max(100.0) } else { layout };
    chart::svg(plots, layout, &format!("{label} by pass"))
}

/// Every named pass, even if the point does not run it, so that a colour is one pass in all bars; then all others together.
fn segments(summary: &Summary, passes: &[String]) -> Vec<Segment> {
    let (named, rest) = passes.split_at(passes.len().min(NAMED));
    let segment = |(i, name): (usize, &String)| Segment {
        name: name.clone(),
        colour: chart::colour(i),
        ms: time_of(summary, name),
    };
    let mut segments: Vec<Segment> = named.iter().enumerate().map(segment).collect();
    if !rest.is_empty() {
        let ms = rest.iter().map(|name| time_of(summary, name)).sum();
        segments.push(Segment { name: REST.to_owned(), colour: chart::FAINT.to_owned(), ms });
    }
    segments
}
