//! The points of a document as a table of comma-separated values, one row per point.
use super::document::{Document, Errors, Estimate, Factor, Point, Summary};

/// Columns before the errors.
const HEAD: [&str; 14] = [
    "method",
    "allocate",
    "filter",
    "rounds",
    "reproject",
    "options",
    "spp",
    "runs",
    "gpu_ms",
    "gpu_ms_low",
    "gpu_ms_high",
    "wall_ms",
    "compile_ms",
    "first_run_ms",
];
/// Columns behind the errors. A factor is extrapolated where uniform unfiltered rendering was not measured that far and its curve was
/// continued. A row that `is_other` is of another renderer: its times are wall times that were given.
const TAIL: [&str; 17] = [
    "inefficiency",
    "inefficiency_low",
    "inefficiency_high",
    "speed_up",
    "speed_up_low",
    "speed_up_high",
    "speed_up_extrapolated",
    "error_gain",
    "error_gain_low",
    "error_gain_high",
    "error_gain_extrapolated",
    "samples",
    "rays",
    "device_bytes",
    "on_front",
    "is_other",
    "failed",
];
/// Names of the errors; each has three columns.
const ERRORS: [&str; 8] = ["mse", "relmse", "relmse_trimmed", "psnr", "ssim", "flip", "hdr_flip", "outliers"];

/// The table, with a header.
pub fn csv(document: &Document) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let row = |index: usize| row(document, index);
    let rows = std::iter::once(header()).chain((0..document.points.len()).map(row));
    rows.for_each(|row| writer.write_record(row).expect("memory takes every row of one length"));
    writer.into_inner().expect("memory takes everything")
}

fn header() -> Vec<String> {
    let errors = ERRORS.iter().flat_map(|name| ["", "_low", "_high"].map(|end| format!("{name}{end}")));
    let own = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    own(&HEAD).into_iter().chain(errors).chain(own(&TAIL)).collect()
}

fn row(document: &Document, index: usize) -> Vec<String> {
    let point = &document.points[index];
    let summary = point.summary.as_ref();
    let errors = summary.map_or(Errors::from_values([None; 8]), |summary| summary.errors);
    let cells = errors.values().into_iter().flat_map(estimate);
    let on_front = document.front.contains(&index);
    head(point).into_iter().chain(cells).chain(tail(point, summary, on_front)).collect()
}

fn head(point: &Point) -> Vec<String> {
    let method = &point.method;
    let summary = point.summary.as_ref();
    let [gpu, low, high] = estimate(summary.map(|summary| summary.gpu_ms));
    vec![
        method.name(),
        method.allocate.clone(),
        method.filter.clone(),
        method.rounds.map(|n| n.to_string()).unwrap_or_default(),
        method.reproject.clone().unwrap_or_default(),
        method.options.join(" "),
        method.spp.to_string(),
        point.runs.len().to_string(),
        gpu,
        low,
        high,
        number(summary.map(|summary| summary.wall_ms.value)),
        number(point.warm_up.map(|costs| costs.compile_ms)),
        number(point.warm_up.map(|costs| costs.first_run_ms)),
    ]
}

fn tail(point: &Point, summary: Option<&Summary>, on_front: bool) -> Vec<String> {
    let first = point.runs.first();
    let [speed_up, error_gain] = [summary.and_then(|s| s.speed_up), summary.and_then(|s| s.error_gain)].map(factor);
    let inefficiency = estimate(summary.and_then(|s| s.inefficiency));
    let counts = [first.map(|run| run.samples), first.and_then(|run| run.rays), point.device_bytes];
    let counts = counts.map(|count| count.map(|n| n.to_string()).unwrap_or_default());
    let ends = [on_front.to_string(), point.is_other.to_string(), point.failed.clone().unwrap_or_default()];
    inefficiency.into_iter().chain(speed_up).chain(error_gain).chain(counts).chain(ends).collect()
}

/// A factor with its interval, and whether it is extrapolated.
fn factor(factor: Option<Factor>) -> [String; 4] {
    let [value, low, high] = estimate(factor.map(|factor| factor.estimate));
    [value, low, high, factor.map(|factor| factor.extrapolated.to_string()).unwrap_or_default()]
}

/// Value, lower and upper end; empty where they are unknown.
fn estimate(estimate: Option<Estimate>) -> [String; 3] {
    [estimate.map(|e| e.value), estimate.and_then(|e| e.low), estimate.and_then(|e| e.high)].map(number)
}

fn number(value: Option<f64>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}
