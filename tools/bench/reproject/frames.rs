//! Frames of a camera that moves through a scene, or of what a scene animates: the error of each, and how much it flickers.
use crate::film::{Arm, Film, Reference, carries, milliseconds};
use crate::{View, plot};
use anyhow::Result;
use glam::{Quat, Vec3};
use tallow::gpu::Gpu;
use tallow::layout::{Camera, vec3};
use tallow::render::{Carriage, Reproject};
use tallow::report::table;
use tallow::scene::{Change, Loaded};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    view: View,
    #[arg(long, default_value_t = 48)]
    frames: u32,
    /// Samples a pixel of a frame
    #[arg(long, default_value_t = 1)]
    spp: u32,
    /// Frames per second of what is animated
    #[arg(long, default_value_t = 24.0)]
    fps: f64,
    /// Degrees that the camera turns by in a frame
    #[arg(long, default_value_t = 0.5)]
    turn: f32,
    /// How far it goes forward in a frame, in thousandths of the scene's diagonal
    #[arg(long, default_value_t = 1.0)]
    walk: f32,
    /// Filter of the arms that filter
    #[arg(long, default_value = "atrous", value_delimiter = ',')]
    filters: Vec<String>,
}

/// The camera of a frame: of the scene's own, or on its way.
fn camera(args: &Args, scene: &Loaded, frame: u32) -> Result<Camera> {
    let first = scene.camera([args.view.width, args.view.height])?;
    let turn = Quat::from_axis_angle(Vec3::from(first.up).normalize(), (args.turn * frame as f32).to_radians());
    let of = |v: vec3| (turn * Vec3::from(v)).to_array();
    let reach = Vec3::from(scene.bounds[1]).distance(scene.bounds[0].into());
    let step = args.walk * 1e-3 * reach * frame as f32;
    let position = (Vec3::from(first.position) + step * Vec3::from(first.forward)).to_array();
    Ok(Camera { position, right: of(first.right), up: of(first.up), forward: of(first.forward), ..first })
}

struct Line {
    name: String,
    errors: Vec<f64>,
    flicker: f64,
    frame_ms: f64,
    carrying_ms: f64,
    sum: Carriage,
}

/// What changes in a scene from one frame to the next.
fn pose(args: &Args, scene: &mut Loaded, frame: u32) -> Result<Option<Change>> {
    if scene.animation.is_empty() {
        return Ok(None);
    }
    let pose = scene.animation.at(f64::from(frame) / args.fps)?;
    Ok(Some(scene.apply(&pose)?))
}

fn measure(gpu: &Gpu, args: &Args, name: String, arm: Arm, references: &[Reference]) -> Result<Line> {
    let mut scene = args.view.load()?;
    let mut film = Film::new(gpu, &scene, arm, args.spp)?;
    let (mut errors, mut offs, mut times) = (Vec::new(), Vec::new(), Vec::new());
    let mut sum = Carriage::default();
    for (frame, reference) in (0..).zip(references) {
        let change = pose(args, &mut scene, frame)?;
        let camera = camera(args, &scene, frame)?;
        let passes = film.shoot(camera, change.as_ref().map(|change| (&scene, change)), frame)?;
        let (picture, filtering) = film.picture()?;
        errors.push(reference.error(&picture));
        offs.push(reference.off(&picture));
        times.push([milliseconds(&passes, |_| true) + filtering, milliseconds(&passes, carries)]);
        if arm.carries.is_some() {
            sum = film.renderer.carriage()?;
        }
    }
    // The mean absolute difference of successive error images.
    let change = |pair: &[Vec<f64>]| {
        pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).sum::<f64>() / pair[0].len() as f64
    };
    let flicker = offs.windows(2).skip(7).map(change).sum::<f64>() / offs.len().saturating_sub(8).max(1) as f64;
    let of = |column: usize| tallow::profile::median(&times.iter().skip(2).map(|t| t[column]).collect::<Vec<_>>());
    Ok(Line { name, errors, flicker, frame_ms: of(0), carrying_ms: of(1), sum })
}

pub fn run(gpu: &Gpu, args: &Args) -> Result<()> {
    args.view.tell(gpu);
    let mut scene = args.view.load()?;
    let mut references = Vec::new();
    for frame in 0..args.frames {
        pose(args, &mut scene, frame)?;
        references.push(Reference::render(gpu, &scene, camera(args, &scene, frame)?, args.view.reference_spp)?);
    }
    let noise = references.iter().map(Reference::noise).sum::<f64>() / references.len() as f64;
    println!(
        "{} frames, {} samples a pixel each; relative MSE, of which the references' own noise is {noise:.4}",
        args.frames, args.spp
    );
    let carries = Some(Reproject::default());
    let mut arms = vec![
        ("nothing".to_owned(), Arm { policy: "uniform", carries: None, filter: None }),
        ("reprojection".to_owned(), Arm { policy: "uniform", carries, filter: None }),
    ];
    for filter in &args.filters {
        let filter: &'static str = filter.clone().leak();
        let arm = |policy, carries| Arm { policy, carries, filter: Some(filter) };
        arms.push((filter.to_owned(), arm("uniform", None)));
        arms.push((format!("reprojection, {filter}"), arm("uniform", carries)));
        arms.push((format!("reprojection, placed by geometry and variance, {filter}"), arm("both", carries)));
    }
    let lines =
        arms.into_iter().map(|(name, arm)| measure(gpu, args, name, arm, &references)).collect::<Result<Vec<_>>>()?;
    print(&lines, args.view.width * args.view.height);
    if let Some(path) = &args.view.plot {
        let series: Vec<_> = lines
            .iter()
            .map(|l| (l.name.clone(), (0..).map(f64::from).zip(l.errors.iter().copied()).collect()))
            .collect();
        plot::lines(path, "error of each frame", ["frame", "relative MSE"], &series)?;
    }
    Ok(())
}

fn print(lines: &[Line], pixels: u32) {
    let mean = |errors: &[f64]| errors.iter().skip(8).sum::<f64>() / errors.len().saturating_sub(8).max(1) as f64;
    let row = |l: &Line| {
        let at = |k: usize| l.errors.get(k).map_or(String::new(), |e| format!("{e:.4}"));
        let [frame, carrying] = [l.frame_ms, l.carrying_ms].map(|ms| format!("{ms:.1}"));
        vec![
            l.name.clone(),
            at(0),
            at(7),
            format!("{:.4}", mean(&l.errors)),
            format!("{:.4}", l.flicker),
            frame,
            carrying,
        ]
    };
    let head = ["arm", "frame 0", "frame 7", "mean from 8 on", "flicker", "frame ms", "carrying ms"];
    println!("\n{}", table::text(&head, &lines.iter().map(row).collect::<Vec<_>>()));
    let share = |n: u64| format!("{:.1} %", 100.0 * n as f64 / f64::from(pixels));
    for line in lines.iter().filter(|l| l.sum.carried > 0) {
        let c = line.sum;
        let dropped = [
            ("sky", c.sky),
            ("specular", c.specular),
            ("edge", c.edge),
            ("old", c.old),
            ("outside", c.outside),
            ("hidden", c.hidden),
            ("view", c.view),
            ("light", c.light),
        ];
        let words: Vec<String> =
            dropped.iter().filter(|(_, n)| *n > 0).map(|(why, n)| format!("{why} {}", share(*n))).collect();
        let each = c.samples as f64 / c.carried.max(1) as f64;
        println!(
            "{}: in the last frame {} carried with {each:.1} samples each, {} new, {} at edges; of the frame before dropped: {}",
            line.name,
            share(c.carried),
            share(c.new),
            share(c.new_edges),
            words.join(", ")
        );
    }
}
