//! The page of a cost measurement.
use super::error_chart::{self, Chart, METRICS};
use super::number::{percent, short};
use super::page::Table;
use super::pass_chart::{self, Unit};
use super::viewer::{Image, Viewer};
use super::{Frame, changes, pass_table, point_table};
use crate::cost::Images;
use crate::cost::document::{Document, Machine, NoiseKind, Point, ReferenceInfo, ReferenceSource, Verdict};
use crate::cost::interval::median_is_covered;
use askama::Template;

/// What `cost.html` shows.
#[derive(Template)]
#[template(path = "cost.html", config = "src/report/html/askama.toml")]
struct CostPage<'a> {
    frame: Frame<'a>,
    document: &'a Document,
    facts: Vec<(String, String)>,
    bars: String,
    open_findings: usize,
    reference_notes: &'a [String],
    charts: Vec<Chart>,
    has_others: bool,
    change_chart: String,
    changes: Table,
    points: Table,
    milliseconds: String,
    shares: String,
    passes: Table,
    failed: Table,
    not_reached: Vec<String>,
    commands: Table,
    viewer: String,
}

/// The page of a measurement, as the content of a file. Points without an image are in its tables and plots all the same.
pub fn cost(document: &Document, images: Option<&Images>) -> String {
    let title = format!("What accuracy costs: {}", document.scene.name);
    let page = CostPage {
        frame: Frame::new(&title),
        document,
        facts: facts(document),
        bars: bars(document),
        open_findings: document.findings.iter().filter(|finding| CostPage::is_open(&finding.verdict)).count(),
        reference_notes: &document.reference.notes,
        charts: METRICS.iter().map(|&metric| error_chart::draw(document, metric)).collect(),
        has_others: document.points.iter().any(|point| point.is_other),
        change_chart: changes::draw(document),
        changes: changes::table(document),
        points: point_table::measured(document),
        milliseconds: pass_chart::draw(document, Unit::Milliseconds),
        shares: pass_chart::draw(document, Unit::Share),
        passes: pass_table::table(document),
        failed: point_table::failed(document),
        not_reached: point_table::not_reached(document),
        commands: point_table::commands(document),
        viewer: images.map(|images| viewer(document, images).html()).unwrap_or_default(),
    };
    page.to_string()
}

impl CostPage<'_> {
    /// Whether a finding leaves its question open.
    fn is_open(verdict: &Verdict) -> bool {
        *verdict == Verdict::TooNoisy
    }
}

fn facts(document: &Document) -> Vec<(String, String)> {
    let Document { scene, machine, measurement, software, .. } = document;
    let commit = software.commit.as_ref().map(|commit| format!(", commit {commit}")).unwrap_or_default();
    let confidence = percent(measurement.confidence);
    let intervals = match has_ranges(document, false) {
        false => format!("{confidence} % intervals"),
        true => format!("{confidence} % intervals of errors and factors, ranges of times"),
    };
    let runs = format!("{} runs of each point, {intervals}", runs(document));
    let cores = if machine.cores == 1 { "1 core".to_owned() } else { format!("{} cores", machine.cores) };
    let rays = if machine.ray_queries { ", rays by ray queries" } else { "" };
    let frame = scene.judged.map(|judged| format!(", frame {} at {} a second", judged.frame, judged.fps));
    let mut facts = vec![
        ("scene", format!("{}, {} x {} pixels{}", scene.path, scene.width, scene.height, frame.unwrap_or_default())),
        ("device", format!("{} ({}), {}{rays}", machine.device, machine.kind, machine.driver)),
        ("processor", format!("{}, {cores}", machine.cpu)),
        ("reference", reference(&document.reference)),
        ("measured", runs),
        ("program", format!("Tallow {}{commit}", software.version)),
    ];
    if let Some(clocks) = clocks(machine) {
        facts.push(("clocks", clocks));
    }
    facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// What the bars of the plots are.
fn bars(document: &Document) -> String {
    let confidence = percent(document.measurement.confidence);
    let of_times = match [false, true].map(|others| has_ranges(document, others)) {
        [false, false] => return format!("Bars are {confidence} % intervals."),
        [false, true] => "times of other renderers",
        [true, _] => "times",
    };
    format!(
        "Bars of errors are {confidence} % intervals; those of {of_times} are the range of the runs, which are too few for such an interval."
    )
}

/// Whether a time of ours, or of others, has the range of its runs in place of an interval.
fn has_ranges(document: &Document, others: bool) -> bool {
    let confidence = document.measurement.confidence;
    let points = document.points.iter().filter(|point| point.is_other == others && point.failed.is_none());
    let runs = points.map(|point| point.runs.len()).filter(|&runs| runs > 0);
    runs.min().is_some_and(|fewest| !median_is_covered(fewest, confidence))
}

/// How many runs each point has, and should have.
fn runs(document: &Document) -> String {
    let repeats = document.measurement.repeats;
    let made = document.points.iter().filter(|point| !point.is_other).map(|point| point.runs.len());
    if document.complete { repeats.to_string() } else { format!("up to {} of {repeats}", made.max().unwrap_or(0)) }
}

/// Where the system tells them.
fn clocks(machine: &Machine) -> Option<String> {
    let range = |name: &str, mhz: Option<[u64; 2]>| {
        let [least, most] = mhz?;
        Some(if least == most { format!("{name} {least} MHz") } else { format!("{name} {least} to {most} MHz") })
    };
    let all: Vec<_> =
        [range("processor", machine.cpu_mhz), range("device", machine.device_mhz)].into_iter().flatten().collect();
    (!all.is_empty()).then(|| all.join(", "))
}

fn reference(reference: &ReferenceInfo) -> String {
    let mut text = match (reference.source, &reference.path) {
        (ReferenceSource::Given, Some(path)) => path.clone(),
        (ReferenceSource::Given, None) => "given".to_owned(),
        (ReferenceSource::Rendered, _) => "rendered".to_owned(),
    };
    if let Some(spp) = reference.spp {
        text += &format!(", {spp} samples per pixel");
    }
    let relmse = reference.relmse.map(short);
    text += &match (reference.noise, relmse) {
        (NoiseKind::Measured, Some(relmse)) => format!("; its own relMSE, {relmse}, is subtracted"),
        (NoiseKind::Bound, Some(relmse)) => format!("; its own relMSE, not subtracted, is at most {relmse}"),
        _ => "; its own noise is unknown".to_owned(),
    };
    text
}

/// Every point that has an image, and the reference. If the page would be too large, points off the front go first, and of these
/// the last.
fn viewer<'a>(document: &Document, images: &'a Images) -> Viewer<'a> {
    let mut shots: Vec<Image> = Vec::new();
    for (index, picture) in &images.points {
        let Some(point) = document.points.get(*index) else { continue };
        let place = 1 + shots.len();
        let is_first = document.front.contains(index) || point.method.is_baseline();
        let rank = if is_first { place } else { place + images.points.len() };
        shots.push(Image { name: point.method.label(), caption: caption(point), picture, rank });
    }
    let reference = Image { name: "reference".into(), caption: String::new(), picture: &images.reference, rank: 0 };
    shots.push(reference);
    Viewer { group: "points".to_owned(), reference: Some(shots.len() - 1), images: shots }
}

fn caption(point: &Point) -> String {
    let Some(summary) = &point.summary else { return String::new() };
    let relmse = summary.errors.relmse.map(|e| format!(", relMSE {}", short(e.value))).unwrap_or_default();
    format!("{} ms{relmse}", short(summary.gpu_ms.value))
}
