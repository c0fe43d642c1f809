//! Tables of the figures, and what they say together.
use crate::contest::{Contender, Row, Score};
use crate::view::View;
use anyhow::Result;
use std::fmt::Write as _;
use std::path::Path;
use tallow::report::table;

pub const LEGEND: &str = "relMSE, FLIP and SSIM against the reference; ms of a filter behind a first run (Open Image Denoise by \
                          the wall clock).\n! the reference's own relMSE, as its samples tell, is above a tenth of the least one \
                          of the row.\nexpected: the relMSE of the noisy image and of its own that a filter tells of itself.";

/// All rows so far.
#[derive(Default)]
pub struct Results {
    pub rows: Vec<Row>,
}

/// The rows of one view.
pub fn table(view: &View, rows: &[Row], contenders: &[Contender]) -> String {
    let [width, height] = view.size;
    let reference =
        rows.first().map(|row| format!("{:.0} spp, own relMSE {:.2e}", row.reference_spp, row.reference_relmse));
    let mut text = format!("{} {width}x{height}; reference: {}\n", view.name, reference.unwrap_or_default());
    let of_filter = |name: &str| [&format!("{name}: relMSE"), "FLIP", "SSIM", "ms"].map(str::to_owned);
    let of_filters = names(contenders).into_iter().flat_map(of_filter);
    let header: Vec<String> =
        ["spp", ""].map(str::to_owned).into_iter().chain(of_filters).chain(["expected".to_owned()]).collect();
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    text += &table::text(&header, &rows.iter().map(cells).collect::<Vec<_>>());
    text
}

fn names(contenders: &[Contender]) -> Vec<&str> {
    ["noisy"].into_iter().chain(contenders.iter().map(|c| c.name.as_str())).collect()
}

fn cells(row: &Row) -> Vec<String> {
    let mark = if row.reference_relmse > 0.1 * row.least_relmse() { "!" } else { "" };
    let of = |score: &Score| {
        let ms = score.ms.map_or("-".to_owned(), |ms| format!("{ms:.1}"));
        [format!("{:.5}", score.relmse), format!("{:.4}", score.flip), format!("{:.4}", score.ssim), ms]
    };
    let told = row.scores.iter().find_map(|score| score.expected);
    let told = told.map_or("-".to_owned(), |told| format!("{:.5}, {:.5}", told.before, told.after));
    [row.spp.to_string(), mark.to_owned()].into_iter().chain(row.scores.iter().flat_map(of)).chain([told]).collect()
}

impl Results {
    /// Writes all figures, one line an image.
    pub fn write(&self, contenders: &[Contender], path: &Path) -> Result<()> {
        let mut text =
            "scene,spp,filter,relmse,flip,ssim,ms,expected_before,expected_after,reference_spp,reference_relmse\n"
                .to_owned();
        for row in &self.rows {
            for (name, s) in names(contenders).iter().zip(&row.scores) {
                let ms = s.ms.map_or(String::new(), |ms| ms.to_string());
                let told = s.expected.map_or(",".to_owned(), |told| format!("{},{}", told.before, told.after));
                let reference = format!("{},{}", row.reference_spp, row.reference_relmse);
                let Score { relmse, flip, ssim, .. } = s;
                writeln!(text, "{},{},{name},{relmse},{flip},{ssim},{ms},{told},{reference}", row.view, row.spp)?;
            }
        }
        Ok(std::fs::write(path, text)?)
    }

    /// How every contender does beside the noisy image and beside the last contender, over all scenes.
    pub fn summary(&self, contenders: &[Contender]) -> String {
        let mut spp: Vec<u32> = self.rows.iter().map(|row| row.spp).collect();
        spp.sort_unstable();
        spp.dedup();
        let last = contenders.len();
        let line = |(i, contender): (usize, &Contender)| {
            let of_spp = spp.iter().map(|&n| {
                let rows = || self.rows.iter().filter(move |row| row.spp == n);
                mean_ratio(rows().map(|row| row.scores[i + 1].relmse / row.scores[last].relmse))
            });
            let count = |holds: &dyn Fn(&Row) -> bool| self.rows.iter().filter(|row| holds(row)).count().to_string();
            let besides = [
                count(&|row| row.scores[i + 1].flip <= row.scores[last].flip),
                count(&|row| row.scores[i + 1].relmse > row.scores[0].relmse),
            ];
            [contender.name.clone()].into_iter().chain(of_spp).chain(besides).collect::<Vec<_>>()
        };
        let of_spp = spp.iter().map(|n| format!("{n} spp"));
        let besides = ["FLIP not above it".to_owned(), "relMSE above noisy".to_owned()];
        let header: Vec<String> = ["filter".to_owned()].into_iter().chain(of_spp).chain(besides).collect();
        let header: Vec<&str> = header.iter().map(String::as_str).collect();
        let named = contenders.last().map_or("-", |c| c.name.as_str());
        let title =
            format!("relMSE over that of {named} (geometric means over scenes), and rows of {}", self.rows.len());
        format!("{title}\n{}", table::text(&header, &contenders.iter().enumerate().map(line).collect::<Vec<_>>()))
    }
}

fn mean_ratio(ratios: impl Iterator<Item = f64>) -> String {
    let logs: Vec<f64> = ratios.map(f64::ln).collect();
    format!("{:.2}", (logs.iter().sum::<f64>() / logs.len() as f64).exp())
}
