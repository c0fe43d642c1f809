//! One frame, in the order the GPU runs it. `P` pixels, `B` paths in flight.
use crate::allocate::{Inputs, Policy};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::layout::*;
use crate::render::buffers::{DeviceScene, FilmBuffers};
use crate::render::pass::apportion::Apportion;
use crate::render::pass::scan::Scan;
use crate::render::pass::{accumulate, choose, path, primary_hit, sample_list};
use crate::render::schedule::{Batch, Choice, PathRange, Plan};

/// The kernels of a frame, specialised for one scene.
pub struct Stages {
    /// Primary hits at pixel centres.
    pub guide: primary_hit::Guides,
    /// Paths.
    pub path: path::Path,
    /// Statistics.
    pub fold: accumulate::Fold,
}

/// The kernels that decide where samples go, for renders that do not spread them evenly.
pub struct Allocation {
    /// What makes a pixel worth samples.
    pub policy: Box<dyn Policy>,
    /// Priorities to counts.
    pub apportion: Apportion,
    /// The same, one sample at most.
    pub choose: choose::Choose,
    /// Counts to offsets.
    pub scan: Scan,
    /// Offsets to paths.
    pub batch: sample_list::Batches,
}

/// Forgets all samples, and finds the primary hits where they are wanted: once per camera.
pub fn record_start(
    rec: &mut Recorder,
    st: &Stages,
    s: &DeviceScene,
    f: &FilmBuffers,
    frame: &FrameConstants,
) -> Result<()> {
    rec.update(&s.frame, frame)?;
    rec.fill(&f.broken, 0)?;
    for tile in &f.tiles {
        rec.fill(&tile.stats, 0)?;
        rec.fill(&tile.light, 0)?;
        if tile.guide.len() == tile.pixels as usize {
            primary_hit::record(&st.guide, rec, s, tile)?; //   camera  -> guide[P]
        }
    }
    Ok(())
}

/// What a policy finds out before there are samples: once per camera.
pub fn record_preparation(rec: &mut Recorder, a: &Allocation, f: &FilmBuffers, push: &PriorityPush) -> Result<()> {
    a.policy.prepare(rec, &inputs(f), push) //                  guide[P] -> a policy's own
}

fn inputs(f: &FilmBuffers) -> Inputs<'_> {
    let tile = &f.tiles[0];
    Inputs { guide: &tile.guide, stats: &tile.stats, light: &tile.light, priority: &f.priority }
}

/// Records one batch with the same number of paths for every pixel of a run.
pub fn record_uniform(rec: &mut Recorder, st: &Stages, s: &DeviceScene, f: &FilmBuffers, batch: &Batch) -> Result<()> {
    path::record(&st.path, rec, s, f, batch)?; //         batch   -> samples[B]
    accumulate::record(&st.fold, rec, f, batch) //                    samples -> stats[P], light[P]
}

/// Records the decision of how many samples each pixel gets next.
pub fn record_allocation(
    rec: &mut Recorder,
    a: &Allocation,
    f: &FilmBuffers,
    push: &PriorityPush,
    plan: &Plan,
) -> Result<()> {
    a.policy.record(rec, &inputs(f), push)?; //                             guide[P], stats[P] -> priority[P]
    a.apportion.record(rec, &f.priority, &f.tiles[0].stats, &f.counts, plan)?; // priority -> count[P], sum = budget
    a.scan.record(rec, &f.counts) //                                        count    -> offset[P + 1]
}

/// Records the decision of who gets one sample next.
pub fn record_choice(
    rec: &mut Recorder,
    a: &Allocation,
    f: &FilmBuffers,
    push: &PriorityPush,
    choice: &Choice,
    seed: u32,
) -> Result<()> {
    a.policy.record(rec, &inputs(f), &PriorityPush { round: choice.round, ..*push })?; // stats[P] -> priority[P]
    choose::record(&a.choose, rec, &f.priority, &f.counts, choice, seed)?; //       priority -> count[P], 0 or 1
    a.scan.record(rec, &f.counts) //                                                count    -> offset[P + 1]
}

/// Records one batch of what was allocated.
pub fn record_listed(
    rec: &mut Recorder,
    st: &Stages,
    a: &Allocation,
    s: &DeviceScene,
    f: &FilmBuffers,
    range: &PathRange,
    first_sample: u32,
) -> Result<()> {
    sample_list::record(&a.batch, rec, &f.counts.offset, &f.tiles[0].stats, &f.paths, range, first_sample)?; // offset -> paths[B]
    path::record_listed(&st.path, rec, s, f, range.paths)?; //                     paths   -> samples[B]
    accumulate::record_listed(&st.fold, rec, f, range) //                                      samples -> stats[P], light[P]
}
