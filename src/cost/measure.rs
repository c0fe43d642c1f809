//! Measures a grid: the reference first, then rounds.
use super::Images;
use super::assemble::{Ended, Outline, taken_up};
use super::converge::Converging;
use super::document::{Document, Point, ReferenceInfo};
use super::grid::{Candidate, Shot, shots};
use super::machine;
use super::others;
use super::plan::{self, Plan, Watch, key, seeds};
use super::rounds::{Measuring, Runs};
use super::session::Session;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::image::Picture;
use crate::scene::Scene;
use std::time::Instant;

/// Part of the budget that the reference may take.
const REFERENCE_SHARE: u32 = 2;

/// Measures `plan`, or goes on where `earlier` ended, a document of the same [`key`].
///
/// # Errors
/// What keeps every point from being measured. The failure of one point is in the document.
pub fn measure(
    gpu: &Gpu,
    scene: &Scene,
    plan: &Plan,
    earlier: Option<Document>,
    watch: &Watch,
) -> Result<(Document, Images, Ended)> {
    let begun = Instant::now();
    plan::check(plan)?;
    let judged_by = earlier.as_ref().and_then(judged_by);
    let shots = shots(&plan.candidates);
    let outline = Outline {
        scene: &plan.scene,
        machine: machine::describe(gpu),
        seeds: seeds(plan),
        order_seed: plan.order_seed,
        budget: plan.budget,
        key: key(gpu, scene, plan),
    };
    let mut measuring = Measuring {
        gpu,
        watch,
        outline,
        runs: Session::new(gpu, scene, plan.motion.as_ref(), &plan.candidates, &shots)?,
        deadline: plan.budget.map(|budget| begun + budget),
        points: points(plan, earlier),
        pictures: plan.candidates.iter().map(|_| None).collect(),
    };
    let reference = match &plan.reference {
        Some(reference) => reference.clone(),
        None => {
            let mut growing = Converging::new(gpu, scene, &plan.base, plan.cache.as_deref())?;
            match judged_by {
                Some(earlier @ ReferenceInfo { spp: Some(spp), .. }) => growing.again(spp, &earlier, watch)?,
                _ => {
                    let limit = plan.budget.map(|budget| begun + budget / REFERENCE_SHARE);
                    let pilots = pilots(&mut measuring, &shots);
                    growing.grow_below(&pilots, plan.reference_spp, limit, watch)?
                }
            }
        }
    };
    for (point, picture) in others::judged(&plan.others, &reference) {
        measuring.points.push(point);
        measuring.pictures.push(picture);
    }
    Ok(measuring.finish(&reference))
}

/// The reference that runs of an earlier measurement were judged by; `None` if there are none.
fn judged_by(earlier: &Document) -> Option<ReferenceInfo> {
    let has_runs = earlier.points.iter().any(|point| !point.is_other && !point.runs.is_empty());
    has_runs.then(|| earlier.reference.clone())
}

/// The points of the plan, with what an earlier measurement found.
fn points(plan: &Plan, earlier: Option<Document>) -> Vec<Point> {
    let earlier = earlier.map(|document| document.points).unwrap_or_default();
    let point =
        |(candidate, command): (&Candidate, &String)| taken_up(&earlier, candidate.method.clone(), command.clone());
    plan.candidates.iter().zip(&plan.commands).map(point).collect()
}

/// Images of the points with most samples: the smallest error is among theirs.
fn pilots(measuring: &mut Measuring<Session>, shots: &[Shot]) -> Vec<Picture> {
    let most = shots.iter().map(|shot| shot.settings.spp).max().unwrap_or(0);
    let seed = measuring.outline.seeds[0];
    let mut pictures = Vec::new();
    for (index, shot) in shots.iter().enumerate().filter(|(_, shot)| shot.settings.spp == most) {
        if measuring.stopped() {
            break;
        }
        let outcome = measuring.runs.run(index, seed, &shot.points, measuring.watch.stop);
        pictures.extend(outcome.into_iter().filter_map(|(_, result)| Some(result.ok()?.picture)));
    }
    pictures
}
