//! Pages of reports, made of a document that nothing was measured for.
use crate::measurement;
use tallow::cost::document::{Document, Estimate, Verdict};
use tallow::cost::table as cost_table;
use tallow::report::html;
use tallow::report::html::viewer::{Image, Viewer};
use tallow::report::html::{Cell, Page, Section, Table};

/// Ends texts, attributes, scripts and comments, and would run a script.
const HOSTILE: &str = r#"x"'></title></script><script>alert(1)</script><img src=x onerror=alert(2)>&amp;<!--"#;
const ESCAPED: &str = "&#60;script&#62;alert(1)&#60;/script&#62;";

/// A page with the images of all its points.
fn page(document: &Document) -> String {
    html::cost(document, Some(&measurement::images(document)))
}

/// What readers see: the page without the scripts that it ends with.
fn content(page: &str) -> &str {
    &page[..page.rfind("</main>").unwrap()]
}

/// Values of all attributes of this name.
fn attributes<'a>(page: &'a str, name: &str) -> Vec<&'a str> {
    let start = format!(" {name}=\"");
    page.split(start.as_str()).skip(1).map(|rest| rest.split('"').next().unwrap()).collect()
}

#[test]
fn every_point_is_in_plots_tables_and_viewer_or_has_a_reason() {
    let document = measurement::document("box");
    let page = page(&document);
    let measured = document.points.iter().filter(|point| point.summary.is_some());
    let labels: Vec<String> = measured.map(|point| point.method.label()).collect();
    assert_eq!(labels.len(), 36);
    for label in &labels {
        assert!(page.contains(&format!("<td>{label}</td>")), "{label}: in no table");
        assert!(page.contains(&format!("<title>{label}\nGPU time")), "{label}: in no plot");
        assert!(page.contains(&format!("<title>{label}\npath ")), "{label}: has no bar");
    }
    let names = attributes(&page, "data-name");
    assert_eq!(names, labels.iter().map(String::as_str).chain(["reference"]).collect::<Vec<_>>());
    assert!(page.contains("filter svgf: the image has no normals"));
    assert!(page.contains("both + svgf, 3 rounds, 16 spp."), "the point that was not reached");
    assert!(page.contains("is not complete"));
    for finding in &document.findings {
        assert!(page.contains(&finding.text.replace('\'', "&#39;")), "{}", finding.text);
    }
    assert!(page.contains("What the data cannot tell (1)"));
    let change = "<td>both + auto, 4 spp</td><td>max-depth 4</td><td data-order=\"0.7\" class=\"number\">0.700 ×<small>0.636 to 0.770</small>";
    assert!(page.contains(change), "no row of what options change");
    assert!(page.contains("<title>both + auto, max-depth 4, 4 spp\nGPU time 0.700 × (0.636 to 0.770)\nrelMSE 1.20 ×"));
}

#[test]
fn the_table_tells_extrapolated_factors_and_other_renderers() {
    let mut document = measurement::document("box");
    document.points[0].is_other = true;
    let bytes = cost_table::csv(&document);
    let mut reader = csv::Reader::from_reader(&bytes[..]);
    let head = reader.headers().unwrap().clone();
    let place = |name: &str| head.iter().position(|column| column == name).unwrap();
    let columns = ["speed_up_extrapolated", "error_gain_extrapolated", "is_other"].map(place);
    for (i, (row, point)) in reader.records().zip(&document.points).enumerate() {
        let row = row.unwrap();
        let extrapolated =
            point.summary.as_ref().map_or("", |_| if point.method.spp == 256 { "true" } else { "false" });
        let told = [extrapolated, extrapolated, if i == 0 { "true" } else { "false" }];
        assert_eq!(columns.map(|column| &row[column]), told, "{row:?}");
    }
}

#[test]
fn times_of_few_runs_have_ranges_and_no_intervals() {
    let mut document = measurement::document("box");
    let mut says = |runs: usize, words: &[&str], not: &[&str]| {
        document.measurement.repeats = runs as u32;
        document.complete = true;
        for point in document.points.iter_mut().filter(|point| !point.runs.is_empty()) {
            let first = point.runs[0].clone();
            point.runs.resize(runs, first);
        }
        let page = page(&document);
        assert!(words.iter().all(|word| content(&page).contains(word)), "{runs} runs lack {words:?}");
        assert!(not.iter().all(|word| !content(&page).contains(word)), "{runs} runs have {not:?}");
    };
    let ranges =
        ["2 runs of each point, 95 % intervals of errors and factors, ranges of times", "those of times are the range"];
    says(2, &ranges, &["Bars are 95 %", "% intervals<"]);
    says(6, &["6 runs of each point, 95 % intervals<", "Bars are 95 % intervals."], &["range"]);
    // Another renderer's few runs, and those of a point that failed, are no reason to call ours a range.
    let other = document.points.iter_mut().rfind(|point| !point.runs.is_empty()).unwrap();
    (other.is_other, other.failed) = (true, None);
    other.runs.truncate(2);
    let with_other = page(&document);
    assert!(content(&with_other).contains("6 runs of each point, 95 % intervals<"));
    assert!(content(&with_other).contains("those of times of other renderers are the range"));
    let failed = document.points.iter_mut().rfind(|point| point.is_other).unwrap();
    (failed.is_other, failed.failed) = (false, Some("it failed".to_owned()));
    assert!(content(&page(&document)).contains("Bars are 95 % intervals."));
}

#[test]
fn a_page_asks_nothing_of_the_network() {
    let page = page(&measurement::document("box"));
    assert!(page.contains("default-src 'none'"));
    for word in ["http:", "https:", "//cdn", "@import", "<link", "<iframe", "fetch(", "XMLHttpRequest"] {
        assert!(!page.contains(word), "{word}");
    }
    // A drawing refers to its own parts.
    assert_eq!(page.matches("url(").count(), page.matches("url(#").count());
    assert!(attributes(&page, "src").iter().all(|source| source.starts_with("data:image/png;base64,")));
    assert!(attributes(&page, "href").is_empty());
}

#[test]
fn no_text_of_a_document_becomes_markup() {
    let mut document = measurement::document(HOSTILE);
    document.machine.device = HOSTILE.into();
    document.reference.notes = vec![HOSTILE.into()];
    document.findings[0].text = HOSTILE.into();
    document.findings[0].verdict = Verdict::TooNoisy;
    for point in &mut document.points {
        point.method.options = vec![HOSTILE.into()];
        point.command = HOSTILE.into();
        point.failed = point.failed.as_ref().map(|_| HOSTILE.into());
        point.summary.iter_mut().flat_map(|s| &mut s.passes).for_each(|pass| pass.pass += HOSTILE);
    }
    let page = page(&document);
    assert!(!page.contains("<script>alert") && !page.contains("<img src=x") && !page.contains("<!--\""));
    assert!(page.contains(ESCAPED));
    // Two of the page, and one of pixels for each image.
    let images = document.points.iter().filter(|point| point.summary.is_some()).count() + 1;
    assert_eq!(page.matches("<script").count(), 2 + images);
}

#[test]
fn a_document_without_measured_points_gives_a_page() {
    let empty = html::cost(&measurement::nothing_measured("box"), None);
    assert!(empty.contains("No point was measured.") && !empty.contains("<svg"));
    assert!(empty.contains("up to 0 of 5 runs of each point"), "not what was wanted but what was made");
    let mut failed = measurement::document("box");
    failed.points.retain(|point| point.summary.is_none());
    failed.front.clear();
    let failed = page(&failed);
    assert!(failed.contains("No point was measured.") && failed.contains("the image has no normals"));
    assert_eq!(attributes(&failed, "data-name"), ["reference"]);
}

#[test]
fn figures_that_are_zero_unknown_or_no_numbers_leave_no_nan() {
    let mut document = measurement::document("box");
    for (i, point) in document.points.iter_mut().enumerate() {
        let Some(summary) = &mut point.summary else { continue };
        let bad = [0.0, -1e-6, f64::NAN, f64::INFINITY, 1e-300, 1e300][i % 6];
        let estimate = Estimate { value: bad, low: None, high: Some(bad) };
        summary.errors.relmse = Some(estimate);
        summary.errors.flip = Some(Estimate { low: Some(-bad), ..estimate });
        summary.inefficiency = Some(estimate);
        summary.change.iter_mut().for_each(|change| change.relmse = Some(estimate));
        if i % 4 == 0 {
            summary.gpu_ms = estimate;
            summary.passes.iter_mut().for_each(|pass| pass.ms = bad);
        }
    }
    let page = page(&document);
    for word in ["NaN", "inf\"", "inf,", "Infinity", ">inf"] {
        assert!(!content(&page).contains(word), "{word}");
    }
    assert!(page.contains("Not shown"));
}

#[test]
fn a_plain_page_has_its_texts_tables_and_viewers() {
    let images = measurement::images(&measurement::document("box"));
    let image = |name: &str| Image { name: name.into(), caption: HOSTILE.into(), picture: &images.reference, rank: 0 };
    let viewer = || Viewer { group: "all".into(), images: vec![image("a.exr"), image("b.exr")], reference: Some(1) };
    let mut table = Table::new("Metrics", &["metric", "value"]);
    table.push(vec![Cell::text("PSNR"), Cell::number(f64::INFINITY)]);
    table.push(vec![Cell::text(HOSTILE), Cell::number(2.5)]);
    let section = |title: &str, viewers| Section {
        title: title.into(),
        texts: vec!["No block differs.".into()],
        viewers,
        tables: vec![table.clone()],
    };
    let page = Page {
        title: HOSTILE.into(),
        facts: vec![("verdict".into(), HOSTILE.into())],
        sections: vec![section("", vec![viewer(), viewer()]), section(HOSTILE, Vec::new())],
    };
    let page = page.html();
    assert!(page.contains("<p>No block differs.</p>"));
    assert!(page.contains("<h2>Metrics</h2>") && page.contains("<h3>Metrics</h3>"), "below a heading, one level down");
    assert!(page.contains("<td>–</td>") && page.contains("data-order=\"2.5\""));
    assert_eq!(attributes(&page, "data-group"), ["all", "all"]);
    assert_eq!(attributes(&page, "data-name"), ["a.exr", "b.exr", "a.exr", "b.exr"]);
    assert!(page.contains(ESCAPED) && !page.contains("<script>alert") && !page.contains("<img src=x"));
}
