//! One frame, in the order the GPU runs it. `P` pixels, `B` paths in flight.
use crate::allocate::Inputs;
use crate::error::{Error, Result};
use crate::gpu::Recorder;
use crate::layout::{FrameConstants, NONE, PriorityPush};
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::render::history::{Handover, History};
use crate::render::kernels::{Allocation, Kernels};
use crate::render::pass::sample_list::Bind;
use crate::render::pass::{accumulate, choose, light_change, path, primary_hit, reproject, sample_list};
use crate::render::schedule::Step;

/// What the frames of a renderer are recorded from: what they read, what they write, and the kernels between.
pub struct Frame {
    /// The scene, which no pass changes.
    pub scene: DeviceScene,
    /// What the passes write.
    pub film: FilmBuffers,
    /// The kernels of every render.
    pub kernels: Kernels,
    /// The kernels that place samples, where samples are placed.
    pub allocation: Option<Allocation>,
    /// What is carried from frame to frame, where anything is.
    pub history: Option<History>,
    /// What all paths of a frame have in common.
    pub constants: FrameConstants,
    /// Index of every pixel's first sample.
    pub first_sample: u32,
    /// What the policy is told.
    pub priority_push: PriorityPush,
}

impl Frame {
    /// The kernels that place samples.
    ///
    /// # Errors
    /// [`Error::Usage`] when there are none.
    pub fn allocation(&self) -> Result<&Allocation> {
        let without = || {
            Error::Usage(
                "this renderer was made without the effect \"adaptive\": make it with Renderer::resumable".into(),
            )
        };
        self.allocation.as_ref().ok_or_else(without)
    }

    /// What is carried from frame to frame.
    ///
    /// # Errors
    /// [`Error::Usage`] when nothing is.
    pub fn history(&self) -> Result<&History> {
        let without = || Error::Usage("this renderer keeps no history: call Renderer::keep_history first".into());
        self.history.as_ref().ok_or_else(without)
    }
}

/// Records the passes of one step. Beside each stands what it reads and what it writes.
///
/// # Errors
/// [`Error::Usage`] for a step that places samples where there are no kernels for it, [`Error::Device`].
pub fn record(rec: &mut Recorder, frame: &Frame, step: &Step) -> Result<()> {
    let Frame { scene, film, kernels, constants, priority_push, .. } = frame;
    match step {
        Step::Start => {
            begin_anew(rec, frame)?;
            prepare_policy(rec, frame)?;
        }
        Step::Reproject => {
            begin_with_history(rec, frame)?;
            prepare_policy(rec, frame)?;
        }
        Step::Uniform(batch) => {
            let push = path::push_of_batch(&constants.path, batch);
            path::record(&kernels.path, rec, scene, film, &push)?; // batch -> samples[B]
            accumulate::record(&kernels.accumulate, rec, film, batch)?; // samples[B] -> stats[P], light[P]
        }
        Step::Allocate(plan) => {
            let (a, stats) = (frame.allocation()?, &film.tiles[0].stats);
            a.policy.record(rec, &inputs(film), priority_push)?; // guide[P], stats[P] -> priority[P]
            a.apportion.record(rec, stats, &film.counts, plan)?; // priority[P] -> count[P]
            a.scan.record(rec, &film.counts)?; // count[P] -> offset[P + 1]
        }
        Step::Choose(choice) => {
            let (a, counts, seed) = (frame.allocation()?, &film.counts, constants.path.seed);
            let push = PriorityPush { round: choice.round, ..*priority_push };
            a.policy.record(rec, &inputs(film), &push)?; // stats[P] -> priority[P]
            choose::record(&a.choose, rec, counts, choice, seed)?; // priority[P] -> count[P], 0 or 1
            a.scan.record(rec, counts)?; // count[P] -> offset[P + 1]
        }
        Step::Listed(range) => {
            let (a, push) = (frame.allocation()?, path::push_of_list(&constants.path, range.paths));
            let carried = frame.history.as_ref().map_or(&film.none_carried, |history| &history.carried);
            let (offset, stats, paths) = (&film.counts.offset, &film.tiles[0].stats, &film.paths);
            let bind = Bind { offset, stats, carried, paths };
            if a.list_may_be_short {
                rec.fill(&film.paths, NONE)?; // NONE -> paths[B]
            }
            sample_list::record(&a.sample_list, rec, bind, range, frame.first_sample)?; // offset -> paths[B]
            path::record(&kernels.path, rec, scene, film, &push)?; // paths[B] -> samples[B]
            accumulate::record_listed(&kernels.accumulate, rec, film, range)?; // samples[B] -> stats[P], light[P]
        }
    }
    Ok(())
}

/// Begins a frame without samples.
fn begin_anew(rec: &mut Recorder, frame: &Frame) -> Result<()> {
    let Frame { scene, film, constants, kernels, .. } = frame;
    rec.update(&scene.camera, &constants.camera)?; // camera
    rec.fill(&film.broken, 0)?; // 0 -> broken
    if let Some(history) = &frame.history {
        rec.fill(&history.carried, 0)?; // 0 -> carried[P]
        history.settle(Some(constants.camera));
    }
    for tile in &film.tiles {
        rec.fill(&tile.stats, 0)?; // 0 -> stats[P]
        rec.fill(&tile.light, 0)?; // 0 -> light[P]
        if tile.has_guide() {
            primary_hit::record(&kernels.primary_hit, rec, scene, tile, &constants.path)?; // camera -> guide[P]
        }
    }
    Ok(())
}

/// Begins a frame with the samples of the last that still hold; without any where something has changed that is not followed, or either
/// was seen otherwise than from a point.
fn begin_with_history(rec: &mut Recorder, frame: &Frame) -> Result<()> {
    let Frame { scene, film, constants, kernels, .. } = frame;
    let handover = handover(frame)?;
    let (history, tile) = (handover.history, handover.tile);
    if !history.leads_to(&constants.camera) {
        rec.fill(&history.offered, 0)?; // 0 -> offered[P]
        return begin_anew(rec, frame);
    }
    rec.copy(&scene.camera, &history.previous)?; // camera -> previous camera
    rec.update(&scene.camera, &constants.camera)?; // camera
    rec.fill(&film.broken, 0)?; // 0 -> broken
    match history.probes.as_ref().filter(|_| history.has_changed()) {
        None => reproject::remember(rec, handover)?, // guide[P], stats[P] -> history[P]
        Some(probes) => {
            light_change::trace(rec, probes, handover, true)?; // probes[cells], history[P] -> changes[cells]
            light_change::sum(rec, probes)?; // changes[cells] -> changes[cells]
        }
    }
    primary_hit::record(&kernels.primary_hit, rec, scene, tile, &constants.path)?; // camera -> guide[P], points[P]
    reproject::carry(rec, handover)?; // history[P], points[P] -> stats[P], light[P]
    history.settle(Some(constants.camera));
    Ok(())
}

/// Once per frame, where samples are placed.
fn prepare_policy(rec: &mut Recorder, frame: &Frame) -> Result<()> {
    let Some(Allocation { policy, .. }) = &frame.allocation else { return Ok(()) };
    policy.prepare(rec, &inputs(&frame.film), &frame.priority_push) // guide[P] -> the policy's own
}

/// Records what a history needs of the last frame before more than the camera changes: [`Step::Reproject`] does the rest.
///
/// # Errors
/// As [`record`].
pub fn record_change(rec: &mut Recorder, frame: &Frame) -> Result<()> {
    let handover = handover(frame)?;
    let history = handover.history;
    let Some(probes) = history.probes.as_ref().filter(|_| history.is_of_points()) else {
        return rec.fill(&history.offered, 0); // 0 -> offered[P]
    };
    rec.copy(&frame.scene.camera, &history.previous)?; // camera -> previous camera
    reproject::remember(rec, handover)?; // guide[P], stats[P] -> history[P]
    light_change::trace(rec, probes, handover, false) // points[P] -> probes[cells]
}

/// Samples are handed over on films of one tile alone.
fn handover(frame: &Frame) -> Result<Handover<'_>> {
    let Frame { scene, film, constants, .. } = frame;
    Ok(Handover { history: frame.history()?, scene, tile: &film.tiles[0], constants: &constants.path })
}

/// Samples are placed on films of one tile alone.
fn inputs(film: &FilmBuffers) -> Inputs<'_> {
    let tile = &film.tiles[0];
    Inputs { guide: &tile.guide, stats: &tile.stats, light: &tile.light, priority: &film.counts.priority }
}
