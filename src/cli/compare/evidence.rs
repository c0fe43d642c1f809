//! The folder with all that shows why two images are not the same.
use super::replay;
use super::report::{Report, Side, write_png};
use super::words;
use crate::cli::files::key;
use crate::error::{Error, Result};
use crate::image::output;
use crate::image::significance::{Finding, suspects};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Names of the files of A and B in the folder.
const NAMES: [&str; 2] = ["a", "b"];
/// Names of all other files in it.
const VIEWS: [&str; 6] = ["a.png", "b.png", "map.png", "report.html", "report.json", "replay.sh"];

/// Checks, before the images are read, that the folder exists or can be made.
///
/// # Errors
/// [`Error::Output`].
pub fn check(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| Error::output(folder, format!("cannot be made: {e}; choose another folder with --evidence")))?;
    output::check(&folder.join("report.json"))
}

/// The files that [`write`] makes of these images. One that is the image itself is not among them: it stays as it is.
pub fn files(folder: &Path, images: [&Path; 2]) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = VIEWS.iter().map(|name| folder.join(name)).collect();
    for (name, image) in NAMES.iter().zip(images) {
        let copy = copy_of(folder, name, image);
        if key(&copy) != key(image) && !all.contains(&copy) {
            all.push(copy);
        }
    }
    all
}

fn copy_of(folder: &Path, name: &str, image: &Path) -> PathBuf {
    let extension = image.extension().map_or("exr".into(), |e| e.to_string_lossy());
    folder.join(format!("{name}.{extension}"))
}

/// Writes both images, the map, the page, all figures, and the worst pixels with the commands that render them again.
///
/// # Errors
/// [`Error::Output`], and [`Error::Input`] when an image is gone.
pub fn write(folder: &Path, report: &Report) -> Result<()> {
    for (name, side) in NAMES.iter().zip(report.sides) {
        copy(folder, name, side)?;
        let view = folder.join(format!("{name}.png"));
        if view != copy_of(folder, name, &side.path) {
            write_png(&view, &side.picture())?;
        }
    }
    report.write_map(&folder.join("map.png"))?;
    output::write(&folder.join("report.html"), super::page::html(report).as_bytes())?;
    let [a, b] = report.sides.each_ref().map(|side| &side.estimate);
    let pixels = suspects(a, b, &report.outcome);
    let mut figures = report.figures();
    figures["verdict"] = json!(words::verdict(report));
    figures["pixels"] = json!(pixels);
    let text = serde_json::to_string_pretty(&figures).map_err(|e| Error::output(folder, e))?;
    output::write(&folder.join("report.json"), text.as_bytes())?;
    output::write(&folder.join("replay.sh"), script(report, &pixels).as_bytes())
}

/// Removes what [`write`] made of an earlier comparison: these images are the same, and whoever takes up the folder would find that
/// others were not. A folder without a report stays as it is.
///
/// # Errors
/// [`Error::Output`].
pub fn clear(folder: &Path, images: [&Path; 2]) -> Result<()> {
    let report = folder.join("report.json");
    let told = std::fs::read(&report).ok().and_then(|text| serde_json::from_slice::<Value>(&text).ok());
    if !told.is_some_and(|told| told.get("verdict").is_some() && told.get("pixels").is_some()) {
        return Ok(());
    }
    let gone = |path: &PathBuf| match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::output(path, format!("is of an earlier comparison, and cannot be removed: {e}")))
        }
        _ => Ok(()),
    };
    files(folder, images).iter().try_for_each(gone)
}

/// Copies a file as it is, since only the bytes themselves hold everything.
fn copy(folder: &Path, name: &str, side: &Side) -> Result<()> {
    let bytes = std::fs::read(&side.path).map_err(|e| Error::input(&side.path, e))?;
    output::write(&copy_of(folder, name, &side.path), &bytes)
}

/// A shell script that renders the worst pixels of both images again.
fn script(report: &Report, pixels: &[Finding]) -> String {
    let mut script =
        "#!/bin/sh\n# Renders the pixels that differ most surely, with the samples that they have in the images.\n"
            .to_owned();
    script += "# Start it where the scenes can be found. Every line is a command of its own.\n";
    let metadata =
        |side: &Side, key: &str| side.film.metadata.get(key).cloned().unwrap_or_else(|| "unknown".to_owned());
    for (name, side) in NAMES.iter().zip(report.sides) {
        let [device, driver, cpu] = ["device", "driver", "cpu"].map(|key| one_line(&metadata(side, key)));
        let path = one_line(&side.path.display().to_string());
        let _ = writeln!(script, "# {name}: {path}, rendered on {device}, driver {driver}, processor {cpu}");
    }
    for pixel in pixels {
        let [x, y] = pixel.place.first;
        let _ = writeln!(script, "\n# {}", words::region(pixel));
        for (name, side) in NAMES.iter().zip(report.sides) {
            let lines = replay::commands(&side.film, [x, y], name)
                .unwrap_or_else(|what| vec![format!("# {name} cannot be rendered again: {}", one_line(&what))]);
            let _ = writeln!(script, "{}", lines.join("\n"));
        }
    }
    script
}

/// Metadata may hold line breaks, after which a shell would take them for commands.
fn one_line(text: &str) -> String {
    crate::cli::readable(text)
}
