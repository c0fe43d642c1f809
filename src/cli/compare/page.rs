//! The result of a statistical test as a web page.
use super::report::Report;
use super::{replay, words};
use crate::image::significance::{Finding, Level, overlay, suspects};
use crate::report::html::viewer::{Image, Viewer};
use crate::report::html::{Cell, Page, Section, Table};

/// A page with the verdict, both images and the map side by side, what was found at every scale, and how the worst pixels are
/// rendered again.
pub fn html(report: &Report) -> String {
    let [a, b] = report.sides.each_ref().map(|side| side.picture());
    let overlay = overlay(&report.outcome, &b);
    let image = |name: &str, caption: String, picture, rank| Image { name: name.to_owned(), caption, picture, rank };
    let [a_path, b_path] = report.sides.each_ref().map(|side| side.path.display().to_string());
    let legend = format!(
        "where they differ: orange where A is brighter, blue where it is darker, full colour from {} on",
        words::percent(overlay.full.into())
    );
    let images = vec![
        image("A", a_path.clone(), &a, 1),
        image("map", legend, &overlay.picture, 2),
        image("B", b_path.clone(), &b, 0),
    ];
    let viewers = vec![Viewer { group: "images".to_owned(), images, reference: Some(2) }];
    let section = Section { title: String::new(), texts: texts(report), viewers, tables: tables(report) };
    Page { title: format!("{a_path} and {b_path}"), facts: facts(report), sections: vec![section] }.html()
}

fn facts(report: &Report) -> Vec<(String, String)> {
    let mut facts = vec![("verdict".to_owned(), words::verdict(report))];
    for (name, side) in ["A", "B"].into_iter().zip(report.sides) {
        let said = |key: &str| side.film.metadata.get(key).cloned();
        let device = [said("device"), said("driver"), said("cpu")].into_iter().flatten().collect::<Vec<_>>().join(", ");
        facts.push((name.to_owned(), side.path.display().to_string()));
        facts.extend(said("scene").map(|scene| (format!("{name}, scene"), scene)));
        facts.extend((!device.is_empty()).then(|| (format!("{name}, rendered on"), device)));
        facts.extend(said("sampleRanges").map(|ranges| (format!("{name}, samples"), ranges)));
    }
    facts
}

fn texts(report: &Report) -> Vec<String> {
    let options = &report.options;
    let mut texts = vec![format!(
        "Images with the same expectation are called different with a probability of {} at most, and among the regions that \
         are named below no larger share is named wrongly. Differences up to {} are accepted.",
        words::percent(options.false_alarms),
        words::percent(options.accept)
    )];
    texts.extend(words::filtered(report));
    if report.outcome.left_out > 0 {
        texts.push(format!("{} pixels with fewer than two samples were left out.", report.outcome.left_out));
    }
    texts
}

fn tables(report: &Report) -> Vec<Table> {
    let mut scales = Table::new("Scales", &["scale", "regions", "different", "seen from"]);
    scales.note =
        "A difference of any one channel from there on would have been seen nine times in ten, in nine of ten regions."
            .to_owned();
    report.outcome.levels.iter().for_each(|level| scales.push(scale(level)));
    let mut regions = Table::new("Where they differ", &HEADER);
    regions.note = format!("The surest regions of every scale. {}", words::RELATIVE);
    report.outcome.levels.iter().rev().flat_map(|level| &level.worst).for_each(|found| regions.push(row(found)));
    let [a, b] = report.sides.each_ref().map(|side| &side.estimate);
    let mut pixels = Table::new("Pixels to look at", &HEADER);
    pixels.note = "The pixels that differ most by themselves, in the finest regions that differ.".to_owned();
    let mut commands = Table::new("The same pixels again", &["image", "command"]);
    for found in suspects(a, b, &report.outcome) {
        pixels.push(row(&found));
        for (name, side) in ["a", "b"].into_iter().zip(report.sides) {
            let lines = replay::commands(&side.film, found.place.first, name);
            let lines = lines.unwrap_or_else(|what| vec![format!("cannot be rendered again: {what}")]);
            lines.into_iter().for_each(|line| commands.push(vec![Cell::text(name), Cell::text(line)]));
        }
    }
    [scales, regions, pixels, commands].into_iter().filter(|table| !table.rows.is_empty()).collect()
}

const HEADER: [&str; 7] = ["region", "channel", "A", "B", "difference", "standard error", "p"];

fn percent(share: f64) -> Cell {
    Cell { value: Some(share), ..Cell::text(words::percent(share)) }
}

fn scale(level: &Level) -> Vec<Cell> {
    let count = |n: usize| Cell { value: Some(n as f64), ..Cell::text(n.to_string()) };
    vec![Cell::text(level.scale.to_string()), count(level.regions), count(level.different), percent(level.visible)]
}

fn row(found: &Finding) -> Vec<Cell> {
    let Finding { place, channel, means: [a, b], difference, error, p } = found;
    let channel = Cell::text(words::CHANNELS[*channel]);
    let numbers = [Cell::number(*a), Cell::number(*b), percent(*difference), percent(*error), Cell::number(*p)];
    [vec![Cell::text(place.to_string()), channel], numbers.into()].concat()
}
