//! The cost of sample allocation beside that of tracing, as in GEO's tables 1 and 2.
use crate::Args;
use crate::published::view::View;
use crate::published::{Section, placed, push};
use std::collections::BTreeMap;
use tallow::allocate::geometry;
use tallow::gpu::{FrameResources, Gpu};
use tallow::profile::median;
use tallow::render::{Job, Outputs, Renderer, Step, traces_paths};
use tallow::report::html::Table;

/// The paper's resolution, which software devices render in time too: what is placed does not depend on the scene.
const VIEW: View =
    View { name: "sponza", scene: "crytek-sponza", size: [1024, 768], full: [1024, 768], depth: 4, reference: 0 };
const RUNS: usize = 5;

/// GEO's table 1 (1024 x 768, GTX 285): window, and milliseconds for importance and rates.
const WINDOWS: [(u32, f64); 5] = [(2, 8.3), (4, 26.2), (6, 50.7), (8, 84.9), (10, 128.7)];
/// GEO's table 2: samples per pixel, and milliseconds for generating and storing them.
const SAMPLES: [(u32, f64); 3] = [(4, 2.3), (16, 3.6), (64, 8.5)];

/// Median milliseconds of every pass of a step.
fn passes(gpu: &Gpu, renderer: &Renderer, steps: &[Step]) -> anyhow::Result<BTreeMap<&'static str, f64>> {
    let mut frame = FrameResources::new(gpu)?;
    let mut times: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for run in 0..=RUNS {
        let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
        for step in steps {
            renderer.run(&mut frame, step)?.iter().for_each(|t| *sums.entry(t.name).or_default() += t.duration_ms());
        }
        if run > 0 {
            // the first compiles
            sums.into_iter().for_each(|(name, ms)| times.entry(name).or_default().push(ms));
        }
    }
    Ok(times.into_iter().map(|(name, ms)| (name, median(&ms))).collect())
}

/// # Errors
/// When the scene cannot be found, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let how = "Milliseconds of the device, medians of 5 runs, Crytek Sponza at 1024x768; the paper's device is a GTX 285. Our counts \
        meet the budget exactly, where the paper leaves a remainder.";
    let mut section = Section::new("GEO, tables 1 and 2: what placing costs", &[how]);
    let mut windows = Table::new("GEO, table 1", &["window", "importance", "counts", "both", "published"]);
    for (window, published) in WINDOWS {
        let Allocation { importance, counts } = allocation(gpu, &renderer(gpu, args, window, 4)?)?;
        let cells = [importance, counts, importance + counts, published].map(|ms| format!("{ms:.2}"));
        push(&mut windows, [format!("{window} x {window}")].into_iter().chain(cells));
    }
    let header = ["samples per pixel", "importance and counts", "lists", "published, generating and storing"];
    let mut samples = Table::new("GEO, table 2, window 4 x 4", &header);
    for (spp, published) in SAMPLES {
        let renderer = renderer(gpu, args, 4, spp)?;
        let Allocation { importance, counts } = allocation(gpu, &renderer)?;
        let cells = [importance + counts, lists(gpu, &renderer)?, published].map(|ms| format!("{ms:.1}"));
        push(&mut samples, [spp.to_string()].into_iter().chain(cells));
    }
    section.tables.extend([windows, samples]);
    section.texts.push(share(gpu, args)?);
    Ok(section)
}

/// Milliseconds of deciding where samples go.
struct Allocation {
    importance: f64,
    counts: f64,
}

fn renderer(gpu: &Gpu, args: &Args, window: u32, spp: u32) -> anyhow::Result<Renderer> {
    let scene = VIEW.load(args, |s| {
        (s.spp, s.allocate.policy, s.allocate.min_spp, s.allocate.rounds) = (spp, &geometry::ROW, 1, 1);
        s.allocate.geometry.window = window;
    })?;
    Ok(Renderer::new(gpu, &scene, &scene.settings, Outputs::FILTERED)?)
}

fn allocation(gpu: &Gpu, renderer: &Renderer) -> anyhow::Result<Allocation> {
    let steps: Vec<Step> = renderer.steps().filter(|s| matches!(s, Step::Allocate(_))).collect();
    renderer.run(&mut FrameResources::new(gpu)?, &Step::Start)?;
    let all = passes(gpu, renderer, &steps)?;
    let importance = all["geometry"];
    Ok(Allocation { importance, counts: all.values().sum::<f64>() - importance })
}

/// Only the first list is timed; the others are as long.
fn lists(gpu: &Gpu, renderer: &Renderer) -> anyhow::Result<f64> {
    let mut frame = FrameResources::new(gpu)?;
    for step in renderer.steps().filter(|s| matches!(s, Step::Allocate(_))) {
        renderer.run(&mut frame, &step)?;
    }
    let listed: Vec<Step> = renderer.steps().filter(|s| matches!(s, Step::Listed(_))).collect();
    Ok(passes(gpu, renderer, &listed[..1])?["sample_list"] * listed.len() as f64)
}

/// Time of sample allocation over that of tracing, at 4 samples per pixel.
fn share(gpu: &Gpu, args: &Args) -> anyhow::Result<String> {
    let placed = renderer(gpu, args, 4, 4)?;
    let Allocation { importance, counts } = allocation(gpu, &placed)?;
    let (mut lists, mut traced) = (0.0, 0.0);
    for t in Job::new(&placed).run_to_end(&mut FrameResources::new(gpu)?)?.times {
        let ms = t.duration_ms();
        lists += if t.name == "sample_list" { ms } else { 0.0 };
        traced += if traces_paths(t.name) || t.name == "accumulate" { ms } else { 0.0 };
    }
    let uniform = placed::render(gpu, &VIEW.load(args, |s| s.spp = 4)?)?;
    let all = importance + counts + lists;
    Ok(format!(
        "Placing 4 samples per pixel at depth {}: importance {importance:.2} + counts {counts:.2} + lists {lists:.2} = {all:.2} ms, \
         {:.2} % of the {:.0} ms that tracing them uniformly takes ({traced:.0} ms where they are placed).",
        VIEW.depth,
        100.0 * all / uniform.path_ms,
        uniform.path_ms
    ))
}
