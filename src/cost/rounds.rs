//! Rounds in which every point runs once, in an order that is random anew each time.
use super::Images;
use super::assemble::{Ended, Outline, document, failure, images, lacks_runs};
use super::document::{Document, Point, Run, WarmUp};
use super::judge::judge;
use super::plan::Watch;
use super::reference::Reference;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::image::Picture;
use crate::threads;
use rayon::prelude::*;
use std::time::Instant;

/// One measured point, not judged yet.
pub struct Measured {
    /// Index of the candidate.
    pub point: usize,
    /// Its times; the errors are missing.
    pub run: Run,
    /// Its image.
    pub picture: Picture,
    /// What its first use took.
    pub warm_up: WarmUp,
    /// Device memory that it took.
    pub device_bytes: u64,
}

/// The points of one group, each measured or failed. Empty if it was stopped.
pub type Outcome = Vec<(usize, Result<Measured>)>;

/// What is measured: groups of points, which share what they do first.
pub trait Runs {
    /// Whether all runs of a point have one image, and so one error.
    const ALIKE: bool;

    /// Indices of the points of each group.
    fn groups(&self) -> Vec<Vec<usize>>;

    /// Runs some points of a group once.
    fn run(&mut self, group: usize, seed: u32, points: &[usize], stop: &dyn Fn() -> bool) -> Outcome;
}

/// A measurement that is under way.
pub struct Measuring<'a, R> {
    /// Where everything runs.
    pub gpu: &'a Gpu,
    /// Who looks on, and may stop it.
    pub watch: &'a Watch<'a>,
    /// What is known before the first run.
    pub outline: Outline<'a>,
    /// What runs.
    pub runs: R,
    /// When no further run begins.
    pub deadline: Option<Instant>,
    /// The points of the groups, and behind them those of other renderers.
    pub points: Vec<Point>,
    /// The image of each point's first seed.
    pub pictures: Vec<Option<Picture>>,
}

impl<R: Runs> Measuring<'_, R> {
    /// Whether the user wants it to stop, or its time is over.
    pub fn stopped(&self) -> bool {
        (self.watch.stop)() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Makes the runs that are missing, each judged against `reference`.
    pub fn finish(mut self, reference: &Reference) -> (Document, Images, Ended) {
        self.rounds(reference);
        let ended = match (self.has_all_runs() && self.make_missing_pictures(), (self.watch.stop)()) {
            (true, _) => Ended::Complete,
            (false, true) => Ended::Stopped,
            (false, false) => Ended::Budget,
        };
        let complete = ended == Ended::Complete && !self.points.iter().any(Point::can_be_tried_again);
        let document = document(&self.outline, self.points, reference, complete);
        (document, images(self.pictures, reference), ended)
    }

    fn has_all_runs(&self) -> bool {
        let repeats = self.outline.seeds.len() as u32;
        !self.points.iter().any(|point| lacks_runs(point, repeats))
    }

    fn rounds(&mut self, reference: &Reference) {
        let groups = self.runs.groups();
        let ours: usize = groups.iter().map(Vec::len).sum();
        let seeds = self.outline.seeds.clone();
        for (round, &seed) in seeds.iter().enumerate() {
            let mut random = fastrand::Rng::with_seed(self.outline.order_seed.wrapping_add(round as u64));
            let mut order: Vec<usize> = (0..groups.len()).collect();
            random.shuffle(&mut order);
            for group in order {
                let mut points = groups[group].clone();
                random.shuffle(&mut points);
                points.retain(|&i| self.wants(i, seed));
                if self.stopped() {
                    return;
                }
                if !points.is_empty() {
                    let outcome = self.runs.run(group, seed, &points, self.watch.stop);
                    self.outline.machine.see_clocks(self.gpu.info());
                    self.take(outcome, reference);
                }
                let done = self.points[..ours].iter().map(|point| point.runs.len() as u64).sum();
                (self.watch.progress)("runs", done, (ours * seeds.len()) as u64);
            }
            (self.watch.keep)(&document(&self.outline, self.points.clone(), reference, false));
        }
    }

    fn wants(&self, point: usize, seed: u32) -> bool {
        let point = &self.points[point];
        point.failed.is_none() && point.runs.iter().all(|run| run.seed != seed)
    }

    /// Judges what was measured, on all cores, because no clock runs.
    fn take(&mut self, outcome: Outcome, reference: &Reference) {
        let mut measured = Vec::new();
        for (point, result) in outcome {
            match result {
                Ok(found) => measured.push(found),
                Err(e) => self.points[point].failed = Some(failure(&e)),
            }
        }
        let judged = |found: &Measured| match self.points[found.point].runs.first() {
            Some(run) if R::ALIKE => run.errors,
            _ => judge(&found.picture, &reference.picture, reference.noise),
        };
        let errors: Vec<_> = threads::within(|| measured.par_iter().map(judged).collect());
        for (found, errors) in measured.into_iter().zip(errors) {
            let Measured { point: index, run, picture, warm_up, device_bytes } = found;
            if R::ALIKE || Some(&run.seed) == self.outline.seeds.first() {
                self.pictures[index].get_or_insert(picture);
            }
            let point = &mut self.points[index];
            point.runs.push(Run { errors, ..run });
            point.runs.sort_by_key(|run| run.seed);
            point.warm_up.get_or_insert(warm_up);
            point.device_bytes = point.device_bytes.max(Some(device_bytes));
        }
    }

    /// Makes the pictures of points whose first runs were made before this program was started. Returns false if it was stopped before.
    fn make_missing_pictures(&mut self) -> bool {
        let Some(&seed) = self.outline.seeds.first() else { return true };
        let mut groups: Vec<_> = self.runs.groups().into_iter().enumerate().collect();
        for (_, points) in &mut groups {
            points.retain(|&i| self.pictures[i].is_none() && self.points[i].failed.is_none());
        }
        groups.retain(|(_, points)| !points.is_empty());
        for (done, (group, points)) in groups.iter().enumerate() {
            // Not at the end of its time: what is made is kept nowhere, and would be begun anew each time.
            if (self.watch.stop)() {
                return false;
            }
            (self.watch.progress)("pictures", done as u64, groups.len() as u64);
            let outcome = self.runs.run(*group, seed, points, self.watch.stop);
            if outcome.is_empty() {
                return false;
            }
            for (point, result) in outcome {
                self.pictures[point] = result.ok().map(|found| found.picture);
            }
        }
        true
    }
}
