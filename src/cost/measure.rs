//! Measures a grid: the reference first, then rounds in which every point runs once, in an order that is random anew each time.
use super::Images;
use super::assemble::{Ended, Outline, document, failure, images, lacks_runs, taken_up};
use super::converge::Converging;
use super::document::{Document, Point, ReferenceInfo, Run};
use super::grid::{Candidate, Shot, shots};
use super::judge::judge;
use super::machine;
use super::others;
use super::plan::{self, Plan, Watch, key, seeds};
use super::reference::Reference;
use super::session::{Measured, Session};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::image::Picture;
use crate::scene::Scene;
use crate::threads;
use rayon::prelude::*;
use std::time::Instant;

/// Part of the budget that the reference may take.
const REFERENCE_SHARE: u32 = 2;

/// A measurement that is under way.
struct Measuring<'a> {
    gpu: &'a Gpu,
    plan: &'a Plan,
    watch: &'a Watch<'a>,
    outline: Outline<'a>,
    shots: &'a [Shot],
    session: Session<'a>,
    deadline: Option<Instant>,
    points: Vec<Point>,
    pictures: Vec<Option<Picture>>,
}

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
        plan,
        watch,
        outline,
        shots: &shots,
        session: Session::new(gpu, scene, plan.motion.as_ref(), &plan.candidates, &shots)?,
        deadline: plan.budget.map(|budget| begun + budget),
        points: points(plan, earlier),
        pictures: plan.candidates.iter().map(|_| None).collect(),
    };
    let reference = match &plan.reference {
        Some(reference) => reference.clone(),
        None => {
            let mut growing = Converging::new(gpu, scene, &plan.base, plan.cache.as_deref())?;
            match judged_by {
                Some(ReferenceInfo { spp: Some(spp), notes, .. }) => growing.again(spp, &notes, watch)?,
                _ => {
                    let limit = plan.budget.map(|budget| begun + budget / REFERENCE_SHARE);
                    let pilots = measuring.pilots();
                    growing.grow_below(&pilots, plan.reference_spp, limit, watch)?
                }
            }
        }
    };
    measuring.add_others(&reference);
    measuring.rounds(&reference);
    measuring.missing_pictures();
    let Measuring { points, pictures, outline, .. } = measuring;
    let (document, ended) = document(&outline, points, &reference, (watch.stop)());
    Ok((document, images(pictures, &reference), ended))
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

impl Measuring<'_> {
    fn stopped(&self) -> bool {
        (self.watch.stop)() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Images of the points with most samples: the smallest error is among theirs.
    fn pilots(&mut self) -> Vec<Picture> {
        let most = self.shots.iter().map(|shot| shot.settings.spp).max().unwrap_or(0);
        let seed = seeds(self.plan)[0];
        let mut pictures = Vec::new();
        for (index, shot) in self.shots.iter().enumerate().filter(|(_, shot)| shot.settings.spp == most) {
            if self.stopped() {
                break;
            }
            let outcome = self.session.run(index, seed, &shot.points, self.watch.stop);
            pictures.extend(outcome.into_iter().filter_map(|(_, result)| Some(result.ok()?.picture)));
        }
        pictures
    }

    /// Puts the points of other renderers behind ours.
    fn add_others(&mut self, reference: &Reference) {
        for (point, picture) in others::judged(&self.plan.others, reference) {
            self.points.push(point);
            self.pictures.push(picture);
        }
    }

    fn rounds(&mut self, reference: &Reference) {
        let ours = self.plan.candidates.len();
        let total = (ours * self.plan.repeats as usize) as u64;
        for (round, seed) in seeds(self.plan).into_iter().enumerate() {
            let mut random = fastrand::Rng::with_seed(self.plan.order_seed.wrapping_add(round as u64));
            let mut order: Vec<usize> = (0..self.shots.len()).collect();
            random.shuffle(&mut order);
            for shot in order {
                let mut points = self.shots[shot].points.clone();
                random.shuffle(&mut points);
                points.retain(|&i| self.wants(i, seed));
                if self.stopped() {
                    return;
                }
                if !points.is_empty() {
                    let outcome = self.session.run(shot, seed, &points, self.watch.stop);
                    self.outline.machine.see_clocks(self.gpu.info());
                    self.take(outcome, reference);
                }
                let done = self.points[..ours].iter().map(|point| point.runs.len() as u64).sum();
                (self.watch.progress)("runs", done, total);
            }
            let (so_far, _) = document(&self.outline, self.points.clone(), reference, true);
            (self.watch.keep)(&so_far);
        }
    }

    fn wants(&self, point: usize, seed: u32) -> bool {
        let point = &self.points[point];
        point.failed.is_none() && point.runs.iter().all(|run| run.seed != seed)
    }

    /// Judges what was measured, on all cores, because no clock runs.
    fn take(&mut self, outcome: Vec<(usize, Result<Measured>)>, reference: &Reference) {
        let mut measured = Vec::new();
        for (point, result) in outcome {
            match result {
                Ok(found) => measured.push(found),
                Err(e) => self.points[point].failed = Some(failure(&e)),
            }
        }
        let judged = |found: &Measured| judge(&found.picture, &reference.picture, reference.noise);
        let errors: Vec<_> = threads::within(|| measured.par_iter().map(judged).collect());
        for (found, errors) in measured.into_iter().zip(errors) {
            let Measured { point: index, run, picture, warm_up, device_bytes } = found;
            let point = &mut self.points[index];
            point.runs.push(Run { errors, ..run });
            point.runs.sort_by_key(|run| run.seed);
            point.warm_up.get_or_insert(warm_up);
            point.device_bytes = point.device_bytes.max(Some(device_bytes));
            self.pictures[index].get_or_insert(picture);
        }
    }

    /// Pictures of points all of whose runs were made before this program was started.
    fn missing_pictures(&mut self) {
        if self.points.iter().any(|point| lacks_runs(point, self.plan.repeats)) {
            return;
        }
        let seed = seeds(self.plan)[0];
        for (index, shot) in self.shots.iter().enumerate() {
            let lacks = |i: &usize| self.pictures[*i].is_none() && self.points[*i].failed.is_none();
            let points: Vec<usize> = shot.points.iter().copied().filter(lacks).collect();
            if points.is_empty() || (self.watch.stop)() {
                continue;
            }
            for (point, result) in self.session.run(index, seed, &points, self.watch.stop) {
                self.pictures[point] = result.ok().map(|found| found.picture);
            }
        }
    }
}
