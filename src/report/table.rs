//! Text tables, and the table of pass times in particular.
use crate::gpu::{PassTime, by_pass};
use comfy_table::{CellAlignment, Table, presets};
use serde::Serialize;

/// Statistics over all calls of one pass.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassRow {
    /// Name of the pass.
    pub pass: &'static str,
    /// Number of times that it ran.
    pub calls: usize,
    /// Median duration in milliseconds; of an even number of calls, the lower of the middle two.
    pub median_ms: f64,
    /// Longest duration in milliseconds.
    pub max_ms: f64,
    /// Its share of the total time of all passes, 0 to 1.
    pub share: f64,
}

/// Returns one row per pass, in the order in which the passes first ran.
pub fn summarise(times: &[PassTime]) -> Vec<PassRow> {
    let passes = by_pass(times);
    let total: u64 = passes.iter().flat_map(|(_, durations)| durations).sum();
    passes.into_iter().map(|(name, durations)| row(name, durations, total)).collect()
}

fn row(pass: &'static str, mut durations: Vec<u64>, total: u64) -> PassRow {
    durations.sort_unstable();
    let ms = |ns: u64| ns as f64 * 1e-6;
    PassRow {
        pass,
        calls: durations.len(),
        median_ms: ms(durations[(durations.len() - 1) / 2]),
        max_ms: ms(durations[durations.len() - 1]),
        share: durations.iter().sum::<u64>() as f64 / total.max(1) as f64,
    }
}

/// Formats the rows as a text table.
pub fn timing_table(rows: &[PassRow]) -> String {
    let cells = |r: &PassRow| {
        let share = format!("{:.1} %", 100.0 * r.share);
        vec![r.pass.to_owned(), r.calls.to_string(), milliseconds(r.median_ms), milliseconds(r.max_ms), share]
    };
    text(&["pass", "calls", "median ms", "max ms", "share"], &rows.iter().map(cells).collect::<Vec<_>>())
}

/// Formats milliseconds with three decimals, because GPU clocks resolve about a microsecond.
pub fn milliseconds(ms: f64) -> String {
    format!("{ms:.3}")
}

/// Formats aligned columns under a header. A column whose cells all start with a digit or a dash is aligned right. Every
/// line ends in a newline.
pub fn text(header: &[&str], rows: &[Vec<String>]) -> String {
    let is_number = |row: &Vec<String>, i: usize| row[i].starts_with(|c: char| c.is_ascii_digit() || c == '-');
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.iter().copied());
    table.add_rows(rows);
    for (i, column) in table.column_iter_mut().enumerate() {
        column.set_padding((0, 2));
        if !rows.is_empty() && rows.iter().all(|row| is_number(row, i)) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table.lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(durations: &[(&'static str, u64)]) -> Vec<PassTime> {
        durations.iter().map(|&(name, ns)| PassTime { name, begin_ns: 1_000, end_ns: 1_000 + ns }).collect()
    }

    #[test]
    fn rows_are_medians_maxima_and_shares_in_order_of_first_call() {
        let ms = 1_000_000;
        let rows = summarise(&times(&[("path", 5 * ms), ("accumulate", ms), ("path", 3 * ms), ("path", 11 * ms)]));
        let path = PassRow { pass: "path", calls: 3, median_ms: 5.0, max_ms: 11.0, share: 0.95 };
        let fold = PassRow { pass: "accumulate", calls: 1, median_ms: 1.0, max_ms: 1.0, share: 0.05 };
        assert_eq!(rows, [path, fold]);
    }

    #[test]
    fn a_clock_that_runs_backwards_and_no_passes_at_all_are_survived() {
        assert_eq!(summarise(&[PassTime { name: "odd", begin_ns: 9, end_ns: 3 }])[0].max_ms, 0.0);
        assert_eq!(timing_table(&summarise(&[])), "pass  calls  median ms  max ms  share\n");
    }

    #[test]
    fn numbers_are_flush_right_and_words_flush_left() {
        let rows = [vec!["a".to_owned(), "7".to_owned()], vec!["long".to_owned(), "123".to_owned()]];
        assert_eq!(text(&["name", "n"], &rows), "name    n\na       7\nlong  123\n");
    }
}
