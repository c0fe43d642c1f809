//! The parts of `tools/papers`, one file each, and what they share.
mod case;
pub mod eaw;
pub mod filter_times;
pub mod geo;
pub mod gif_lookup;
mod placed;
pub mod policies;
pub mod ranking;
pub mod ras_spread;
mod report;
mod sweep;
pub mod textures;
mod view;

pub use report::Section;

use tallow::report::html::{Cell, Table};

/// What the papers show and this does not, with the reason.
const NOT_REPRODUCED: &[(&str, &str, &str)] = &[
    (
        "EAW",
        "figure 12: errors against 4096 paths",
        "the paper prints pictures and no figures; ours stand beside nothing",
    ),
    ("GEO", "the dwarf: 275 and 273 behind the filter", "the model is not free; a statue stands in for it"),
    (
        "GIF",
        "the dragon and Sibenik as lit in the paper",
        "lights and cameras are not printed; ours are of the same kind, so only ratios compare",
    ),
    (
        "RAS",
        "overhead and memory of reprojection, errors while the camera turns",
        "printed by bench-reproject, see tools/results/reproject.md",
    ),
    ("RAS", "San Miguel", "the scene is not among the data"),
    (
        "RAS",
        "curves of the spread over time",
        "the figures are drawn and not printed; the order of the methods is what compares",
    ),
];

/// The section of what is not reproduced.
pub fn not_reproduced() -> Section {
    let mut section = Section::new("What is not reproduced", &[]);
    let mut table = Table::new("", &["paper", "what", "why"]);
    NOT_REPRODUCED
        .iter()
        .for_each(|(paper, what, why)| table.push(vec![Cell::text(*paper), Cell::text(*what), Cell::text(*why)]));
    section.tables.push(table);
    section
}

/// A row of texts.
fn push(table: &mut Table, cells: impl IntoIterator<Item = String>) {
    table.push(cells.into_iter().map(Cell::text).collect());
}
