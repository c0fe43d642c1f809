//! The table of all measured points, and the lists of those that failed or were not reached.
use super::number::{count, interval, short};
use super::page::{Cell, Row, Table};
use crate::cost::document::{Document, Errors, Estimate, Factor, Point, Summary};

/// A row for each point with a summary. Points of the front are emphasised.
pub fn measured(document: &Document) -> Table {
    let mut table = Table::new("", &COLUMNS);
    for (index, point) in document.points.iter().enumerate() {
        if let Some(summary) = &point.summary {
            let image = Some(point.method.label());
            table.rows.push(Row { cells: cells(point, summary), image, strong: document.front.contains(&index) });
        }
    }
    table
}

/// Columns of the table of measured points, the most important first.
const COLUMNS: [&str; 20] = [
    "method",
    "GPU ms",
    "relMSE",
    "FLIP",
    "speed-up",
    "error gain",
    "inefficiency",
    "relMSE less 0.1 %",
    "MSE",
    "PSNR",
    "SSIM",
    "HDR-FLIP",
    "outliers",
    "wall ms",
    "runs",
    "samples",
    "rays",
    "device MiB",
    "compile ms",
    "first run ms",
];

fn cells(point: &Point, summary: &Summary) -> Vec<Cell> {
    let first = point.runs.first();
    let whole = |n: u64| Cell { text: count(n), small: String::new(), value: Some(n as f64) };
    let maybe = |n: Option<u64>| n.map_or_else(nothing, whole);
    let time = |ms: Option<f64>| ms.map_or_else(nothing, Cell::number);
    let Errors { mse, relmse, relmse_trimmed, psnr, ssim, flip, hdr_flip, outliers } = summary.errors;
    let cells: [Cell; COLUMNS.len()] = [
        Cell::text(point.method.label()),
        estimate(Some(summary.gpu_ms)),
        estimate(relmse),
        estimate(flip),
        factor(summary.speed_up),
        factor(summary.error_gain),
        estimate(summary.inefficiency),
        estimate(relmse_trimmed),
        estimate(mse),
        estimate(psnr),
        estimate(ssim),
        estimate(hdr_flip),
        estimate(outliers),
        estimate(Some(summary.wall_ms)),
        whole(point.runs.len() as u64),
        maybe(first.map(|run| run.samples)),
        maybe(first.and_then(|run| run.rays)),
        time(point.device_bytes.map(|bytes| bytes as f64 / f64::from(1 << 20))),
        time(point.warm_up.map(|warm_up| warm_up.compile_ms)),
        time(point.warm_up.map(|warm_up| warm_up.first_run_ms)),
    ];
    cells.into()
}

fn nothing() -> Cell {
    Cell::text("–")
}

fn estimate(estimate: Option<Estimate>) -> Cell {
    let cell = |e: Estimate| Cell { small: interval(&e).unwrap_or_default(), ..Cell::number(e.value) };
    estimate.map_or_else(nothing, cell)
}

/// A factor; a tilde says that it is extrapolated.
fn factor(factor: Option<Factor>) -> Cell {
    let Some(Factor { estimate, extrapolated }) = factor else { return nothing() };
    let about = if extrapolated { "~ " } else { "" };
    let text = format!("{about}{} ×", short(estimate.value));
    Cell { text, small: interval(&estimate).unwrap_or_default(), value: Some(estimate.value) }
}

/// A row for each point that failed, with the reason; empty if none did.
pub fn failed(document: &Document) -> Table {
    let mut table = Table::new("What failed", &["method", "reason"]);
    for point in &document.points {
        if let Some(reason) = &point.failed {
            table.push(vec![Cell::text(point.method.label()), Cell::text(reason)]);
        }
    }
    table
}

/// Points that neither ran nor failed, because the measurement ended before.
pub fn not_reached(document: &Document) -> Vec<String> {
    let open = document.points.iter().filter(|point| point.summary.is_none() && point.failed.is_none());
    open.map(|point| point.method.label()).collect()
}

/// A row for each point with the command that renders its image.
pub fn commands(document: &Document) -> Table {
    let mut table = Table::new("", &["method", "command"]);
    for point in document.points.iter().filter(|point| !point.command.is_empty()) {
        table.push(vec![Cell::text(point.method.label()), Cell::text(&point.command)]);
    }
    table
}
