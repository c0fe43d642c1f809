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
/// Names of all other files in it. The report goes last, since it lists what is not removed yet.
const VIEWS: [&str; 6] = ["a.png", "b.png", "map.png", "report.html", "replay.sh", REPORT];
const REPORT: &str = "report.json";
/// The key of the report under which it lists the names of the files that were written with it. No others are ever replaced or removed.
const WRITTEN: &str = "files";

/// Checks, before the images are read, that the folder exists or can be made, and that nothing in it would be replaced but what an
/// earlier comparison wrote.
///
/// # Errors
/// [`Error::Output`], and [`Error::Usage`] when there is a file of another origin.
pub fn check(folder: &Path, images: [&Path; 2]) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|e| Error::output(folder, format!("cannot be made: {e}; choose another folder with --evidence")))?;
    let (report, own) = (folder.join(REPORT), written(folder));
    let is_foreign = |path: &&PathBuf| path.symlink_metadata().is_ok() && !own.contains(path);
    if let Some(path) = files(folder, images).iter().find(is_foreign) {
        let [folder, path, list] = [folder, path, &report].map(Path::display);
        return Err(Error::Usage(format!(
            "--evidence {folder} would replace {path}, which no earlier comparison has listed in {list}: remove it, or choose another folder"
        )));
    }
    output::check(&report)
}

/// The files that [`write`] makes of these images, and those of an earlier comparison that it or [`clear`] removes. One that is an image
/// itself is not among them: it stays as it is.
pub fn touched(folder: &Path, images: [&Path; 2]) -> Vec<PathBuf> {
    let mut all = files(folder, images);
    let more: Vec<_> = earlier(folder, images).filter(|path| !all.contains(path)).collect();
    all.extend(more);
    all
}

fn files(folder: &Path, images: [&Path; 2]) -> Vec<PathBuf> {
    let copies = NAMES.iter().zip(images).map(|(name, image)| (copy_of(folder, name, image), image));
    let mut all: Vec<_> = copies.filter(|(copy, image)| key(copy) != key(image)).map(|(copy, _)| copy).collect();
    let views = VIEWS.iter().map(|name| folder.join(name)).filter(|view| !all.contains(view)).collect::<Vec<_>>();
    all.extend(views);
    all
}

/// What an earlier comparison wrote, without what is compared now.
fn earlier(folder: &Path, images: [&Path; 2]) -> impl Iterator<Item = PathBuf> {
    let images = images.map(key);
    written(folder).into_iter().filter(move |path| !images.contains(&key(path)))
}

/// What an earlier comparison wrote, by its report. Links are the user's, and so is all that [`write`] gives no such name.
fn written(folder: &Path) -> Vec<PathBuf> {
    let report = Some(folder.join(REPORT)).filter(|path| path.is_file()).and_then(|path| std::fs::read(path).ok());
    let told = report.and_then(|text| serde_json::from_slice::<Value>(&text).ok()).unwrap_or_default();
    let names = told[WRITTEN].as_array().into_iter().flatten().filter_map(Value::as_str);
    let is_copy = |name: &str| {
        let path = Path::new(name);
        path.file_name() == Some(name.as_ref()) && path.file_stem().is_some_and(|stem| NAMES.iter().any(|n| stem == *n))
    };
    let own = names.filter(|name| VIEWS.contains(name) || is_copy(name)).map(|name| folder.join(name));
    own.filter(|path| !path.is_symlink()).collect()
}

fn copy_of(folder: &Path, name: &str, image: &Path) -> PathBuf {
    let extension = image.extension().map_or("exr".into(), |e| e.to_string_lossy());
    folder.join(format!("{name}.{extension}"))
}

/// Writes both images, the map, the page, all figures, and the worst pixels with the commands that render them again. What else an
/// earlier comparison left goes. The report goes first, so that what a full disk leaves can be written again.
///
/// # Errors
/// [`Error::Output`], and [`Error::Input`] when an image is gone.
pub fn write(folder: &Path, report: &Report) -> Result<()> {
    let images = report.sides.each_ref().map(|side| side.path.as_path());
    let files = files(folder, images);
    earlier(folder, images).filter(|path| !files.contains(path)).try_for_each(|path| remove(&path))?;
    // An image that is compared now may be of an earlier comparison.
    let kept = written(folder).into_iter().filter(|path| !files.contains(path) && path.exists());
    let names = kept.chain(files.iter().cloned()).filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()));
    let [a, b] = report.sides.each_ref().map(|side| &side.estimate);
    let pixels = suspects(a, b, &report.outcome);
    let mut figures = report.figures();
    figures["verdict"] = json!(words::verdict(report));
    figures["pixels"] = json!(pixels);
    figures[WRITTEN] = json!(names.collect::<Vec<_>>());
    let text = serde_json::to_string_pretty(&figures).map_err(|e| Error::output(folder, e))?;
    output::write(&folder.join(REPORT), text.as_bytes())?;
    for (name, side) in NAMES.iter().zip(report.sides) {
        let (copy, view) = (copy_of(folder, name, &side.path), folder.join(format!("{name}.png")));
        if files.contains(&copy) {
            // Only the bytes themselves hold everything.
            let bytes = std::fs::read(&side.path).map_err(|e| Error::input(&side.path, e))?;
            output::write(&copy, &bytes)?;
        }
        if view != copy {
            write_png(&view, &side.picture())?;
        }
    }
    report.write_map(&folder.join("map.png"))?;
    output::write(&folder.join("report.html"), super::page::html(report).as_bytes())?;
    output::write(&folder.join("replay.sh"), script(report, &pixels).as_bytes())
}

/// Removes what [`write`] made of an earlier comparison: these images are the same, and whoever takes up the folder would find that
/// others were not. A folder without a report stays as it is.
///
/// # Errors
/// [`Error::Output`].
pub fn clear(folder: &Path, images: [&Path; 2]) -> Result<()> {
    earlier(folder, images).try_for_each(|path| remove(&path))
}

fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Error::output(path, format!("is of an earlier comparison, and cannot be removed: {e}")))
        }
        _ => Ok(()),
    }
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
