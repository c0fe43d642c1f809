//! Points of other renderers, to be seen beside ours: a table names their images and how long each took.
use super::assemble::failure;
use super::document::{Method, Point, Run};
use super::judge::judge;
use super::reference::Reference;
use crate::allocate::POLICIES;
use crate::error::{Error, Result};
use crate::image::{self, Picture, input};
use serde::Deserialize;
use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

/// Bytes of memory that a byte of a table takes at most while it is read.
const BYTES_OF_ROW: u64 = 16;

/// The columns of the table, in any order.
const COLUMNS: [&str; 6] = ["method", "filter", "spp", "seed", "ms", "image"];

/// A row of the table, which has the [`COLUMNS`] as fields.
#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Row {
    /// Name of the renderer.
    method: String,
    /// What filtered its image; "none" without.
    filter: String,
    /// Samples per pixel.
    spp: u32,
    /// Tells runs of the same point apart.
    seed: u32,
    /// Wall time in milliseconds.
    ms: f64,
    /// File of the image, relative to the table.
    image: PathBuf,
}

/// One run of another renderer.
#[derive(Clone, Debug, PartialEq)]
pub struct OtherRun {
    /// How the point is called in the document.
    pub method: Method,
    /// Tells runs of the same point apart.
    pub seed: u32,
    /// Wall time in milliseconds.
    pub ms: f64,
    /// File of the image.
    pub image: PathBuf,
}

/// Reads a table of comma-separated values with the columns method, filter, spp, seed, ms and image.
///
/// # Errors
/// [`Error::Input`] with the line that is wrong, and [`Error::Memory`].
pub fn read(path: &Path) -> Result<Vec<OtherRun>> {
    let text = input::read_text(path, BYTES_OF_ROW)?;
    let wrong = |what: String| Error::input(path, what);
    let run = |row: Row| {
        let Row { method, filter, spp, seed, ms, image } = row;
        if !(ms.is_finite() && ms > 0.0) {
            return Err(wrong(format!("a time of {ms} ms: give a number above 0")));
        }
        if spp == 0 {
            return Err(wrong(format!("{method} took 0 samples a pixel: give a number from 1")));
        }
        if POLICIES.iter().any(|policy| policy.name == method) {
            return Err(wrong(format!("{method} is a policy of Tallow's own: give the renderer another name")));
        }
        let method = Method { allocate: method, filter, spp, ..Method::default() };
        Ok(OtherRun { method, seed, ms, image: path.parent().unwrap_or(Path::new("")).join(image) })
    };
    let runs: Vec<OtherRun> = rows(path, &text)?.into_iter().map(run).collect::<Result<_>>()?;
    let mut labels = BTreeMap::new();
    for run in &runs {
        let first = labels.entry(run.method.label()).or_insert(&run.method);
        if **first != run.method {
            return Err(wrong(format!("two methods are called {}: change one of the names", run.method.label())));
        }
    }
    let mut seen = HashSet::new();
    match runs.iter().find(|run| !seen.insert((run.method.label(), run.seed))) {
        Some(again) => {
            Err(wrong(format!("{} has seed {} twice: a seed tells its runs apart", again.method.label(), again.seed)))
        }
        None => Ok(runs),
    }
}

fn rows(path: &Path, text: &[u8]) -> Result<Vec<Row>> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text);
    let at = |line: u64, what: String| Error::input_at(path, format!("line {line}"), what);
    let damaged = |e: csv::Error| at(e.position().map_or(1, csv::Position::line), words_of(&e));
    let names = reader.headers().map_err(damaged)?.clone();
    if names.len() != COLUMNS.len() || !COLUMNS.iter().all(|column| names.iter().any(|name| name == *column)) {
        let (names, columns) = (Vec::from_iter(&names).join(", "), COLUMNS.join(","));
        return Err(at(1, format!("its columns are \"{names}\": write {columns} above the rows, with commas between")));
    }
    let row = |record: csv::Result<csv::StringRecord>| {
        let record = record.map_err(damaged)?;
        record.deserialize(Some(&names)).map_err(|e| {
            let line = record.position().map_or(1, csv::Position::line);
            // Texts are never wrong.
            let field = if let csv::ErrorKind::Deserialize { err, .. } = e.kind() { err.field() } else { None };
            let field = field.map_or(0, |field| field as usize);
            let (name, value) = (&names[field], &record[field]);
            let kind = if name == "ms" { "number" } else { "whole number from 0 to 4294967295" };
            at(line, format!("{name} is \"{value}\": write a {kind}"))
        })
    };
    let rows = reader.into_records().map(row).collect::<Result<Vec<_>>>()?;
    match rows.is_empty() {
        true => Err(Error::input(path, "has no rows: write one for each image, or leave out --points")),
        false => Ok(rows),
    }
}

/// What keeps a line of the table from being read.
fn words_of(e: &csv::Error) -> String {
    match e.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("has {len} values, and {expected_len} columns: write one for each")
        }
        csv::ErrorKind::Utf8 { .. } => "is no UTF-8: save the table as UTF-8".to_owned(),
        _ => e.to_string().replace('\n', " "),
    }
}

/// The points of these runs, judged, each with its first image. A point with an image that cannot be judged has failed.
pub fn judged(runs: &[OtherRun], reference: &Reference) -> Vec<(Point, Option<Picture>)> {
    let mut points: Vec<(Point, Option<Picture>)> = Vec::new();
    for run in runs {
        let index = points.iter().position(|(point, _)| point.method == run.method).unwrap_or_else(|| {
            points.push((Point { is_other: true, ..Point::unmeasured(run.method.clone(), String::new()) }, None));
            points.len() - 1
        });
        let (point, first) = &mut points[index];
        match one(run, reference) {
            Ok((judged, picture)) => {
                point.runs.push(judged);
                first.get_or_insert(picture);
            }
            Err(e) => point.failed = Some(failure(&e)),
        }
    }
    points
}

fn one(run: &OtherRun, reference: &Reference) -> Result<(Run, Picture)> {
    let picture = image::read(&run.image)?.rec709(None).map_err(|what| Error::input(&run.image, what))?;
    let [size, wanted] = [picture.size(), reference.picture.size()];
    if size != wanted {
        let what = format!("is {}x{}, but {}x{} is measured", size[0], size[1], wanted[0], wanted[1]);
        return Err(Error::input(&run.image, what));
    }
    let picture = picture.finite().map_err(|what| Error::input(&run.image, what))?;
    let judged = Run {
        seed: run.seed,
        gpu_ms: run.ms,
        wall_ms: run.ms,
        samples: picture.pixels.len() as u64 * u64::from(run.method.spp),
        errors: judge(&picture, &reference.picture, reference.noise),
        ..Run::default()
    };
    Ok((judged, picture))
}

#[cfg(test)]
mod tests {
    use super::super::reference;
    use super::*;
    use crate::image::{Film, WriteOptions};

    const TABLE: &str = "method,filter,spp,seed,ms,image\nOther,none,4,7,12.5,a/b.exr\nOther,oidn,4,7,20,c.exr\n";

    fn table(text: &str) -> Result<Vec<OtherRun>> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("points.csv");
        std::fs::write(&file, text).unwrap();
        let within =
            |run: OtherRun| OtherRun { image: run.image.strip_prefix(folder.path()).unwrap().to_owned(), ..run };
        read(&file).map(|runs| runs.into_iter().map(within).collect())
    }

    #[test]
    fn a_table_names_images_and_times() {
        let runs = table(TABLE).unwrap();
        let labels: Vec<_> = runs.iter().map(|run| run.method.label()).collect();
        assert_eq!(labels, ["Other, 4 spp", "Other + oidn, 4 spp"]);
        assert_eq!((runs[0].seed, runs[0].ms, &runs[0].image), (7, 12.5, &PathBuf::from("a/b.exr")));
        let spaced = table(&format!("\u{feff}{}", TABLE.replace(',', " , "))).unwrap();
        assert_eq!(format!("{spaced:?}"), format!("{runs:?}"), "spaces and a byte order mark");
    }

    #[test]
    fn an_image_of_no_numbers_fails_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let [good, bad] = [("good.exr", 1.0), ("bad.exr", f32::NAN)].map(|(name, value)| {
            let path = folder.path().join(name);
            let picture = Picture { width: 1, height: 1, pixels: vec![[value; 3]] };
            image::write(&path, &Film::from(&picture), &WriteOptions::default()).unwrap();
            path
        });
        let reference = reference::read(&good, [1, 1], None).unwrap();
        let run = |image| OtherRun { image, ..table(TABLE).unwrap().remove(0) };
        assert!(one(&run(good), &reference).is_ok());
        let line = one(&run(bad), &reference).unwrap_err().to_string();
        assert!(line.contains("bad.exr") && line.contains("1 of 1 pixels"), "{line}");
    }

    #[test]
    fn images_in_other_primaries_are_compared_in_those_of_rec_709() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("wide.exr");
        let mut film = Film::from(&Picture { width: 1, height: 1, pixels: vec![[0.2, 0.5, 0.7]] });
        film.primaries = Some([[0.708, 0.292], [0.17, 0.797], [0.131, 0.046], [0.3127, 0.329]]); // Rec. 2020
        image::write(&path, &film, &WriteOptions::default()).unwrap();
        let expected = film.rec709(None).unwrap();
        assert_ne!(expected.pixels, film.picture(None).unwrap().pixels);
        let reference = reference::read(&path, [1, 1], None).unwrap();
        let run = OtherRun { image: path, ..table(TABLE).unwrap().remove(0) };
        for picture in [&reference.picture, &one(&run, &reference).unwrap().1] {
            let off = |i: usize| (picture.pixels[0][i] - expected.pixels[0][i]).abs();
            assert!((0..3).all(|i| off(i) < 1e-3), "{:?}, not {:?}", picture.pixels, expected.pixels);
        }
    }

    #[test]
    fn what_is_no_table_is_one_line() {
        let says = |text: &str, word: &str| {
            let line = table(text).unwrap_err().to_string();
            assert!(line.contains(word) && !line.contains('\n'), "{line}");
        };
        says("method,filter,spp,seed,ms,image\nA,none,4,7,0,a.exr\n", "a time of 0 ms");
        says("method,filter,spp,seed,ms,image\nA,none,4,7,inf,a.exr\n", "a time of inf ms");
        says(
            "method,filter,spp,seed,ms,image\nA,none,x,7,1,a.exr\n",
            "csv, line 2: spp is \"x\": write a whole number from 0",
        );
        says("seed,filter,spp,method,ms,image\n-1,none,4,A,7,a.exr\n", "csv, line 2: seed is \"-1\": write a whole");
        says(
            "method,filter,spp,seed,ms,image\nA,none,4,7,1\u{20ac},a.exr\n",
            "csv, line 2: ms is \"1\u{20ac}\": write a number",
        );
        says("method,filter,spp,seed,ms,image\nA,none,0,7,1,a.exr\n", "A took 0 samples a pixel");
        says("method,filter,spp,seed,ms,image\nuniform,none,4,7,1,a.exr\n", "uniform is a policy");
        says("method,filter,spp,seed,ms,image\nA,none,4,7,1,a.exr\nA,none,4,7,2,b.exr\n", "A, 4 spp has seed 7 twice");
        says(
            "method,filter,spp,seed,ms,image\nA + x,none,4,7,1,a.exr\nA,x,4,8,2,b.exr\n",
            "two methods are called A + x, 4 spp",
        );
        says("method,filter,spp,seed,ms,image\nA,none,4,7\n", "csv, line 2: has 4 values, and 6 columns");
        let columns = "write method,filter,spp,seed,ms,image above the rows, with commas between";
        says("method,spp\nA,4\n", &format!("csv, line 1: its columns are \"method, spp\": {columns}"));
        says("method;filter;spp;seed;ms;image\nA;none;4;7;1;a.exr\n", columns);
        says("method,filter,spp,seed,ms,image,more\nA,none,4,7,1,a.exr,1\n", columns);
        says("A,none,4,7,1,a.exr\n", columns);
        says("", columns);
        says("method,filter,spp,seed,ms,image\n", "csv: has no rows: write one for each image");
    }
}
