//! `tallow explain`: what a scene calls for, and what that costs.
use super::{Exit, print, print_json};
use crate::error::{Error, Result};
use crate::report::table::{self, milliseconds};
use serde::Serialize;
use std::path::PathBuf;

/// List every effect: on or off, what calls for it, and what it costs
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (.toml) or model (.obj)
    pub scene: PathBuf,
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Print one JSON array
    #[arg(long)]
    pub json: bool,
}

/// One effect. Costs are none where they were not measured.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// Name of the effect.
    pub effect: &'static str,
    /// Whether the scene calls for it.
    pub on: bool,
    /// Object, material or setting that does; empty when off.
    pub called_for_by: String,
    /// GPU time of one sample per pixel with the effect compiled in.
    pub gpu_ms_with: Option<f64>,
    /// The same without it.
    pub gpu_ms_without: Option<f64>,
    /// Time to compile the pipelines that the effect adds.
    pub compile_ms: Option<f64>,
    /// Device memory that the effect adds.
    pub bytes: Option<u64>,
}

/// Runs the subcommand.
///
/// # Errors
/// As a render of the scene.
pub fn run(args: &Args) -> Result<Exit> {
    let rows = rows(args)?;
    if args.json {
        print_json(&rows)?;
    } else {
        print(&text(&rows))?;
    }
    Ok(Exit::Done)
}

fn rows(args: &Args) -> Result<Vec<Row>> {
    let scene = args.scene.display();
    Err(Error::Device(format!("{scene}: this build has no renderer")))
}

/// The rows as a table; a dash stands for what was not measured.
pub fn text(rows: &[Row]) -> String {
    let ms = |value: Option<f64>| value.map_or("-".to_owned(), milliseconds);
    let cells = |r: &Row| {
        vec![
            r.effect.to_owned(),
            if r.on { "on" } else { "off" }.to_owned(),
            ms(r.gpu_ms_with),
            ms(r.gpu_ms_without),
            ms(r.compile_ms),
            r.bytes.map_or("-".to_owned(), |b| b.to_string()),
            r.called_for_by.clone(),
        ]
    };
    let header = ["effect", "", "GPU ms with", "GPU ms without", "compile ms", "bytes", "called for by"];
    table::text(&header, &rows.iter().map(cells).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::{Row, text};

    #[test]
    fn costs_not_measured_are_dashes() {
        let on = Row { effect: "ggx", on: true, called_for_by: "vase".to_owned(), bytes: Some(64), ..Row::default() };
        let table = text(&[on, Row { effect: "lens", ..Row::default() }]);
        let last = |line: usize| table.lines().nth(line).unwrap().split_whitespace().collect::<Vec<_>>();
        assert_eq!(last(1), ["ggx", "on", "-", "-", "-", "64", "vase"]);
        assert_eq!(last(2), ["lens", "off", "-", "-", "-", "-"]);
    }
}
