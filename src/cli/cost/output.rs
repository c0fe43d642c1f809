//! What `tallow cost` reads, writes, shows and prints.
use crate::cli::files::{Files, Item, partial_name};
use crate::cli::progress::Progress;
use crate::cli::readable;
use crate::cost::changes::{option, plain};
use crate::cost::document::{Document, Point, SCHEMA};
use crate::cost::words::{factor, milliseconds, number};
use crate::cost::{Images, table};
use crate::error::{Error, Result};
use crate::image::{input, output};
use crate::report::{html, table as text_table};
use serde_json::Value;
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Names of the results.
const NAMES: [&str; 3] = ["cost.json", "cost.csv", "cost.html"];

/// The folder of the results.
pub struct Folder {
    path: PathBuf,
    files: RefCell<Files>,
    /// Documents that were not complete, with their files.
    begun: Vec<(PathBuf, Document)>,
}

impl Folder {
    /// Makes the folder if it is missing, checks that it can be written to, and reads what an earlier run left there.
    ///
    /// # Errors
    /// [`Error::Output`], and [`Error::Input`] for a document of a newer version.
    pub fn open(path: &Path) -> Result<Self> {
        std::fs::create_dir_all(path).map_err(|e| Error::output(path, format!("cannot be made: {e}")))?;
        NAMES.iter().try_for_each(|name| output::check(&path.join(name)))?;
        let json = path.join(NAMES[0]);
        let mut begun = Vec::new();
        for file in [json.clone(), partial_name(&json)].into_iter().filter(|file| file.exists()) {
            let document = read(&file)?;
            if !document.complete {
                begun.push((file, document));
            }
        }
        Ok(Self { path: path.to_owned(), files: RefCell::default(), begun })
    }

    /// A measurement of this key that is not complete yet. Its files may be replaced.
    pub fn earlier(&self, key: &str) -> Option<Document> {
        let (file, document) = self.begun.iter().find(|(_, document)| document.measurement.key == key)?;
        self.files.borrow_mut().own(["json", "csv", "html"].map(|extension| file.with_extension(extension)));
        Some(document.clone())
    }

    /// Writes what there is while the measurement goes on.
    pub fn keep(&self, document: &Document) {
        let item = Item::bytes(self.path.join(NAMES[0]), json(document));
        self.files.borrow_mut().save(&[item], false);
    }

    /// Writes the results and returns their paths. What is not whole replaces no earlier result.
    pub fn write(&self, document: &Document, images: &Images, whole: bool) -> Vec<PathBuf> {
        let mut files = self.files.borrow_mut();
        let page = html::cost(document, Some(images)).into_bytes();
        let contents = [json(document), table::csv(document), page];
        let items: Vec<_> =
            NAMES.iter().zip(contents).map(|(name, bytes)| Item::bytes(self.path.join(name), bytes)).collect();
        let written = files.save(&items, whole);
        if whole && files.failure().is_none() {
            files.remove_partial(&items);
        }
        written
    }

    /// Everything that could not be written, as one error.
    pub fn failure(&self) -> Option<Error> {
        self.files.borrow().failure()
    }
}

fn json(document: &Document) -> Vec<u8> {
    serde_json::to_vec_pretty(document).unwrap_or_default()
}

/// Reads a document, of this version or an older one.
fn read(file: &Path) -> Result<Document> {
    let value: Value = serde_json::from_slice(&input::read(file)?).map_err(|e| not_ours(file, &e))?;
    let schema = value.get("schema").and_then(Value::as_u64).unwrap_or(0);
    if schema > SCHEMA.into() {
        let what =
            format!("is of a newer version (schema {schema}, this one knows {SCHEMA}): take another folder with -o");
        return Err(Error::input(file, what));
    }
    serde_json::from_value(value).map_err(|e| not_ours(file, &e))
}

fn not_ours(file: &Path, e: &serde_json::Error) -> Error {
    Error::input(file, format!("is no result of tallow cost: {e}; take another folder with -o"))
}

/// A progress bar for each stage.
pub struct Shown {
    quiet: bool,
    bar: RefCell<Option<(String, Progress)>>,
}

impl Shown {
    /// Makes one that shows nothing if it is `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, bar: RefCell::new(None) }
    }

    /// Shows how much of a stage is done.
    pub fn set(&self, what: &str, done: u64, total: u64) {
        let mut bar = self.bar.borrow_mut();
        if bar.as_ref().is_none_or(|(shown, _)| shown != what) {
            bar.iter().for_each(|(_, progress)| progress.finish());
            *bar = Some((what.to_owned(), Progress::new(total, self.quiet)));
        }
        if let Some((_, progress)) = bar.as_mut() {
            progress.set_of(what, done, total);
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.borrow().iter().for_each(|(_, progress)| progress.finish());
    }
}

/// A table of the points, the findings, and where the results are.
pub fn text(document: &Document, written: &[PathBuf]) -> String {
    let head = ["point", "GPU time", "relMSE", "+-", "FLIP", "speed-up", "on the front"];
    let rows: Vec<_> = (0..document.points.len()).filter_map(|i| row(document, i)).collect();
    let mut text = text_table::text(&head, &rows);
    let changes: Vec<_> = document.points.iter().filter_map(|point| change(document, point)).collect();
    if !changes.is_empty() {
        let head = ["without the option", "option", "GPU time", "relMSE", "relMSE x time"];
        text += &format!("\nfactors by options\n{}", text_table::text(&head, &changes));
    }
    for point in &document.points {
        if let Some(reason) = &point.failed {
            text += &format!("failed: {}: {}\n", readable(&point.method.label()), readable(reason));
        }
    }
    text += "\n";
    text.extend(document.reference.notes.iter().map(|note| format!("{}\n", readable(note))));
    text.extend(document.findings.iter().map(|finding| format!("{}\n", readable(&finding.text))));
    let missing: usize = document.points.iter().map(|point| missing(document, point)).sum();
    if missing > 0 {
        text += &format!("not complete: {missing} runs are missing; the same command goes on\n");
    }
    let files: Vec<_> = written.iter().map(|path| readable(&path.display().to_string())).collect();
    text + &format!("written: {}\n", files.join(", "))
}

/// What the option of a point changes.
fn change(document: &Document, point: &Point) -> Option<Vec<String>> {
    let change = point.summary.as_ref()?.change?;
    let method = plain(&document.points, point)?.method.label();
    let factors = [change.time, change.relmse, change.product];
    let factors = factors.map(|estimate| estimate.map_or_else(|| "-".to_owned(), |estimate| factor(&estimate)));
    Some([method, option(point).to_owned()].into_iter().chain(factors).collect())
}

fn missing(document: &Document, point: &Point) -> usize {
    let wanted = document.measurement.repeats as usize;
    if point.failed.is_some() || point.is_other { 0 } else { wanted.saturating_sub(point.runs.len()) }
}

fn row(document: &Document, index: usize) -> Option<Vec<String>> {
    let point = &document.points[index];
    let summary = point.summary.as_ref()?;
    let errors = &summary.errors;
    let unknown = || "-".to_owned();
    let half = errors.relmse.and_then(|e| Some(e.high? - e.value));
    let speed_up =
        summary.speed_up.map(|f| format!("{}{}", factor(&f.estimate), if f.extrapolated { " *" } else { "" }));
    let on_front = if document.front.contains(&index) { "yes" } else { "" };
    Some(vec![
        point.method.label(),
        milliseconds(summary.gpu_ms.value),
        errors.relmse.map_or_else(unknown, |e| number(e.value)),
        half.map_or_else(unknown, number),
        errors.flip.map_or_else(unknown, |e| number(e.value)),
        speed_up.unwrap_or_else(unknown),
        on_front.to_owned(),
    ])
}
