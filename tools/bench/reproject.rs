//! Measures what it is worth to carry samples from frame to frame, after the experiment of Schalk 2018: the camera turns by a
//! total angle in steps, and the frames after the last step are compared with a converged image. Arms: every frame anew
//! (uniform); carried samples; carried samples and placed ones; each of them filtered.
//!   cargo run --release --example bench-reproject -- SCENE [WIDTH HEIGHT SPP DEGREES STEPS REFERENCE_SPP]
#![allow(missing_docs)]
use anyhow::{Context, Result};
use glam::{Quat, Vec3};
use std::path::Path;
use tallow::allocate::policy;
use tallow::denoise::filter::Method;
use tallow::denoise::{Filtered, Noisy, Recipe};
use tallow::gpu::{DeviceOptions, FrameResources, Gpu, PassTime};
use tallow::image::{Picture, metrics};
use tallow::layout::{Camera, vec3};
use tallow::render::settings::Settings;
use tallow::render::{Carriage, History, Job, Outputs, Renderer, Reproject, Step};
use tallow::report::table;
use tallow::scene::{Loaded, Scene};

/// Share of the pixels that are left out of an error, those where it is largest: fireflies would decide it alone.
const TRIMMED: f64 = 0.001;

/// How a sequence of frames is rendered.
struct Arm {
    name: &'static str,
    policy: &'static str,
    carries: bool,
}

const ARMS: [Arm; 4] = [
    Arm { name: "uniform", policy: "uniform", carries: false },
    Arm { name: "reprojection", policy: "uniform", carries: true },
    Arm { name: "placed", policy: "variance", carries: false },
    Arm { name: "reprojection, placed", policy: "variance", carries: true },
];

struct Turn {
    degrees: f32,
    steps: u32,
    spp: u32,
}

impl Turn {
    fn camera(&self, first: &Camera, step: u32) -> Camera {
        let angle = (self.degrees * step as f32 / self.steps as f32).to_radians();
        let turn = Quat::from_axis_angle(Vec3::from(first.up).normalize(), angle);
        let of = |v: vec3| (turn * Vec3::from(v)).to_array();
        Camera { right: of(first.right), up: of(first.up), forward: of(first.forward), ..*first }
    }
}

/// What was seen at the end of a turn.
struct Row {
    arm: &'static str,
    error: f64,
    filtered: f64,
    /// GPU time of a frame, the median of all but the first two, whose kernels are compiled: in all, and of what begins it with carried
    /// samples.
    frame_ms: f64,
    reproject_ms: f64,
    carriage: Option<Carriage>,
}

const CARRYING: [&str; 3] = ["remember", "project", "carry"];

fn milliseconds(times: &[PassTime], of: impl Fn(&str) -> bool) -> f64 {
    times.iter().filter(|t| of(t.name)).fold(0.0, |sum, t| sum + t.duration_ns() as f64 * 1e-6)
}

/// Median of all frames but the first two.
fn median(frames: &[[f64; 2]], column: usize) -> f64 {
    let mut later: Vec<f64> = frames.iter().skip(2).map(|f| f[column]).collect();
    later.sort_by(f64::total_cmp);
    later.get(later.len() / 2).copied().unwrap_or(f64::NAN)
}

fn radiance(renderer: &Renderer, size: [u32; 2]) -> Result<Picture> {
    let stats = renderer.film().tiles[0].stats.read()?;
    Ok(Picture { width: size[0], height: size[1], pixels: stats.iter().map(|s| s.mean).collect() })
}

fn error(picture: &Picture, reference: &Picture) -> f64 {
    metrics::trimmed_mean(metrics::relative_squares(picture, reference), TRIMMED)
}

fn run(gpu: &Gpu, scene: &Loaded, arm: &Arm, turn: &Turn, reference: &Picture) -> Result<Row> {
    let scene = scene.clone().with(|s| {
        s.spp = turn.spp;
        s.allocate.policy = policy(arm.policy).unwrap_or(s.allocate.policy);
        s.allocate.min_spp = 2.min(turn.spp); // of one sample, no noise is known
    });
    let size = [scene.settings.width, scene.settings.height];
    let outputs = Outputs { split_light: true, guides: true, counters: false };
    let mut renderer = Renderer::new(gpu, &scene, &scene.settings, outputs)?;
    if arm.carries {
        renderer.keep_history(Reproject::default())?;
    }
    let (first, mut frame, mut frames) = (scene.camera(size)?, FrameResources::new(gpu)?, Vec::new());
    for step in 0..=turn.steps {
        renderer.set_camera(turn.camera(&first, step))?;
        renderer.set_seed(step);
        let mut times = Vec::new();
        let steps: Vec<Step> = match arm.carries {
            true => {
                let (began, rest) = renderer.begin_frame(&mut frame)?;
                times.extend(began);
                rest
            }
            false => renderer.steps().collect(),
        };
        for step in &steps {
            times.extend(renderer.run(&mut frame, step)?);
        }
        frames.push([milliseconds(&times, |_| true), milliseconds(&times, |name| CARRYING.contains(&name))]);
    }
    let picture = radiance(&renderer, size)?;
    let method = Method::all().find(|method| method.name() == "atrous").context("a filter of that name")?;
    let (colour, _) = Filtered::new(gpu, Noisy::of_film(&renderer)?, &Recipe::new(method))?.join(gpu)?;
    let [r, g, b] = colour;
    let pixels = r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect();
    let filtered = Picture { pixels, ..picture.clone() };
    Ok(Row {
        arm: arm.name,
        error: error(&picture, reference),
        filtered: error(&filtered, reference),
        frame_ms: median(&frames, 0),
        reproject_ms: median(&frames, 1),
        carriage: if arm.carries { Some(renderer.carriage()?) } else { None },
    })
}

fn share(n: u64, of: u64) -> String {
    format!("{:.1} %", 100.0 * n as f64 / of as f64)
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().context("name a scene")?;
    let numbers: Vec<f32> = arguments.map(|a| a.parse()).collect::<Result<_, _>>()?;
    let or = |i: usize, default: f32| numbers.get(i).copied().unwrap_or(default);
    let (width, height, reference_spp) = (or(0, 320.0) as u32, or(1, 180.0) as u32, or(5, 1024.0) as u32);
    let turn = Turn { spp: or(2, 4.0) as u32, degrees: or(3, 40.0), steps: or(4, 8.0) as u32 };
    let gpu = Gpu::open(&DeviceOptions::default())?;
    let size = |s: &mut Settings| (s.width, s.height, s.max_depth) = (width, height, s.max_depth.min(4));
    let scene = Scene::load(Path::new(&file)).map(|scene| scene.with(size))?;
    let info = gpu.info();
    println!("{file}, {width} x {height}, {} ({} {})", info.name, info.driver_name, info.driver_info);
    println!(
        "{} degrees in {} steps, {} samples a pixel each; relative MSE without the largest 0.1 %",
        turn.degrees, turn.steps, turn.spp
    );
    let bytes = [false, true].map(History::bytes_per_pixel);
    println!("history: {} bytes a pixel, {} with direct and indirect light apart\n", bytes[0], bytes[1]);

    let long = scene.clone().with(|s| (s.spp, s.seed) = (reference_spp, 1 << 20));
    let mut renderer = Renderer::new(&gpu, &long, &long.settings, Outputs::default())?;
    renderer.set_camera(turn.camera(&scene.camera([width, height])?, turn.steps))?;
    Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu)?)?;
    let reference = radiance(&renderer, [width, height])?;
    drop(renderer);

    let rows: Vec<Row> = ARMS.iter().map(|arm| run(&gpu, &scene, arm, &turn, &reference)).collect::<Result<_>>()?;
    let base = rows[0].error;
    let cells = |r: &Row| {
        let [error, filtered] = [r.error, r.filtered].map(|e| format!("{e:.4}"));
        let [frame, carrying] = [r.frame_ms, r.reproject_ms].map(|ms| format!("{ms:.1}"));
        vec![r.arm.to_owned(), error, format!("{:.2}", r.error / base), filtered, frame, carrying]
    };
    let head = ["arm", "error", "of uniform", "filtered", "frame ms", "carrying ms"];
    println!("{}\n", table::text(&head, &rows.iter().map(cells).collect::<Vec<_>>()));
    let pixels = u64::from(width * height);
    for (name, c) in rows.iter().filter_map(|r| Some((r.arm, r.carriage?))) {
        let [carried, new, edges] = [c.carried, c.new, c.new_edges].map(|n| share(n, pixels));
        println!(
            "{name}: {carried} of the pixels carried with {:.1} samples each, {new} new, {edges} at edges;",
            c.samples as f64 / c.carried.max(1) as f64
        );
        let dropped = [
            ("sky", c.sky),
            ("specular", c.specular),
            ("edge", c.edge),
            ("old", c.old),
            ("outside", c.outside),
            ("hidden", c.hidden),
            ("view", c.view),
            ("another was nearer", c.lost),
        ];
        let words: Vec<String> = dropped.iter().map(|(why, n)| format!("{why} {}", share(*n, pixels))).collect();
        println!("  of the last frame's, dropped: {}", words.join(", "));
    }
    Ok(())
}
