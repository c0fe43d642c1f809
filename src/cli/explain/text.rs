//! What `tallow explain` prints.
use super::{EffectRow, Sizes};
use crate::cli::readable;
use crate::report::table::{self, milliseconds};

/// Formats the rows as a table, with a dash for costs that are not known, and says of which films they are. Where none was
/// measured, their columns are left out.
pub fn text(rows: &[EffectRow], sizes: Option<Sizes>) -> String {
    let measured = sizes.is_some();
    let ms = |value: Option<f64>| value.map_or("-".to_owned(), milliseconds);
    let costs = |r: &EffectRow| {
        let added = |[low, high]: [f64; 2]| format!("{} to {}", milliseconds(low), milliseconds(high));
        let added = r.gpu_ms_added.map_or("-".to_owned(), added);
        let bytes = r.bytes.map_or("-".to_owned(), |bytes| bytes.to_string());
        [ms(r.gpu_ms_with), ms(r.gpu_ms_without), added, ms(r.compile_ms), bytes]
    };
    let cells = |r: &EffectRow| {
        let state = if r.on { "on" } else { "off" };
        let costs = measured.then(|| costs(r)).into_iter().flatten();
        [r.effect, state].map(str::to_owned).into_iter().chain(costs).chain([readable(&r.called_for_by)]).collect()
    };
    let costs = ["GPU ms with", "GPU ms without", "GPU ms added", "compile ms", "bytes"];
    let costs = measured.then_some(costs).into_iter().flatten();
    let header: Vec<_> = ["effect", ""].into_iter().chain(costs).chain(["called for by"]).collect();
    let films = |Sizes { timed_size: [w, h], film_size: [width, height] }| {
        format!("GPU ms: one sample of each of {w} x {h} pixels; bytes: a film of {width} x {height} pixels\n")
    };
    table::text(&header, &rows.iter().map(cells).collect::<Vec<_>>()) + &sizes.map(films).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_not_measured_are_dashes() {
        let on = EffectRow {
            effect: "ggx",
            on: true,
            called_for_by: "vase".to_owned(),
            bytes: Some(64),
            ..EffectRow::default()
        };
        let rows = [on, EffectRow { effect: "lens", ..EffectRow::default() }];
        let words = |table: &str, line: usize| {
            table.lines().nth(line).unwrap().split_whitespace().map(str::to_owned).collect::<Vec<_>>()
        };
        let table = text(&rows, Some(Sizes { timed_size: [128, 128], film_size: [640, 480] }));
        assert_eq!(words(&table, 1), ["ggx", "on", "-", "-", "-", "-", "64", "vase"]);
        assert_eq!(words(&table, 2), ["lens", "off", "-", "-", "-", "-", "-"]);
        assert!(table.ends_with("128 x 128 pixels; bytes: a film of 640 x 480 pixels\n"), "{table}");
        assert_eq!(words(&text(&rows, None), 1), ["ggx", "on", "vase"]);
    }
}
