//! `tallow cost`: measures how much time buys how much accuracy, by which method.
mod filters;
mod knobs;
mod options;
mod output;

use super::{Exit, complain, fail_on_messages, interrupt, print, print_json};
use crate::cost::document::SceneInfo;
use crate::cost::grid::{self, Candidate};
use crate::cost::{Document, Ended, Images, Plan, Watch, key, measure, others, reference};
use crate::denoise::filter::{FilterSettings, Method};
use crate::error::{Error, Result};
use crate::gpu::{self, DeviceOptions, Gpu};
use crate::render::settings::Settings;
use crate::scene::{Scene, SceneFile};
pub use options::Args;
use options::Words;
use output::{Folder, Shown, text};
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Runs the subcommand.
///
/// # Errors
/// What keeps every point from being measured, and errors of writing.
pub fn run(args: &Args) -> Result<Exit> {
    let folder = Folder::open(&args.output)?;
    if let Some(image) = &args.filter_only {
        return filters::run(args, image, &folder);
    }
    let path = args.scene.as_deref().ok_or_else(no_scene)?;
    let (scene, base, candidates) = candidates(args, path)?;
    if !args.quiet && !args.json {
        scene.warnings.iter().for_each(|w| complain(&format!("warning: {w}")));
    }
    let (plan, gpu) = (plan(args, path, &scene, base, candidates)?, open(args)?);
    let earlier = folder.earlier(&key(&gpu, &scene, &plan));
    let runs_before = earlier.as_ref().map_or(0, runs);
    let found = watched(args, &folder, |watch| measure(&gpu, &scene, &plan, earlier, watch))?;
    fail_on_messages(&gpu)?;
    finish(args, &folder, found, runs_before)
}

fn plan(args: &Args, path: &Path, scene: &Scene, base: Settings, candidates: Vec<Candidate>) -> Result<Plan> {
    let [width, height] = [base.width, base.height];
    let given = |file: &Path| reference::read(file, [width, height], Some((scene, &base)));
    let reference = args.reference.as_deref().map(given).transpose()?;
    let settings = SceneFile::open(path)?.settings()?;
    Ok(Plan {
        scene: SceneInfo { path: path.display().to_string(), name: name(path), width, height },
        commands: candidates.iter().map(|candidate| command(path, &settings, candidate)).collect(),
        base,
        candidates,
        others: args.points.as_deref().map_or(Ok(Vec::new()), others::read)?,
        repeats: args.repeats,
        order_seed: args.order_seed,
        budget: args.budget(),
        reference,
        reference_spp: args.reference_spp,
        cache: gpu::cache_folder().map(|folder| folder.join("references")),
    })
}

/// Measures with a progress bar. From here on there is something to save, so a signal only asks it to stop.
fn watched<T>(args: &Args, folder: &Folder, measure: impl FnOnce(&Watch) -> Result<T>) -> Result<T> {
    let stop = interrupt::flag();
    let shown = Shown::new(args.quiet || args.json);
    let progress = |what: &str, done: u64, total: u64| shown.set(what, done, total);
    let keep = |document: &Document| folder.keep(document);
    let found = measure(&Watch { stop: &|| stop.load(Ordering::SeqCst), progress: &progress, keep: &keep });
    shown.finish();
    found
}

/// Writes and prints what was found.
fn finish(
    args: &Args,
    folder: &Folder,
    (document, images, ended): (Document, Images, Ended),
    runs_before: usize,
) -> Result<Exit> {
    if ended == Ended::Stopped && runs(&document) == runs_before {
        complain("interrupted before a run was complete: nothing was written");
        return Ok(Exit::Interrupted);
    }
    let (document, images) = (&document, &images);
    let written = folder.write(document, images, ended == Ended::Complete);
    match (args.json, args.quiet) {
        (true, _) => print_json(document)?,
        (false, true) => {}
        (false, false) => print(&text(document, &written))?,
    }
    folder.failure().map_or(Ok(()), Err)?;
    match ended {
        Ended::Stopped => {
            complain("interrupted: what there is was written; the same command goes on from there");
            Ok(Exit::Interrupted)
        }
        _ if document.points.iter().any(|point| point.failed.is_some()) => Ok(Exit::PartlyFailed),
        Ended::Budget | Ended::Complete => Ok(Exit::Done),
    }
}

/// The scene, its settings with those of the options, and the points.
fn candidates(args: &Args, path: &Path) -> Result<(Scene, Settings, Vec<Candidate>)> {
    let file = SceneFile::open(path)?;
    let (mut base, mut filters) = (file.settings()?, FilterSettings::default());
    args.film.apply(&mut base);
    Words::parse(&args.with)?.apply(&mut base, &mut filters);
    base.validate()?;
    filters.validate()?;
    let mut all = grid::grid(&base, &filters, &args.axes());
    all.iter().try_for_each(|candidate| candidate.settings.validate())?;
    all.extend(varied(args, &all)?);
    Ok((file.load()?.scene, base, all))
}

/// Each point of the grid with the options of every variant, and with every step of the knobs that it has.
fn varied(args: &Args, grid: &[Candidate]) -> Result<Vec<Candidate>> {
    let mut all = Vec::new();
    for text in &args.variants {
        let words = Words::parse(text)?.checked_as_variant(text)?;
        let before = all.len();
        all.extend(grid.iter().filter_map(|point| point.varied(text.trim(), |s, filters| words.apply(s, filters))));
        if all.len() == before {
            return Err(Error::Usage(format!("\"{}\" changes no point of the grid", text.trim())));
        }
    }
    for point in grid.iter().filter(|_| args.ablate) {
        for step in knobs::steps(point) {
            let words = Words::parse(&step)?;
            all.extend(point.varied(&step, |s, filters| words.apply(s, filters)));
        }
    }
    Ok(all)
}

fn open(args: &Args) -> Result<Gpu> {
    Gpu::open(&DeviceOptions {
        device: args.device.clone(),
        validation: args.validation,
        cache: gpu::cache_folder(),
        wait_limit: None,
    })
}

fn no_scene() -> Error {
    Error::Usage("name a scene to measure, or an image with --filter-only (see tallow cost --help)".to_owned())
}

/// The command that renders a point's first image. Unfiltered points go to .hdr: for an .exr more layers are kept, which takes
/// longer than what was measured. Filters with settings of their own run behind the render, to the same bits.
fn command(scene: &Path, from: &Settings, candidate: &Candidate) -> String {
    let words = |words: Vec<String>| words.into_iter().map(|word| format!(" {word}")).collect::<String>();
    let render = words(grid::options(&from.entries(), &candidate.settings.entries()));
    let render = format!("tallow render {}{render}", quoted(&scene.display().to_string()));
    let Some(filter) = candidate.filter.map(Method::name) else { return format!("{render} -o point.hdr") };
    match &words(grid::options(&FilterSettings::default().entries(), &candidate.filter_settings.entries()))[..] {
        "" => format!("{render} --denoise {filter} -o point.exr"),
        own => format!("{render} -o noisy.exr && tallow filter noisy.exr --filter {filter}{own} -o point.exr"),
    }
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+=:,@%".contains(c);
    match !word.is_empty() && word.chars().all(plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', r"'\''")),
    }
}

/// A scene's name: that of its folder if the file itself is called "scene".
fn name(path: &Path) -> String {
    let text = |part: Option<&std::ffi::OsStr>| part.map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
    let (stem, folder) = (text(path.file_stem()), text(path.parent().and_then(Path::file_name)));
    if stem == "scene" && !folder.is_empty() { folder } else { stem }
}

fn runs(document: &Document) -> usize {
    document.points.iter().map(|point| point.runs.len()).sum()
}

impl Args {
    fn budget(&self) -> Option<Duration> {
        (self.budget_minutes > 0.0).then(|| Duration::from_secs_f64(self.budget_minutes * 60.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_have_names_and_words_are_quoted() {
        assert_eq!(
            ["scenes/bust/scene.toml", "a/room.toml", "scene.toml"].map(|p| name(Path::new(p))),
            ["bust", "room", "scene"]
        );
        assert_eq!(["a/b.toml", "my scene", "it's"].map(quoted), ["a/b.toml", "'my scene'", r"'it'\''s'"]);
    }
}
