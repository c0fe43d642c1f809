//! The same for filters alone, on a given image of any renderer: its noise is what it is, so only times vary between runs.
use super::Images;
use super::assemble::{Ended, Outline, document, failure, images, lacks_runs, taken_up};
use super::document::{Document, Method, Point, Run, SceneInfo, WarmUp};
use super::judge::judge;
use super::machine;
use super::plan::{Watch, device, text, values};
use super::reference::Reference;
use super::session::{add_filter, check_clock, finite, interleaved};
use crate::denoise::filter::{self, FilterSettings};
use crate::denoise::{Recipe, file, timed};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::aov::{Aovs, Names};
use crate::image::{Film, Picture, Samples};
use crate::scene::Fingerprint;
use crate::threads;
use std::path::Path;
use std::time::{Duration, Instant};

/// A filter to measure.
pub struct FilterCandidate {
    /// The filter.
    pub filter: filter::Method,
    /// Its settings, which are scaled to the image.
    pub settings: FilterSettings,
    /// Options of `tallow filter` that gave these settings.
    pub options: Vec<String>,
    /// Command line that filters the image like this.
    pub command: String,
}

/// What is to be measured.
pub struct FilterPlan<'a> {
    /// File of the image, for messages.
    pub path: &'a Path,
    /// The image, with its layers.
    pub film: &'a Film,
    /// The image, for the reader of the document.
    pub scene: SceneInfo,
    /// The points.
    pub candidates: Vec<FilterCandidate>,
    /// Runs of each point.
    pub repeats: u32,
    /// Seed of the random order.
    pub order_seed: u64,
    /// Time for everything.
    pub budget: Option<Duration>,
    /// What the errors are measured against.
    pub reference: Reference,
}

/// A measurement that is under way.
struct Measuring<'a> {
    gpu: &'a Gpu,
    plan: &'a FilterPlan<'a>,
    watch: &'a Watch<'a>,
    layers: file::Layers<'a>,
    outline: Outline<'a>,
    deadline: Option<Instant>,
    points: Vec<Point>,
    pictures: Vec<Option<Picture>>,
}

/// Identifies what is measured, where and how.
pub fn key(gpu: &Gpu, plan: &FilterPlan) -> String {
    let mut key = Fingerprint::default();
    let settings = |candidate: &FilterCandidate| (method(candidate), values(&candidate.settings.entries()));
    let candidates: Vec<_> = plan.candidates.iter().map(settings).collect();
    let size = [plan.film.width, plan.film.height];
    let parts = [
        text(&(size, &plan.film.metadata)),
        text(&candidates),
        text(&plan.reference.info),
        text(&(plan.repeats, plan.order_seed)),
        text(&device(gpu)),
    ];
    parts.iter().for_each(|part| key.add(part.as_bytes()));
    for channel in &plan.film.channels {
        key.add(channel.name.as_bytes());
        match &channel.samples {
            Samples::F32(samples) => key.add(samples),
            Samples::U32(samples) => key.add(samples),
        }
    }
    key.add(&plan.reference.picture.pixels);
    key.add(&crate::shaders::HASH.to_le_bytes());
    key.to_string()
}

/// Measures filters on an image, or goes on where `earlier` ended, a document of the same [`key`].
///
/// # Errors
/// What keeps every filter from being measured. The failure of one is in the document.
pub fn measure_filters(
    gpu: &Gpu,
    plan: &FilterPlan,
    earlier: Option<Document>,
    watch: &Watch,
) -> Result<(Document, Images, Ended)> {
    let begun = Instant::now();
    check_clock(gpu)?;
    let aovs = Aovs::find(plan.film, &Names::new()).map_err(|what| Error::input(plan.path, what))?;
    let earlier = earlier.map(|document| document.points).unwrap_or_default();
    let point = |candidate: &FilterCandidate| taken_up(&earlier, method(candidate), candidate.command.clone());
    let mut measuring = Measuring {
        gpu,
        plan,
        watch,
        layers: file::Layers::new(&aovs),
        outline: Outline {
            scene: &plan.scene,
            machine: machine::describe(gpu),
            seeds: (0..plan.repeats).collect(),
            order_seed: plan.order_seed,
            budget: plan.budget,
            key: key(gpu, plan),
        },
        deadline: plan.budget.map(|budget| begun + budget),
        points: plan.candidates.iter().map(point).collect(),
        pictures: plan.candidates.iter().map(|_| None).collect(),
    };
    measuring.rounds();
    measuring.missing_pictures();
    let Measuring { points, pictures, outline, .. } = measuring;
    let (document, ended) = document(&outline, points, &plan.reference, (watch.stop)());
    Ok((document, images(pictures, &plan.reference), ended))
}

impl Measuring<'_> {
    fn stopped(&self) -> bool {
        (self.watch.stop)() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    fn rounds(&mut self) {
        let total = self.points.len() as u64 * u64::from(self.plan.repeats);
        for round in 0..self.plan.repeats {
            let mut order: Vec<usize> = (0..self.points.len()).collect();
            fastrand::Rng::with_seed(self.plan.order_seed.wrapping_add(round.into())).shuffle(&mut order);
            for index in order {
                let point = &self.points[index];
                if point.failed.is_some() || point.runs.iter().any(|run| run.seed == round) {
                    continue;
                }
                if self.stopped() {
                    return;
                }
                self.measure(index, round);
                let done = self.points.iter().map(|point| point.runs.len() as u64).sum();
                (self.watch.progress)("runs", done, total);
            }
            let (so_far, _) = document(&self.outline, self.points.clone(), &self.plan.reference, true);
            (self.watch.keep)(&so_far);
        }
    }

    /// Runs a filter once more. Its image is that of its first run, and has the same errors.
    fn measure(&mut self, index: usize, round: u32) {
        let Self { gpu, plan, layers, points, pictures, .. } = self;
        match filtered(gpu, plan, layers, index, round) {
            Ok((run, warm_up, bytes, picture)) => {
                let errors = || judge(&picture, &plan.reference.picture, plan.reference.noise);
                let point = &mut points[index];
                let errors = point.runs.first().map_or_else(|| threads::within(errors), |run| run.errors);
                point.runs.push(Run { errors, ..run });
                point.warm_up.get_or_insert(warm_up);
                point.device_bytes = point.device_bytes.max(Some(bytes));
                pictures[index].get_or_insert(picture);
            }
            Err(e) => points[index].failed = Some(failure(&e)),
        }
        self.outline.machine.see_clocks(self.gpu.info());
    }

    /// Pictures of points all of whose runs were made before this program was started.
    fn missing_pictures(&mut self) {
        if self.points.iter().any(|point| lacks_runs(point, self.plan.repeats)) {
            return;
        }
        for index in 0..self.points.len() {
            if self.pictures[index].is_none() && self.points[index].failed.is_none() && !(self.watch.stop)() {
                let found = filtered(self.gpu, self.plan, &self.layers, index, 0);
                self.pictures[index] = found.ok().map(|(_, _, _, picture)| picture);
            }
        }
    }
}

fn method(candidate: &FilterCandidate) -> Method {
    Method {
        allocate: String::new(),
        filter: candidate.filter.name().to_owned(),
        rounds: None,
        reproject: None,
        options: candidate.options.clone(),
        spp: 0,
    }
}

/// One run: times without errors, costs of the first use, memory, and the image.
fn filtered(
    gpu: &Gpu,
    plan: &FilterPlan,
    layers: &file::Layers,
    index: usize,
    round: u32,
) -> Result<(Run, WarmUp, u64, Picture)> {
    let FilterCandidate { filter, settings, .. } = &plan.candidates[index];
    let scaled = |scales: &filter::Scales| settings.scaled_by(scales);
    let recipe = Recipe { settings: &scaled, ..Recipe::new(*filter) };
    let filtered = timed(gpu, layers.upload(gpu)?, &recipe)?;
    let mut run = Run {
        seed: round,
        gpu_ms: 0.0,
        wall_ms: 0.0,
        passes: Vec::new(),
        samples: 0,
        rays: None,
        errors: Default::default(),
    };
    let nothing = WarmUp { compile_ms: 0.0, first_run_ms: 0.0 };
    let warm_up = add_filter(&mut run, &nothing, &filtered);
    let picture = finite(interleaved([plan.film.width, plan.film.height], &filtered.colour))?;
    Ok((run, warm_up, filtered.device_bytes, picture))
}
