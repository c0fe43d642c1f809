//! Measures filters alone, on a given image of any renderer: its noise is what it is, so only times vary between runs.
use super::Images;
use super::assemble::{Ended, Outline, taken_up};
use super::document::{Document, Method, Run, SceneInfo, WarmUp};
use super::machine;
use super::plan::{Watch, device, text, values};
use super::reference::Reference;
use super::rounds::{Measured, Measuring, Outcome, Runs};
use super::session::add_filter;
use crate::denoise::filter::{self, FilterSettings};
use crate::denoise::{Recipe, file, timed};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::aov::{Aovs, Names};
use crate::image::{Film, Picture, Samples};
use crate::scene::Fingerprint;
use std::path::Path;
use std::time::{Duration, Instant};

/// A filter to measure.
pub struct FilterCandidate {
    /// The filter.
    pub filter: filter::Method,
    /// Its settings; those at their defaults are scaled to the image.
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

/// The filters of a plan, each of which is a group of one point.
struct Filters<'a> {
    gpu: &'a Gpu,
    plan: &'a FilterPlan<'a>,
    layers: file::Layers<'a>,
}

/// Identifies what is measured, where and how.
pub fn key(gpu: &Gpu, plan: &FilterPlan) -> String {
    let mut key = Fingerprint::default();
    let settings = |candidate: &FilterCandidate| (method(candidate), values(&candidate.settings.entries()));
    let candidates: Vec<_> = plan.candidates.iter().map(settings).collect();
    let size = plan.film.size();
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
    gpu.check_clock()?;
    let aovs = Aovs::find(plan.film, &Names::new()).map_err(|what| Error::input(plan.path, what))?;
    let earlier = earlier.map(|document| document.points).unwrap_or_default();
    let point = |candidate: &FilterCandidate| taken_up(&earlier, method(candidate), candidate.command.clone());
    let measuring = Measuring {
        gpu,
        watch,
        runs: Filters { gpu, plan, layers: file::Layers::new(&aovs) },
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
    Ok(measuring.finish(&plan.reference))
}

fn method(candidate: &FilterCandidate) -> Method {
    let (filter, options) = (candidate.filter.name().to_owned(), candidate.options.clone());
    Method { filter, options, ..Method::default() }
}

impl Runs for Filters<'_> {
    const ALIKE: bool = true;

    fn groups(&self) -> Vec<Vec<usize>> {
        (0..self.plan.candidates.len()).map(|index| vec![index]).collect()
    }

    fn run(&mut self, group: usize, seed: u32, _: &[usize], _: &dyn Fn() -> bool) -> Outcome {
        vec![(group, self.filtered(group, seed))]
    }
}

impl Filters<'_> {
    fn filtered(&self, point: usize, seed: u32) -> Result<Measured> {
        let FilterCandidate { filter, settings, .. } = &self.plan.candidates[point];
        let scaled = |scales: &filter::Scales| settings.scaled_at_defaults(scales);
        let recipe = Recipe { settings: &scaled, ..Recipe::new(*filter) };
        let filtered = timed(self.gpu, self.layers.upload(self.gpu)?, &recipe)?;
        let mut run = Run { seed, ..Run::default() };
        let warm_up = add_filter(&mut run, &WarmUp::default(), &filtered);
        let size = self.plan.film.size();
        let picture = self.plan.film.as_rec709(Picture::of_planes(size, &filtered.colour));
        let picture = picture.finite().map_err(Error::Device)?;
        Ok(Measured { point, run, picture, warm_up, device_bytes: filtered.device_bytes })
    }
}
