//! The same for filters alone, on a given image of any renderer: its noise is what it is, so only times vary between runs.
use super::Images;
use super::assemble::{Ended, Outline, document, failure, images};
use super::document::{Document, Method, Point, Run, SceneInfo, WarmUp};
use super::judge::judge;
use super::machine;
use super::plan::Watch;
use super::reference::Reference;
use super::session::{add_filter, check_clock, finite, interleaved};
use crate::denoise::filter::{self, FilterSettings};
use crate::denoise::{Recipe, file, timed};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::aov::{Aovs, Names};
use crate::image::{Film, Picture};
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

/// Measures filters on an image.
///
/// # Errors
/// What keeps every filter from being measured. The failure of one is in the document.
pub fn measure_filters(gpu: &Gpu, plan: &FilterPlan, watch: &Watch) -> Result<(Document, Images, Ended)> {
    let begun = Instant::now();
    check_clock(gpu)?;
    let aovs = Aovs::find(plan.film, &Names::new()).map_err(|what| Error::input(plan.path, what))?;
    let layers = file::Layers::new(&aovs);
    let mut points: Vec<Point> = plan.candidates.iter().map(point).collect();
    let mut pictures: Vec<Option<Picture>> = plan.candidates.iter().map(|_| None).collect();
    let in_time = || plan.budget.is_none_or(|budget| begun.elapsed() < budget) && !(watch.stop)();
    let total = points.len() as u64 * u64::from(plan.repeats);
    let mut machine = machine::describe(gpu);
    for round in 0..plan.repeats {
        let mut order: Vec<usize> = (0..points.len()).filter(|&i| points[i].failed.is_none()).collect();
        fastrand::Rng::with_seed(plan.order_seed.wrapping_add(round.into())).shuffle(&mut order);
        for index in order.into_iter().filter(|_| in_time()) {
            match filtered(gpu, plan, &layers, index, round) {
                Ok((run, warm_up, bytes, picture)) => {
                    let errors = || judge(&picture, &plan.reference.picture, plan.reference.noise);
                    let errors = points[index].runs.first().map_or_else(|| threads::within(errors), |run| run.errors);
                    points[index].runs.push(Run { errors, ..run });
                    points[index].warm_up.get_or_insert(warm_up);
                    points[index].device_bytes = Some(bytes);
                    pictures[index].get_or_insert(picture);
                }
                Err(e) => points[index].failed = Some(failure(&e)),
            }
            machine.see_clocks(gpu.info());
            (watch.progress)("runs", points.iter().map(|point| point.runs.len() as u64).sum(), total);
        }
    }
    let outline = Outline {
        scene: &plan.scene,
        machine,
        seeds: (0..plan.repeats).collect(),
        order_seed: plan.order_seed,
        budget: plan.budget,
        key: String::new(),
    };
    let (document, ended) = document(&outline, points, &plan.reference, (watch.stop)());
    Ok((document, images(pictures, &plan.reference), ended))
}

fn point(candidate: &FilterCandidate) -> Point {
    let method = Method {
        allocate: String::new(),
        filter: candidate.filter.name().to_owned(),
        rounds: None,
        reproject: None,
        options: candidate.options.clone(),
        spp: 0,
    };
    Point::unmeasured(method, candidate.command.clone())
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
