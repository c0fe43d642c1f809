//! Measures the cost of sample allocation against that of tracing, as in GEO's tables 1 and 2.
use super::View;
use crate::Args;
use std::collections::BTreeMap;
use tallow::gpu::{FrameResources, Gpu, PassTime};
use tallow::render::{Job, Outputs, Renderer, Step};
use tallow::report::table;

const VIEW: View = View { name: "sponza", scene: "crytek-sponza", size: [1024, 768], depth: 4, reference: 0 };
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
            let ms = |t: &PassTime| t.duration_ns() as f64 * 1e-6;
            renderer.run(&mut frame, step)?.iter().for_each(|t| *sums.entry(t.name).or_default() += ms(t));
        }
        if run > 0 {
            // the first compiles
            sums.into_iter().for_each(|(name, ms)| times.entry(name).or_default().push(ms));
        }
    }
    let median = |mut ms: Vec<f64>| {
        ms.sort_by(f64::total_cmp);
        ms[ms.len() / 2]
    };
    Ok(times.into_iter().map(|(name, ms)| (name, median(ms))).collect())
}

/// Prints both tables and the share of tracing.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    let renderer = |window, spp| -> anyhow::Result<Renderer> {
        let scene = VIEW.load(args, |s| {
            (s.spp, s.allocate.policy, s.allocate.min_spp, s.allocate.rounds) =
                (spp, &tallow::allocate::geometry::ROW, 1, 1);
            s.allocate.geometry.window = window;
        })?;
        Ok(Renderer::new(gpu, &scene, &scene.settings, Outputs { split_light: true, guides: true, counters: false })?)
    };
    let allocation = |r: &Renderer| -> anyhow::Result<(f64, f64)> {
        let steps: Vec<Step> = r.steps().filter(|s| matches!(s, Step::Allocate(_))).collect();
        r.run(&mut FrameResources::new(gpu)?, &Step::Start)?;
        let all = passes(gpu, r, &steps)?;
        let geometry = all["geometry"];
        Ok((geometry, all.values().sum::<f64>() - geometry))
    };
    let mut rows = Vec::new();
    for (window, published) in WINDOWS {
        let (importance, counts) = allocation(&renderer(window, 4)?)?;
        let cells = [importance, counts, importance + counts, published].map(|ms| format!("{ms:.2}"));
        rows.push([vec![format!("{window} x {window}")], cells.to_vec()].concat());
    }
    println!("Importance and counts, Sponza {} x {} (GEO's table 1: GTX 285)\n", VIEW.size[0], VIEW.size[1]);
    println!("{}", table::text(&["window", "importance ms", "counts ms", "both ms", "published ms"], &rows));
    samples(gpu, args, &renderer, &allocation)
}

fn samples(
    gpu: &Gpu,
    args: &Args,
    renderer: &dyn Fn(u32, u32) -> anyhow::Result<Renderer>,
    allocation: &dyn Fn(&Renderer) -> anyhow::Result<(f64, f64)>,
) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for (spp, published) in SAMPLES {
        let r = renderer(4, spp)?;
        let (importance, counts) = allocation(&r)?;
        let mut frame = FrameResources::new(gpu)?;
        let mut lists = 0.0;
        for step in r.steps().filter(|s| matches!(s, Step::Allocate(_))) {
            r.run(&mut frame, &step)?;
        }
        // Only the first list is timed; the others are as long.
        let listed: Vec<Step> = r.steps().filter(|s| matches!(s, Step::Listed(_))).collect();
        let first = passes(gpu, &r, &listed[..1])?;
        lists += first["sample_list"] * listed.len() as f64;
        rows.push(vec![
            spp.to_string(),
            format!("{:.1}", importance + counts),
            format!("{lists:.1}"),
            format!("{published:.1}"),
        ]);
    }
    println!("Placing by budget, window 4 x 4 (GEO's table 2: generating and storing)\n");
    println!("{}", table::text(&["samples per pixel", "importance and counts ms", "lists ms", "published ms"], &rows));
    share(gpu, args, renderer, allocation)
}

/// Time of sample allocation over that of tracing, at 4 samples per pixel.
fn share(
    gpu: &Gpu,
    args: &Args,
    renderer: &dyn Fn(u32, u32) -> anyhow::Result<Renderer>,
    allocation: &dyn Fn(&Renderer) -> anyhow::Result<(f64, f64)>,
) -> anyhow::Result<()> {
    let placed = renderer(4, 4)?;
    let (importance, counts) = allocation(&placed)?;
    let mut frame = FrameResources::new(gpu)?;
    let (mut lists, mut traced) = (0.0, 0.0);
    for t in Job::new(&placed).run_to_end(&mut frame)?.times {
        let ms = t.duration_ns() as f64 * 1e-6;
        lists += if t.name == "sample_list" { ms } else { 0.0 };
        traced += if matches!(t.name, "path" | "accumulate") { ms } else { 0.0 };
    }
    let scene = VIEW.load(args, |s| s.spp = 4)?;
    let uniform = super::render(gpu, &scene)?;
    let all = importance + counts + lists;
    println!(
        "Placing 4 samples per pixel at depth {}: importance {importance:.2} + counts {counts:.2} + lists {lists:.2} =",
        VIEW.depth
    );
    println!(
        "{all:.2} ms, {:.2} % of the {:.0} ms that tracing them uniformly takes",
        100.0 * all / uniform.path_ms,
        uniform.path_ms
    );
    println!("({traced:.0} ms where they are placed)\n");
    Ok(())
}
