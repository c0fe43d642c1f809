//! What is to be measured, and how it is watched.
use super::document::{Document, Method, SceneInfo};
use super::grid::Candidate;
use super::motion::{JudgedFrame, Motion};
use super::others::OtherRun;
use super::reference::Reference;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::memory;
use crate::render::settings::Settings;
use crate::scene::{Fingerprint, Scene};
use crate::settings::entry::Entry;
use std::path::PathBuf;
use std::time::Duration;

/// Most points of a measurement.
const MOST: usize = 1000;

/// What is to be measured, and how.
pub struct Plan {
    /// The scene, for the reader of the document.
    pub scene: SceneInfo,
    /// How the scene moves; it shows the frame that is judged then. `None` for a scene at rest.
    pub motion: Option<Motion>,
    /// Settings of the scene, which the candidates change.
    pub base: Settings,
    /// The points.
    pub candidates: Vec<Candidate>,
    /// Command lines of the points.
    pub commands: Vec<String>,
    /// Runs of other renderers, to be seen beside ours.
    pub others: Vec<OtherRun>,
    /// Runs of each point.
    pub repeats: u32,
    /// Seed of the random order.
    pub order_seed: u64,
    /// Time for everything.
    pub budget: Option<Duration>,
    /// A reference of the user's.
    pub reference: Option<Reference>,
    /// Most samples per pixel of a reference that is rendered.
    pub reference_spp: u32,
    /// Folder in which rendered references are kept.
    pub cache: Option<PathBuf>,
}

/// How a measurement is watched and stopped.
pub struct Watch<'a> {
    /// Whether the user wants it to stop.
    pub stop: &'a dyn Fn() -> bool,
    /// Told what is done, how much of it, and of how much.
    pub progress: &'a dyn Fn(&str, u64, u64),
    /// Given what there is after every round, so that a crash loses no more than one.
    pub keep: &'a dyn Fn(&Document),
}

/// Identifies what is measured, where and how.
pub fn key(gpu: &Gpu, scene: &Scene, plan: &Plan) -> String {
    let mut key = Fingerprint::default();
    let scene = scene.fingerprint(plan.base.size()).map(|f| f.to_string()).unwrap_or_default();
    let methods: Vec<&Method> = plan.candidates.iter().map(|candidate| &candidate.method).collect();
    let filters: Vec<_> =
        plan.candidates.iter().map(|candidate| values(&candidate.filter_settings.entries())).collect();
    let carries: Vec<_> = plan.candidates.iter().map(|candidate| candidate.carries).collect();
    let given = plan.reference.as_ref().map(|reference| &reference.info);
    let parts = [
        scene,
        text(&plan.base),
        text(&methods),
        text(&filters),
        text(&(plan.motion.as_ref().map(|motion| motion.judged), carries)),
        text(&given),
        text(&(plan.repeats, plan.order_seed)),
        text(&(device(gpu), gpu.traces_by_ray_query())),
    ];
    parts.iter().for_each(|part| key.add(part.as_bytes()));
    // A file may be replaced by another of its name.
    plan.reference.iter().for_each(|reference| key.add(&reference.picture.pixels));
    key.add(&crate::shaders::HASH.to_le_bytes());
    key.to_string()
}

/// The device and its driver.
pub fn device(gpu: &Gpu) -> [&str; 3] {
    let info = gpu.info();
    [&info.name, &info.driver_name, &info.driver_version]
}

/// A value as a part of a key.
pub fn text(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// The values of settings, as a part of a key.
pub fn values(settings: &[Entry]) -> Vec<String> {
    settings.iter().map(|entry| entry.value.clone()).collect()
}

/// Seeds of the runs. Where a run renders several frames it needs several.
pub fn seeds(plan: &Plan) -> Vec<u32> {
    seeds_of(plan.base.seed, plan.repeats, plan.motion.is_some())
}

/// Seeds of so many runs of a scene that begin with this one.
pub fn seeds_of(first: u32, repeats: u32, moves: bool) -> Vec<u32> {
    let each = if moves { JudgedFrame::SEEDS } else { 1 };
    (0..repeats).map(|i| first.wrapping_add(i * each)).collect()
}

/// There must be points, and their pictures, the reference and what judging takes must fit into memory.
///
/// # Errors
/// [`Error::Usage`] and [`Error::Memory`].
pub fn check(plan: &Plan) -> Result<()> {
    match plan.candidates.len() {
        0 => {
            let what = "the grid has no point: name at least one policy, filter and number of samples";
            return Err(Error::Usage(what.to_owned()));
        }
        n if n > MOST => return Err(Error::Usage(format!("the grid has {n} points: choose at most {MOST}"))),
        _ => {}
    }
    let pictures = (plan.candidates.len() + plan.others.len()) as u64 + 16;
    let bytes = plan.base.pixels() as u64 * size_of::<[f32; 3]>() as u64 * pictures;
    memory::check(bytes).map_err(|what| {
        Error::Memory(format!("a grid of {} points {what}: choose fewer, or a smaller film", plan.candidates.len()))
    })
}
