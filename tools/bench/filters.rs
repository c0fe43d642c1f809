//! Compares the time of a filter on the device with that of the program that a user would choose instead. Both alternate
//! within one run; the ratio is that of the medians, after a first untimed run of each.
//!   cargo run --release --example bench-filters -- atrous|guided|bilateral [ROUNDS] [PEERS]
//! PEERS is the folder that $TALLOW_DATA/peers/setup.sh installed into; without it our filter runs alone.
#![allow(missing_docs)]
use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;
use tallow::denoise::filter::{self, Filter, FilterInput, FilterSettings, GuidedSums, Planes, Row};
use tallow::gpu::{DeviceOptions, FrameResources, Gpu, PassTime, total_ms};
use tallow::layout::Guide;
use tallow::profile::{median, wake};

/// Pause after a peer's run, whose threads spin for a while before they sleep and would take our cores.
const PAUSE: Duration = Duration::from_millis(50);

/// What is timed: our settings, and the request to the peer.
struct Case {
    size: [u32; 2],
    /// Our settings by name. The peer is compared with the first.
    settings: Vec<(&'static str, FilterSettings)>,
    peer: &'static str,
}

fn case(name: &str) -> Result<Case> {
    let base = FilterSettings::default();
    let radius = |radius| base.with(|s| s.footprint.radius = radius);
    Ok(match name {
        "atrous" => Case { size: [512, 512], settings: vec![("5 levels, 3 weights", base)], peer: "oidn" },
        "guided" => Case {
            size: [1024, 768],
            settings: vec![
                ("radius 24", radius(24)),
                ("radius 8", radius(8)),
                ("radius 64", radius(64)),
                ("radius 200", radius(200)),
                ("radius 24, tables", radius(24).with(|s| s.guided.sums = GuidedSums::Table)),
            ],
            peer: "guided 24",
        },
        // The joint form is weighted only by the guide, as in OpenCV's jointBilateralFilter and in GIF.
        "bilateral" => Case {
            size: [1024, 768],
            settings: vec![("radius 24", base.with(|s| s.edge.sigma_rt = f32::INFINITY))],
            peer: "bilateral 24",
        },
        _ => bail!("{name}: choose atrous, guided or bilateral"),
    })
}

/// A checkered floor under exponential noise, as peers.py makes it, with positions.
fn picture([width, height]: [u32; 2]) -> FilterInput {
    let mut random = fastrand::Rng::with_seed(1);
    let mut noise = || -0.2 * (1.0 - random.f32()).ln();
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

/// Largest difference of guided's two kinds of sums from the definition in double precision, in units of the image's
/// mean; the depths begin at `near`.
fn errors(gpu: &Gpu, row: &Row, near: f32) -> Result<()> {
    let mut input = picture([512, 384]);
    input.guide.iter_mut().for_each(|g| g.depth += near);
    let base = FilterSettings::default().with(|s| s.footprint.radius = 8).scaled_to(&input);
    let truth = (row.reference)(&input, &base);
    let mean = truth.iter().map(|c| c[1]).sum::<f32>() / truth.len() as f32;
    let error = |sums| -> Result<f32> {
        let (image, _) = filter::run(gpu, row, &input, &base.with(|s| s.guided.sums = sums))?;
        let channels = image.iter().flatten().zip(truth.iter().flatten());
        Ok(channels.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) / mean)
    };
    let (blocks, table) = (error(GuidedSums::Blocks)?, error(GuidedSums::Table)?);
    println!("512x384, radius 8, depths from {near}: largest error {blocks:.1e} by blocks, {table:.1e} by tables");
    Ok(())
}

/// The process that runs the peers.
struct Peer {
    child: Child,
    ask: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Peer {
    fn start(folder: &Path, [width, height]: [u32; 2]) -> Result<Self> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/bench/peers.py");
        let shell = r#". "$0/env.sh" && exec "$0/venv/bin/python" "$@""#;
        let mut command = Command::new("bash");
        command.args(["-c", shell]).arg(folder).arg(script).args([width, height].map(|n| n.to_string()));
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().context("cannot start bash")?;
        let (ask, answers) = (child.stdin.take(), child.stdout.take());
        Ok(Self { child, ask: ask.context("no input")?, answers: BufReader::new(answers.context("no output")?) })
    }

    fn milliseconds(&mut self, what: &str) -> Result<f64> {
        writeln!(self.ask, "{what}")?;
        let mut line = String::new();
        self.answers.read_line(&mut line)?;
        line.trim().parse().context("the peer has stopped")
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It does not matter how it ends.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// One of our settings, and the pass times of every round.
struct Ours {
    name: &'static str,
    filter: Box<dyn Filter>,
    runs: Vec<Vec<PassTime>>,
}

impl Ours {
    fn milliseconds(&self, of: impl Fn(usize, &PassTime) -> bool) -> f64 {
        let run = |run: &Vec<PassTime>| total_ms(run.iter().enumerate().filter(|(i, p)| of(*i, p)).map(|(_, p)| p));
        median(&self.runs.iter().map(run).collect::<Vec<_>>())
    }

    /// Prints every pass of filters with few passes, and every kernel of others.
    fn print(&self) {
        let passes: Vec<&str> = self.runs[0].iter().map(|p| p.name).collect();
        let mut kernels = passes.clone();
        kernels.sort_unstable();
        kernels.dedup();
        if passes.len() < 10 {
            passes
                .iter()
                .enumerate()
                .for_each(|(i, name)| println!("  {name:24} {:8.3}", self.milliseconds(|j, _| i == j)));
        } else {
            kernels.iter().for_each(|name| println!("  {name:24} {:8.3}", self.milliseconds(|_, p| p.name == *name)));
        }
    }
}

fn main() -> Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let name = args.first().context("name a filter: atrous, guided or bilateral")?;
    let rounds: usize = args.get(1).map_or(Ok(7), |a| a.parse())?;
    let (row, case): (&Row, _) = (filter::find(name).context("no such filter")?, case(name)?);
    let gpu = Gpu::open(&DeviceOptions { device: std::env::var("TALLOW_DEVICE").ok(), ..DeviceOptions::default() })?;
    let input = picture(case.size);
    let planes = Planes::new(&gpu, &input)?;
    let make = |(name, s): &(&'static str, FilterSettings)| {
        let filter = row.compile(&gpu, &s.scaled_to(&input), case.size)?;
        Ok(Ours { name, filter, runs: Vec::new() })
    };
    let mut ours: Vec<Ours> = case.settings.iter().map(make).collect::<Result<_>>()?;
    let mut peer = args.get(2).map(|folder| Peer::start(Path::new(folder), case.size)).transpose()?;
    let (mut frame, mut theirs) = (FrameResources::new(&gpu)?, Vec::new());
    for round in 0..=rounds {
        let peer = peer.as_mut().map(|peer| peer.milliseconds(case.peer)).transpose()?;
        if peer.is_some() {
            sleep(PAUSE);
        }
        wake(&gpu)?;
        for ours in &mut ours {
            let times = gpu.run(&mut frame, |rec| ours.filter.record(rec, &planes))?;
            if round > 0 {
                ours.runs.push(times);
            }
        }
        theirs.extend(peer.filter(|_| round > 0));
    }
    println!(
        "{name}, {}x{}, on {}; milliseconds, medians of {rounds} rounds",
        case.size[0],
        case.size[1],
        gpu.info().name
    );
    ours[0].print();
    if name == "guided" {
        [0.0, 1e2, 1e4].iter().try_for_each(|near| errors(&gpu, row, *near))?;
    }
    let first = ours[0].milliseconds(|_, _| true);
    for ours in &ours {
        let ms = ours.milliseconds(|_, _| true);
        println!("{:26} {ms:8.3}, {:.3} of the first", ours.name, ms / first);
    }
    if !theirs.is_empty() {
        let theirs = median(&theirs);
        println!("peer ({})  {theirs:.2}; ours / theirs {:.2}", case.peer, first / theirs);
    }
    Ok(())
}
