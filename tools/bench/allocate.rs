//! Measures the cost of sample allocation for each pass: medians of 9 runs over a film of random priorities. It repeats
//! this for other budgets, on which the time must not depend.
//! `cargo run --release --example bench-allocate [width height]`
use anyhow::Result;
use std::collections::BTreeMap;
use tallow::gpu::{Buffer, DeviceOptions, FrameResources, Gpu, Location};
use tallow::gpu::{PerBlock, thread_items};
use tallow::layout::PixelStats;
use tallow::profile::{median, wake};
use tallow::render::pass::apportion::Apportion;
use tallow::render::pass::counts::Counts;
use tallow::render::pass::sample_list;
use tallow::render::pass::scan::Scan;
use tallow::render::schedule::{PathRange, Plan, Share};
use tallow::report::table;

const RUNS: usize = 9;

fn main() -> Result<()> {
    let sizes: Vec<u32> = std::env::args().skip(1).map(|a| a.parse()).collect::<Result<_, _>>()?;
    let (width, height) = (sizes.first().copied().unwrap_or(1024), sizes.get(1).copied().unwrap_or(1024));
    let pixels = width * height;
    let gpu = Gpu::open(&DeviceOptions::default())?;
    println!("{width} x {height} on {}", gpu.info().name);
    let mut random = fastrand::Rng::with_seed(1);
    let priority: Vec<f32> = (0..pixels).map(|_| random.f32()).collect();
    let stats = Buffer::from_slice(&gpu, "stats", &vec![PixelStats::default(); pixels as usize])?;
    let paths = Buffer::new(&gpu, "paths", pixels as usize, Location::Device)?;
    let items = thread_items(&gpu, pixels);
    let counts = Counts::new(&gpu, pixels, items)?;
    counts.priority.write(0, &priority)?;
    let (apportion, scan) = (Apportion::new(&gpu, items)?, Scan::new(&gpu, items)?);
    let lists = PerBlock::new(&gpu, items)?;
    let carried = Buffer::from_slice(&gpu, "carried", &[0])?;
    let mut frame = FrameResources::new(&gpu)?;
    for spp in [1, 4, 64] {
        let plan = Plan { pixels, budget: u64::from(pixels) * spp, limit: None, share: Share::Next, rounds: 1 };
        let range = PathRange { first: 0, paths: pixels, round: 0, rounds: 1 };
        let mut passes: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
        wake(&gpu)?;
        for _ in 0..=RUNS {
            let times = gpu.run(&mut frame, |rec| {
                apportion.record(rec, &stats, &counts, &plan)?;
                scan.record(rec, &counts)?;
                let bind =
                    sample_list::Bind { offset: &counts.offset, stats: &stats, carried: &carried, paths: &paths };
                sample_list::record(&lists, rec, bind, &range, 0)
            })?;
            let mut sums: BTreeMap<&str, f64> = BTreeMap::new();
            for t in &times {
                let ms = t.duration_ms();
                *sums.entry(t.name).or_default() += ms;
                *sums.entry("all").or_default() += ms;
            }
            sums.into_iter().for_each(|(name, ms)| passes.entry(name).or_default().push(ms));
        }
        let row = |(name, ms): (&&str, &Vec<f64>)| {
            vec![(*name).to_owned(), format!("{:.3}", median(&ms[1..]))] // the first run compiles
        };
        println!(
            "\n{spp} samples per pixel\n{}",
            table::text(&["pass", "ms"], &passes.iter().map(row).collect::<Vec<_>>())
        );
    }
    Ok(())
}
