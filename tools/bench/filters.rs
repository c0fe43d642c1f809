//! Milliseconds of the filters on the device: medians over rounds, after a first run that compiles the kernels.
//!   cargo run --release --example bench-filters -- [NAME WIDTH HEIGHT ROUNDS]
#![allow(missing_docs)]
use anyhow::{Context, Result};
use std::collections::BTreeSet;
use tallow::filter::{FilterInput, FilterSettings, Planes, find};
use tallow::gpu::layout::Guide;
use tallow::gpu::{DeviceOptions, FrameResources, Gpu, PassTime};

/// A checkered floor under exponential noise, as opencv_bench.py makes it, with positions.
fn picture(width: u32, height: u32) -> FilterInput {
    let mut state = 1u32;
    let mut noise = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        -0.2 * ((state >> 8) as f32 / 16_777_216.0 + 1e-7).ln()
    };
    let mut pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
        let normal = if (x / 64 + y / 64) % 2 == 0 { [0.0, 0.6, 0.8] } else { [0.0, 0.0, 1.0] };
        let guide =
            Guide { normal, depth: 2.0 + u + v, position: [u, v, -2.0 - u], albedo: [0.5; 3], ..Guide::default() };
        ([0.1 + normal[1] + noise(), 0.1 + 0.8 * u + noise(), 0.1 + 0.8 * v + noise(), 1.0], guide)
    };
    let (radiance, guide) = (0..width * height).map(&mut pixel).unzip();
    FilterInput { width, height, radiance, guide, variance: None }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let name = args.first().map_or("atrous", String::as_str);
    let number = |i: usize, or: u32| args.get(i).map_or(Ok(or), |a| a.parse());
    let (width, height, rounds) = (number(1, 512)?, number(2, 512)?, number(3, 11)?);
    let gpu = Gpu::open(&DeviceOptions { device: std::env::var("TALLOW_DEVICE").ok(), validation: false })?;
    let input = picture(width, height);
    let row = find(name).context("no such filter")?;
    let mut settings = FilterSettings::default().scaled_to(&input);
    if name == "bilateral" {
        settings.sigma_rt = f32::INFINITY; // joint: by the guide alone, as OpenCV's jointBilateralFilter and GIF's
    }
    let planes = Planes::new(&gpu, &input)?;
    let filter = (row.make)(&gpu, &settings, planes.size)?;
    let mut frame = FrameResources::new(&gpu)?;
    let mut round = || gpu.run(&mut frame, |rec| filter.record(rec, &planes));
    round()?;
    let runs = (0..rounds).map(|_| round()).collect::<tallow::error::Result<Vec<_>>>()?;
    let ms = |p: &PassTime| (p.end_ns - p.begin_ns) as f64 * 1e-6;
    let total = |kernel: Option<&str>| {
        let of = |run: &Vec<PassTime>| run.iter().filter(|p| kernel.is_none_or(|k| k == p.name)).map(ms).sum::<f64>();
        let times: Vec<f64> = runs.iter().map(of).collect();
        (times.iter().copied().fold(f64::INFINITY, f64::min), median(times))
    };
    let kernels: BTreeSet<&str> = runs[0].iter().map(|p| p.name).collect();
    for kernel in kernels {
        let (best, median) = total(Some(kernel));
        println!("{kernel:24} best {best:8.2} ms, median {median:8.2} ms");
    }
    let (best, median) = total(None);
    println!("{name} {width}x{height}: best {best:.2} ms, median {median:.2} ms of {rounds}, on {}", gpu.info().name);
    Ok(())
}
