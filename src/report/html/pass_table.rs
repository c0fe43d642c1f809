//! Times by pass as a table.
use super::page::{Cell, Row, Table};
use super::pass_chart::{measured, passes, time_of};
use crate::cost::document::Document;

/// A row for each measured point and a column for each pass, with the most time first.
pub fn table(document: &Document) -> Table {
    let passes = passes(document);
    let header: Vec<&str> = ["method", "GPU ms"].into_iter().chain(passes.iter().map(String::as_str)).collect();
    let mut table = Table::new("", &header);
    for (point, summary) in measured(document) {
        let name = point.method.label();
        let time = |pass: &String| match summary.passes.iter().any(|p| p.pass == *pass) {
            true => Cell::number(time_of(summary, pass)),
            false => Cell::text("–"),
        };
        let first = [Cell::text(name.clone()), Cell::number(summary.gpu_ms.value)];
        let cells = first.into_iter().chain(passes.iter().map(time)).collect();
        table.rows.push(Row { cells, image: Some(name), strong: false });
    }
    table
}
