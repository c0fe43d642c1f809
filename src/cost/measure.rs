//! Measures a grid: the reference first, then rounds in which every point runs once, in an order that is random anew each time.
use super::Images;
use super::assemble::{Ended, Outline, failure, lacks_runs, put_together, unmeasured};
use super::converge::{Converging, FEWEST_PARTS, PART_SPP};
use super::document::{Document, Method, Point, Run, SceneInfo};
use super::grid::{Candidate, Shot, shots};
use super::judge::judge;
use super::machine;
use super::reference::Reference;
use super::session::{Measured, Session};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::Picture;
use crate::memory;
use crate::render::settings::Settings;
use crate::scene::{Fingerprint, Scene};
use crate::threads;
use rayon::prelude::*;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The noise of a reference is rendered down to this share of the smallest relMSE: a tenth of its root.
const NOISE_SHARE: f64 = 0.01;
/// Part of the budget that the reference may take.
const REFERENCE_SHARE: u32 = 2;

/// What is to be measured, and how.
pub struct Plan {
    /// The scene, for the reader of the document.
    pub scene: SceneInfo,
    /// Settings of the scene, which the candidates change.
    pub base: Settings,
    /// The points.
    pub candidates: Vec<Candidate>,
    /// Command lines of the points.
    pub commands: Vec<String>,
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
}

/// A measurement that is under way.
struct Measuring<'a> {
    plan: &'a Plan,
    watch: &'a Watch<'a>,
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
    check_room(plan)?;
    let machine = machine::describe(gpu.info());
    let shots = shots(&plan.candidates);
    let mut measuring = Measuring {
        plan,
        watch,
        shots: &shots,
        session: Session::new(gpu, scene, &plan.candidates, &shots)?,
        deadline: plan.budget.map(|budget| begun + budget),
        points: points(plan, earlier),
        pictures: plan.candidates.iter().map(|_| None).collect(),
    };
    let reference = match &plan.reference {
        Some(reference) => reference.clone(),
        None => measuring.converge(gpu, scene, begun)?,
    };
    measuring.rounds(&reference);
    measuring.missing_pictures();
    let Measuring { points, pictures, .. } = measuring;
    let outline = Outline {
        scene: &plan.scene,
        seeds: seeds(&plan.base, plan.repeats),
        order_seed: plan.order_seed,
        budget: plan.budget,
        key: key(gpu, scene, plan),
    };
    Ok(put_together(&outline, points, pictures, machine, &reference, (watch.stop)()))
}

/// Identifies what is measured, where and how.
pub fn key(gpu: &Gpu, scene: &Scene, plan: &Plan) -> String {
    let mut key = Fingerprint::default();
    let scene = scene.fingerprint([plan.base.width, plan.base.height]).map(|f| f.to_string()).unwrap_or_default();
    let methods: Vec<&Method> = plan.candidates.iter().map(|candidate| &candidate.method).collect();
    let given = plan.reference.as_ref().map(|reference| &reference.info);
    let info = gpu.info();
    let parts = [
        scene,
        text(&plan.base),
        text(&methods),
        text(&given),
        text(&(plan.repeats, plan.order_seed)),
        text(&(&info.name, &info.driver_name, &info.driver_version)),
    ];
    parts.iter().for_each(|part| key.add(part.as_bytes()));
    key.add(&crate::shaders::HASH.to_le_bytes());
    key.to_string()
}

fn text(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// The points of the plan, with what an earlier measurement found. What failed is tried again.
fn points(plan: &Plan, earlier: Option<Document>) -> Vec<Point> {
    let earlier = earlier.map(|document| document.points).unwrap_or_default();
    let point = |(candidate, command): (&Candidate, &String)| {
        let (method, command) = (candidate.method.clone(), command.clone());
        match earlier.iter().find(|known| known.method == method) {
            Some(known) => Point { failed: None, summary: None, command, ..known.clone() },
            None => unmeasured(method, command),
        }
    };
    plan.candidates.iter().zip(&plan.commands).map(point).collect()
}

/// Seeds of the runs.
pub fn seeds(base: &Settings, repeats: u32) -> Vec<u32> {
    (0..repeats).map(|i| base.seed.wrapping_add(i)).collect()
}

/// The pictures of all points, the reference and what judging takes must fit into memory.
fn check_room(plan: &Plan) -> Result<()> {
    let pictures = plan.candidates.len() as u64 + 16;
    let bytes = plan.base.pixels() as u64 * size_of::<[f32; 3]>() as u64 * pictures;
    memory::check(bytes).map_err(|what| {
        Error::Memory(format!("a grid of {} points {what}: choose fewer, or a smaller film", plan.candidates.len()))
    })
}

impl Measuring<'_> {
    fn stopped(&self) -> bool {
        (self.watch.stop)() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Renders the reference until its noise is small beside the smallest error, which the points of most samples tell, or until a
    /// limit.
    fn converge(&mut self, gpu: &Gpu, scene: &Scene, begun: Instant) -> Result<Reference> {
        let plan = self.plan;
        let limit = plan.budget.map(|budget| begun + budget / REFERENCE_SHARE);
        let pilots = self.pilots();
        let mut growing = Converging::new(gpu, scene, &plan.base, plan.cache.as_deref())?;
        let stop = self.watch.stop;
        let most = (plan.reference_spp / PART_SPP).max(FEWEST_PARTS);
        let mut goal = FEWEST_PARTS;
        loop {
            while growing.spp() / PART_SPP < goal {
                (self.watch.progress)("reference", growing.spp().into(), (goal * PART_SPP).into());
                let in_time = limit.is_none_or(|limit| Instant::now() < limit);
                let enough = growing.spp() / PART_SPP >= FEWEST_PARTS;
                if (enough && !in_time) || !growing.grow(stop)? {
                    goal = 0;
                }
            }
            let reference = growing.reference();
            let wanted = parts_wanted(&reference, &pilots, growing.spp() / PART_SPP);
            let parts = growing.spp() / PART_SPP;
            if wanted <= parts || parts >= most || goal == 0 {
                growing.keep();
                return Ok(with_note(reference, wanted > parts));
            }
            goal = wanted.min(2 * parts).min(most);
        }
    }

    /// Images of the points with most samples: the smallest error is among theirs.
    fn pilots(&mut self) -> Vec<Picture> {
        let most = self.shots.iter().map(|shot| shot.settings.spp).max().unwrap_or(0);
        let seed = seeds(&self.plan.base, self.plan.repeats)[0];
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

    fn rounds(&mut self, reference: &Reference) {
        let total = (self.points.len() * self.plan.repeats as usize) as u64;
        for (round, seed) in seeds(&self.plan.base, self.plan.repeats).into_iter().enumerate() {
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
                    self.take(outcome, reference);
                }
                let done = self.points.iter().map(|point| point.runs.len() as u64).sum();
                (self.watch.progress)("runs", done, total);
            }
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
        let seed = seeds(&self.plan.base, self.plan.repeats)[0];
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

/// Independent renders that a reference needs to be far below the smallest error.
fn parts_wanted(reference: &Reference, pilots: &[Picture], parts: u32) -> u32 {
    let noise = reference.noise.relmse;
    let error = |picture: &Picture| crate::image::metrics::relmse(picture, &reference.picture) - noise;
    // An error that drowns in the noise is taken to be as large as the noise, and is looked at again once that is smaller.
    let smallest = pilots.iter().map(error).fold(f64::INFINITY, f64::min).max(noise);
    let times = noise / (NOISE_SHARE * smallest);
    if times.is_finite() { (f64::from(parts) * times).ceil().min(1e9) as u32 } else { parts }
}

fn with_note(mut reference: Reference, is_short: bool) -> Reference {
    if is_short {
        reference.info.notes.push(
            "a limit of time or samples was reached before the standard error of the reference was a tenth of the smallest \
             error; its noise is subtracted from MSE and relMSE, but not from the other errors"
                .to_owned(),
        );
    }
    reference
}
