//! What `tallow cost` reads, writes, shows and prints.
use crate::cli::files::{Files, Item, check_distinct, partial_name};
use crate::cli::readable;
use crate::cost::changes::{option, plain};
use crate::cost::document::{Document, Point, SCHEMA};
use crate::cost::words::{factor, milliseconds, number};
use crate::cost::{Images, table};
use crate::error::{Error, Result};
use crate::image::input::{self, BYTES_OF_JSON};
use crate::image::output;
use crate::own_json::OwnJson;
use crate::report::{html, table as text_table};
use std::cell::RefCell;
use std::ffi::OsStr;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Names of the results.
const NAMES: [&str; 3] = ["cost.json", "cost.csv", "cost.html"];

/// The folder of the results.
pub struct Folder {
    path: PathBuf,
    files: RefCell<Files>,
    /// Documents that were not complete, with their files.
    begun: Vec<(PathBuf, Document)>,
    /// The name of what the one was of that is complete.
    of: Option<String>,
    /// It and those above it that were missing, itself first.
    made: Vec<PathBuf>,
}

/// A run that ends before it has something to write leaves no folder that it made. One that is not empty stays.
impl Drop for Folder {
    fn drop(&mut self) {
        for folder in &self.made {
            let _ = std::fs::remove_dir(folder);
        }
    }
}

impl Folder {
    /// Makes the folder if it is missing, checks that it can be written to, and reads what an earlier run left there. `inputs`, each with
    /// the option that names it, are not replaced.
    ///
    /// # Errors
    /// [`Error::Usage`], [`Error::Output`], and [`Error::Input`] for a document of a newer version.
    pub fn open(path: &Path, inputs: &[(&str, &Path)]) -> Result<Self> {
        let places = NAMES.map(|name| path.join(name));
        check_distinct(&places.each_ref().map(|place| ("-o", &**place)), inputs)?;
        let is_missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
        let made = path.ancestors().take_while(is_missing).map(Path::to_owned).collect();
        // What fails from here on leaves no folder either.
        let mut folder = Self { path: path.to_owned(), files: RefCell::default(), begun: Vec::new(), of: None, made };
        std::fs::create_dir_all(path).map_err(|e| {
            let other = if e.kind() == ErrorKind::InvalidFilename { "a shorter name" } else { "another folder" };
            Error::output(path, format!("cannot be made: {e}; choose {other} with -o"))
        })?;
        NAMES.iter().try_for_each(|name| output::check(&path.join(name)))?;
        let json = path.join(NAMES[0]);
        for file in std::iter::once(json.clone()).chain(partial_files(&json)).filter(|file| file.exists()) {
            let document = read(&file)?;
            match document.complete {
                true if file == json => folder.of = Some(document.scene.name),
                true => {}
                false => folder.begun.push((file, document)),
            }
        }
        Ok(folder)
    }

    /// Checks that a complete measurement there is not of a scene or image of another name: it would be replaced.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn check_subject(&self, name: &str) -> Result<()> {
        match &self.of {
            Some(other) if other != name => Err(Error::Usage(format!(
                "{} holds what was measured of \"{other}\", which \"{name}\" would replace: choose another folder with -o",
                self.path.display()
            ))),
            _ => Ok(()),
        }
    }

    /// A measurement of this key that is not complete yet, of several the one with most runs. It goes on in its files.
    pub fn earlier(&self, key: &str) -> Option<Document> {
        let of_key = self.begun.iter().filter(|(_, document)| document.measurement.key == key);
        // The first of those that have as many.
        let (file, document) = of_key.rev().max_by_key(|(_, document)| super::runs(document))?;
        for extension in ["json", "csv", "html"] {
            let place = file.with_extension(extension);
            let whole = self.path.join(NAMES[0]).with_extension(extension);
            let path = if *file == self.path.join(NAMES[0]) { whole } else { partial_name(&whole) };
            self.files.borrow_mut().go_on(&path, place);
        }
        Some(document.clone())
    }

    /// Writes what there is while the measurement goes on.
    pub fn keep(&self, document: &Document) {
        let item = Item::bytes(self.path.join(NAMES[0]), json(document));
        self.files.borrow_mut().save(&[item], false);
    }

    /// Puts another measurement that is not complete, which a complete one would replace, into files of its own, where it can go on.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn set_aside_other(&self, key: &str) -> Result<()> {
        let [own, beside @ ..] = NAMES.map(|name| self.path.join(name));
        let other = self.begun.iter().find(|(file, document)| *file == own && document.measurement.key != key);
        let Some((_, document)) = other else { return Ok(()) };
        let place = output::write_new(&partial_name(&own), |stream| stream.write_all(&json(document)))?;
        for from in beside.iter().filter(|from| from.exists()) {
            let to = place.with_extension(from.extension().unwrap_or_default());
            std::fs::rename(from, &to)
                .map_err(|e| Error::output(from, format!("cannot be renamed to {}: {e}", to.display())))?;
        }
        Ok(())
    }

    /// Writes the results and returns their paths. What is not whole replaces no earlier result.
    pub fn write(&self, document: &Document, images: &Images, whole: bool) -> Vec<PathBuf> {
        let mut files = self.files.borrow_mut();
        let page = html::cost(document, Some(images)).into_bytes();
        let contents = [json(document), table::csv(document), page];
        let mut items: Vec<_> =
            NAMES.iter().zip(contents).map(|(name, bytes)| Item::bytes(self.path.join(name), bytes)).collect();
        if whole {
            let written = files.save(&items, whole);
            if files.check().is_ok() {
                files.remove_partial(&items);
            }
            return written;
        }
        let mut written = files.save(&items[..1], whole);
        let place = written.first().filter(|place| place.parent() == Some(&self.path) && **place != items[0].path);
        if let Some(place) = place {
            // Table and page have the document's number, by which they are found again.
            for item in &mut items[1..] {
                let beside = place.with_extension(item.path.extension().unwrap_or_default());
                item.path = partial_name(&item.path);
                files.go_on(&item.path, beside);
            }
        }
        written.extend(files.save(&items[1..], whole));
        written
    }

    /// Whether all was written so far.
    ///
    /// # Errors
    /// [`Error::Output`] with all failures.
    pub fn check(&self) -> Result<()> {
        self.files.borrow().check()
    }
}

/// Files that this result has beside it while it is not whole: `cost.partial.json`, and `cost.partial-2.json` and so on where that was
/// another measurement's. Sorted by name.
fn partial_files(json: &Path) -> Vec<PathBuf> {
    let partial = partial_name(json);
    let (Some(folder), Some(stem)) = (json.parent(), partial.file_stem().and_then(OsStr::to_str)) else {
        return Vec::new();
    };
    let is_one = |path: &PathBuf| {
        let behind = path.file_stem().and_then(OsStr::to_str).and_then(|name| name.strip_prefix(stem));
        let is_number = |n: &str| !n.is_empty() && n.bytes().all(|c| c.is_ascii_digit());
        let is_named_so =
            behind.is_some_and(|behind| behind.is_empty() || behind.strip_prefix('-').is_some_and(is_number));
        is_named_so && path.extension() == json.extension()
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_one).collect();
    files.sort();
    files
}

fn json(document: &Document) -> Vec<u8> {
    serde_json::to_vec_pretty(document).unwrap_or_default()
}

/// Reads a document, of this version or an older one.
fn read(file: &Path) -> Result<Document> {
    let kind = OwnJson {
        what: "result of tallow cost",
        version: "schema",
        versions: 1..=SCHEMA.into(),
        remedy: "remove it to measure anew, or take another folder with -o",
    };
    kind.parse(&input::read_text(file, BYTES_OF_JSON)?).map_err(|what| Error::input(file, what))
}

/// A table of the points, the findings, and where the results are.
pub fn text(document: &Document, written: &[PathBuf]) -> String {
    let head = ["point", "GPU time", "relMSE", "FLIP", "speed-up", "on the front"];
    let rows: Vec<_> = (0..document.points.len()).filter_map(|i| row(document, i)).collect();
    let mut text = text_table::text(&head, &rows);
    text += &legend(document);
    let changes: Vec<_> = document.points.iter().filter_map(|point| change(document, point)).collect();
    if !changes.is_empty() {
        let head = ["without the option", "option", "GPU time", "relMSE", "relMSE x time"];
        text += &format!("\nfactors by options\n{}", text_table::text(&head, &changes));
    }
    text += "\n";
    text.extend(document.reference.notes.iter().map(|note| format!("{}\n", readable(note))));
    text.extend(document.findings.iter().map(|finding| format!("{}\n", readable(&finding.text))));
    let missing = missing(document);
    if !document.complete {
        text += &match (missing, document.points.iter().any(Point::can_be_tried_again)) {
            (0, true) => "not complete: points failed; the same command tries them again\n".to_owned(),
            (0, false) => "not complete: pictures are missing; the same command goes on\n".to_owned(),
            (_, _) => format!("not complete: {missing} runs are missing; the same command goes on\n"),
        };
    }
    let files: Vec<_> = written.iter().map(|path| readable(&path.display().to_string())).collect();
    text + &format!("written: {}\n", files.join(", "))
}

/// What the marks in the table of the points mean, and which of its times are no GPU times.
fn legend(document: &Document) -> String {
    let mut text = String::new();
    let speed_up = |point: &Point| point.summary.as_ref()?.speed_up;
    if document.points.iter().filter_map(speed_up).any(|factor| factor.extrapolated) {
        text += "*: uniform unfiltered rendering was not measured that far, and its curve was continued\n";
    }
    let others = document.points.iter().filter(|point| point.is_other && point.summary.is_some());
    let mut others: Vec<_> = others.map(|point| readable(&point.method.name())).collect();
    others.dedup();
    if !others.is_empty() {
        text += &format!("wall time instead of GPU time: {}\n", others.join("; "));
    }
    text
}

/// What the option of a point changes.
fn change(document: &Document, point: &Point) -> Option<Vec<String>> {
    let change = point.summary.as_ref()?.change?;
    let method = plain(&document.points, point)?.method.label();
    let factors = [change.time, change.relmse, change.product];
    let factors = factors.map(|estimate| estimate.map_or_else(|| "-".to_owned(), |estimate| factor(&estimate)));
    Some([method, option(point).to_owned()].into_iter().chain(factors).collect())
}

/// How many runs are missing.
pub fn missing(document: &Document) -> usize {
    let wanted = document.measurement.repeats as usize;
    let ours = document.points.iter().filter(|point| point.failed.is_none() && !point.is_other);
    ours.map(|point| wanted.saturating_sub(point.runs.len())).sum()
}

fn row(document: &Document, index: usize) -> Option<Vec<String>> {
    let point = &document.points[index];
    let summary = point.summary.as_ref()?;
    let errors = &summary.errors;
    let unknown = || "-".to_owned();
    let speed_up =
        summary.speed_up.map(|f| format!("{}{}", factor(&f.estimate), if f.extrapolated { " *" } else { "" }));
    let on_front = if document.front.contains(&index) { "yes" } else { "" };
    Some(vec![
        point.method.label(),
        milliseconds(summary.gpu_ms.value),
        errors.relmse.map_or_else(unknown, |e| factor(&e)),
        errors.flip.map_or_else(unknown, |e| number(e.value)),
        speed_up.unwrap_or_else(unknown),
        on_front.to_owned(),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Picture;
    use serde_json::json as value;

    /// A document of two runs of one point.
    fn document(key: &str) -> Document {
        let run = |seed| value!({ "seed": seed, "gpu_ms": 2.0, "wall_ms": 3.0, "passes": [], "samples": 4, "rays": 8, "errors": { "relmse": 0.1 } });
        let method = value!({ "allocate": "uniform", "filter": "none", "rounds": null, "options": [], "spp": 4 });
        let machine =
            value!({ "device": "none", "kind": "CPU", "driver": "none", "cpu": "none", "cores": 1, "cpu_mhz": null });
        let value = value!({
            "schema": SCHEMA, "complete": false, "software": { "version": "0", "commit": null },
            "scene": { "path": "a.toml", "name": "a", "width": 2, "height": 2 }, "machine": machine,
            "reference": { "source": "given", "path": null, "spp": null, "noise": "unknown", "mse": null, "relmse": null, "notes": [] },
            "measurement": {
                "repeats": 4, "seeds": [0, 1, 2, 3], "order_seed": 0, "budget_minutes": null, "confidence": 0.95, "key": key,
            },
            "points": [{
                "method": method, "command": "", "runs": [run(0), run(1)], "warm_up": null, "device_bytes": null, "summary": null,
                "failed": null,
            }],
            "front": [], "findings": [],
        });
        let mut document: Document = serde_json::from_value(value).unwrap();
        crate::cost::summary::summarise(&mut document.points);
        document
    }

    #[test]
    fn marks_and_wall_times_are_explained() {
        let mut document = document("");
        let plain = text(&document, &[]);
        assert!(!plain.contains('*') && !plain.contains("wall time"), "{plain}");
        let mut other = document.points[0].clone();
        other.method.allocate = "Other".to_owned();
        other.is_other = true;
        let factor = other.summary.as_mut().unwrap().speed_up.as_mut().unwrap();
        factor.extrapolated = true;
        document.points.push(other);
        let marked = text(&document, &[]);
        assert!(
            marked.contains(" *") && marked.contains("\n*: uniform unfiltered rendering was not measured that far"),
            "{marked}"
        );
        assert!(marked.contains("wall time instead of GPU time: Other\n"), "{marked}");
    }

    #[test]
    fn every_measurement_of_a_folder_goes_on_where_it_ended() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        let whole = Document { complete: true, ..document("whole") };
        let pictures =
            Images { reference: Picture { width: 1, height: 1, pixels: vec![[0.0; 3]] }, points: Vec::new() };
        Folder::open(folder.path(), &[]).unwrap().write(&whole, &pictures, true);
        for key in ["first", "second", "third"] {
            let open = Folder::open(folder.path(), &[]).unwrap();
            assert!(open.earlier(key).is_none());
            open.keep(&document(key));
            open.write(&document(key), &pictures, false);
        }
        let files = ["cost.partial.json", "cost.partial-2.json", "cost.partial-3.json"].map(inside);
        let of = |file: &Path| read(file).unwrap().measurement.key;
        assert_eq!(files.each_ref().map(|file| of(file)), ["first", "second", "third"]);
        let count = || std::fs::read_dir(folder.path()).unwrap().count();
        let before = count();
        let open = Folder::open(folder.path(), &[]).unwrap();
        let mut more = open.earlier("third").unwrap();
        let run = more.points[0].runs[0].clone();
        more.points[0].runs.push(run);
        open.keep(&more);
        let written = open.write(&more, &pictures, false);
        assert_eq!((count(), &written[0]), (before, &files[2]), "it goes on in its own files");
        assert_eq!(files.each_ref().map(|file| of(file)), ["first", "second", "third"]);
        // Of two with one key, the one with more runs.
        std::fs::write(inside("cost.partial-12.json"), json(&document("third"))).unwrap();
        let open = Folder::open(folder.path(), &[]).unwrap();
        assert_eq!(open.earlier("third").as_ref(), Some(&more));
        open.write(&Document { complete: true, ..more }, &pictures, true);
        assert!(!files[2].exists() && files[0].exists() && files[1].exists(), "only its own are removed");
        assert_eq!(of(&inside("cost.json")), "third");
    }

    /// Names of the results may be too long where that of the folder is not.
    #[cfg(target_os = "linux")]
    #[test]
    fn what_cannot_be_opened_leaves_no_folder() {
        let root = tempfile::tempdir().unwrap();
        let left = || std::fs::read_dir(root.path()).unwrap().count();
        let why = |path: &Path| Folder::open(path, &[]).err().unwrap().to_string();
        let name = why(&root.path().join("above").join("a".repeat(256)));
        assert!(name.contains("cannot be made") && name.ends_with("; choose a shorter name with -o"), "{name}");
        assert_eq!(left(), 0);
        // Bytes of a path that Linux takes, without its end.
        let most = 4095;
        let mut deep = root.path().join("above");
        while deep.as_os_str().len() < most - 300 {
            deep.push("a".repeat(200));
        }
        deep.push("a".repeat(most - 6 - deep.as_os_str().len()));
        let place = why(&deep);
        assert!(place.contains("cost.json: cannot be written") && place.contains("choose a shorter name"), "{place}");
        assert_eq!(left(), 0);
        drop(Folder::open(&root.path().join("a/b"), &[]).unwrap());
        assert_eq!(left(), 0);
        std::fs::create_dir(root.path().join("a")).unwrap();
        drop(Folder::open(&root.path().join("a/b/c"), &[]).unwrap());
        assert_eq!((left(), std::fs::read_dir(root.path().join("a")).unwrap().count()), (1, 0), "what was there stays");
    }

    /// Once it is complete; what was begun goes on beside it.
    #[test]
    fn what_was_measured_of_one_scene_is_not_replaced_by_another() {
        let folder = tempfile::tempdir().unwrap();
        let pictures =
            Images { reference: Picture { width: 1, height: 1, pixels: vec![[0.0; 3]] }, points: Vec::new() };
        let mut of_a = document("a");
        of_a.scene.name = "a".to_owned();
        let open = || Folder::open(folder.path(), &[]).unwrap();
        open().write(&of_a, &pictures, false);
        assert!(open().check_subject("b").is_ok(), "it is not complete");
        open().write(&Document { complete: true, ..of_a.clone() }, &pictures, true);
        assert!(open().check_subject("a").is_ok());
        let why = open().check_subject("b").unwrap_err().to_string();
        assert!(why.contains("holds what was measured of \"a\", which \"b\" would replace"), "{why}");
    }

    #[test]
    fn what_is_not_complete_survives_a_complete_one_of_another_key() {
        let pictures =
            Images { reference: Picture { width: 1, height: 1, pixels: vec![[0.0; 3]] }, points: Vec::new() };
        let folder = tempfile::tempdir().unwrap();
        let open = || Folder::open(folder.path(), &[]).unwrap();
        let complete = |key: &str| {
            let of_key = open();
            let goes_on = of_key.earlier(key).is_some();
            of_key.set_aside_other(key).unwrap();
            of_key.write(&Document { complete: true, ..document(key) }, &pictures, true);
            goes_on
        };
        for key in ["begun", "begun too"] {
            open().write(&document(key), &pictures, false);
        }
        assert!(!complete("short") && open().earlier("begun").is_some() && open().earlier("begun too").is_some());
        assert!(!complete("short") && complete("begun") && complete("begun too"));
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 3, "what went on to its end takes its files along");
    }

    /// One that was killed before it had a table and a page takes none of another.
    #[test]
    fn each_measurement_has_its_own_page() {
        let pictures =
            Images { reference: Picture { width: 1, height: 1, pixels: vec![[0.0; 3]] }, points: Vec::new() };
        let named = |key: &str| {
            let mut document = document(key);
            document.scene.name = key.to_owned();
            document
        };
        for (has_whole, pages) in
            [(false, ["cost.html", "cost.partial.html"]), (true, ["cost.partial.html", "cost.partial-2.html"])]
        {
            let folder = tempfile::tempdir().unwrap();
            let open = || Folder::open(folder.path(), &[]).unwrap();
            if has_whole {
                open().write(&Document { complete: true, ..named("whole") }, &pictures, true);
            }
            open().keep(&named("killed"));
            let other = open();
            other.keep(&named("stopped"));
            other.write(&named("stopped"), &pictures, false);
            let again = open();
            let document = again.earlier("killed").unwrap();
            again.write(&document, &pictures, false);
            for (page, key) in pages.into_iter().zip(["killed", "stopped"]) {
                assert!(std::fs::read_to_string(folder.path().join(page)).unwrap().contains(key), "{page}");
            }
            again.write(&Document { complete: true, ..document }, &pictures, true);
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 6, "only its own are removed");
        }
    }
}
