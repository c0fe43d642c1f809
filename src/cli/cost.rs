//! `tallow cost`: measures how much time buys how much accuracy, by which method.
mod filters;
mod knobs;
mod options;
mod output;
mod points;

use super::files::scene_name;
use super::progress::Stages;
use super::{Exit, complain, fail_on_messages, interrupt, quoted};
use crate::cost::document::SceneInfo;
use crate::cost::{Document, Ended, Images, JudgedFrame, Plan, Watch, key, measure, others, reference, seeds_of};
use crate::error::{Error, Result};
use crate::gpu::{self, Gpu};
use crate::scene::Scene;
pub use options::Args;
use output::{Folder, missing, text};
use points::Points;
use serde::Serialize;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Duration;

/// Runs the subcommand.
///
/// # Errors
/// What keeps every point from being measured, and errors of writing.
pub fn run(args: &Args) -> Result<Exit> {
    if let Some(image) = &args.filter_only {
        return filters::run(args, image);
    }
    let path = args.scene.as_deref().ok_or_else(no_scene)?;
    let gpu = args.common.open(args.tracing)?;
    let (scene, points) = Points::new(args, path, &gpu)?;
    let mut warnings = args.common.warnings();
    warnings.add([&scene.warnings[..], &points.notes].concat());
    let plan = plan(args, path, &scene, points, &gpu)?;
    let key = key(&gpu, &scene, &plan);
    measured(args, &gpu, &key, warnings.all(), |earlier, watch| measure(&gpu, &scene, &plan, earlier, watch))
}

fn plan(args: &Args, path: &Path, scene: &Scene, points: Points, gpu: &Gpu) -> Result<Plan> {
    let Points { motion, base, candidates, .. } = points;
    let size = base.size();
    let seeds = seeds_of(base.seed, args.repeats, motion.is_some());
    let given = |file: &Path| reference::read(file, size, Some((scene, &base, &seeds)));
    let reference = args.reference.as_deref().map(given).transpose()?;
    let settings = args.choices.open(path)?.settings()?;
    let judged = motion.as_ref().map(|motion| motion.judged);
    let scene_words = quoted(&path.display().to_string()) + &args.choices.words();
    let (ray_queries, device) = (gpu.traces_by_ray_query(), args.common.device_words());
    let command = |candidate| points::command(&scene_words, judged, &settings, candidate, ray_queries, &device);
    Ok(Plan {
        scene: scene_info(path, size, judged),
        commands: candidates.iter().map(command).collect(),
        motion,
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

fn scene_info(path: &Path, [width, height]: [u32; 2], judged: Option<JudgedFrame>) -> SceneInfo {
    let name = scene_name(path).to_string_lossy().into_owned();
    SceneInfo { path: path.display().to_string(), name, width, height, judged }
}

type Found = (Document, Images, Ended);

/// Goes on with an earlier measurement of this key, if there is one, shows a progress bar, and writes what was found. A signal only
/// asks it to stop: what was measured is written first, and where nothing was, the folder that was made for it is removed.
fn measured(
    args: &Args,
    gpu: &Gpu,
    key: &str,
    warnings: &[String],
    measure: impl FnOnce(Option<Document>, &Watch) -> Result<Found>,
) -> Result<Exit> {
    let inputs = [
        ("--points", &args.points),
        ("--reference", &args.reference),
        ("--filter-only", &args.filter_only),
        ("the scene", &args.scene),
    ];
    let inputs: Vec<_> = inputs.iter().filter_map(|(name, path)| Some((*name, path.as_deref()?))).collect();
    let stop = interrupt::flag();
    let folder = Folder::open(&args.output, &inputs)?;
    if let Some(subject) = args.scene.as_deref().or(args.filter_only.as_deref()) {
        folder.check_subject(&scene_name(subject).to_string_lossy())?;
    }
    let earlier = folder.earlier(key);
    let runs_before = earlier.as_ref().map_or(0, runs);
    let stages = Stages::new(!args.common.talkative());
    let progress = |what: &str, done: u64, total: u64| stages.set(what, done, total);
    let keep = |document: &Document| folder.keep(document);
    let found = measure(earlier, &Watch { stop: &|| stop.load(Ordering::SeqCst), progress: &progress, keep: &keep });
    stages.finish();
    let found = found?;
    fail_on_messages(gpu)?;
    finish(args, &folder, found, runs_before, warnings)
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    document: &'a Document,
    /// What was repaired in the scene, and what was left out of the grid.
    warnings: &'a [String],
}

/// Writes and prints what was found.
fn finish(
    args: &Args,
    folder: &Folder,
    (document, images, ended): Found,
    runs_before: usize,
    warnings: &[String],
) -> Result<Exit> {
    if ended == Ended::Stopped && runs(&document) == runs_before && missing(&document) > 0 {
        complain("interrupted before a run was complete: nothing was written");
        return Ok(Exit::Interrupted);
    }
    let (document, images) = (&document, &images);
    if document.complete {
        folder.set_aside_other(&document.measurement.key)?;
    }
    let written = folder.write(document, images, document.complete);
    args.common.report(&Report { document, warnings }, || text(document, &written))?;
    let failed = document.points.iter().filter_map(|point| Some((point, point.failed.as_ref()?)));
    failed.for_each(|(point, reason)| complain(&format!("error: {}: {reason}", point.method.label())));
    folder.check()?;
    match ended {
        Ended::Stopped => {
            complain("interrupted: what there is was written; the same command goes on from there");
            Ok(Exit::Interrupted)
        }
        _ if document.points.iter().any(|point| point.failed.is_some()) => Ok(Exit::PartlyFailed),
        Ended::Budget if runs(document) == 0 => {
            complain(
                "nothing could be measured within --budget-minutes: give more, or choose a smaller film or fewer points",
            );
            Ok(Exit::PartlyFailed)
        }
        Ended::Budget | Ended::Complete => Ok(Exit::Done),
    }
}

fn no_scene() -> Error {
    Error::Usage("name a scene to measure, or an image with --filter-only (see tallow cost --help)".to_owned())
}

/// Runs that were measured: those of other renderers are read anew each time.
fn runs(document: &Document) -> usize {
    document.points.iter().filter(|point| !point.is_other).map(|point| point.runs.len()).sum()
}

impl Args {
    fn budget(&self) -> Option<Duration> {
        (self.budget_minutes > 0.0).then(|| Duration::from_secs_f64(self.budget_minutes * 60.0))
    }
}
