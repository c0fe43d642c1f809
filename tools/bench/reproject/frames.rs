//! Frames of a camera that moves through a scene, and of what the scene animates, if anything: the error of each, how much it
//! flickers, and how different all look.
use crate::film::{Arm, Film, carries};
use crate::reference::Reference;
use crate::{View, plot, seen};
use anyhow::{Result, anyhow};
use glam::{Quat, Vec3};
use std::path::{Path, PathBuf};
use tallow::gpu::{Gpu, total_ms};
use tallow::image::{self, Picture, WriteOptions};
use tallow::layout::{Camera, vec3};
use tallow::render::{Carriage, Reproject, ReprojectOverrides};
use tallow::report::table;
use tallow::scene::{Change, Loaded};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    view: View,
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u32).range(FIRST as i64 + 1..))]
    frames: u32,
    /// Samples a pixel of a frame
    #[arg(long, default_values_t = [1, 4], value_delimiter = ',')]
    spp: Vec<u32>,
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
    #[command(flatten)]
    carry: ReprojectOverrides,
    /// Folder in which references are kept for another run of the same frames
    #[arg(long)]
    references: Option<PathBuf>,
    /// Folder for a picture of the last frame of each arm
    #[arg(long)]
    pictures: Option<PathBuf>,
}

/// Frames that fill the history; what is measured begins behind them.
const FIRST: usize = 8;

/// The camera of a frame, on its way from the scene's own. It moves whether the scene does or not.
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
    /// The arm with the same filter and nothing carried.
    base: usize,
    errors: Vec<f64>,
    flicker: f64,
    jod: f64,
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

/// What all arms are measured by: the scene at rest, and a reference for each frame.
struct Sequence {
    scene: Loaded,
    references: Vec<Reference>,
}

fn measure(gpu: &Gpu, args: &Args, spp: u32, (name, base, arm): Named, sequence: &Sequence) -> Result<Line> {
    let mut scene = sequence.scene.clone();
    let mut film = Film::new(gpu, &scene, arm, spp)?;
    let (mut errors, mut offs, mut times) = (Vec::new(), Vec::new(), Vec::new());
    let (mut sum, mut pictures) = (Carriage::default(), Vec::new());
    for (frame, reference) in (0..).zip(&sequence.references) {
        let change = pose(args, &mut scene, frame)?;
        let camera = camera(args, &scene, frame)?;
        let passes = film.shoot(camera, change.as_ref().map(|change| (&scene, change)), frame)?;
        let (picture, filtering) = film.picture()?;
        errors.push(reference.error(&picture));
        offs.push(reference.off(&picture));
        times.push([total_ms(&passes) + filtering, total_ms(passes.iter().filter(|pass| carries(pass)))]);
        if arm.carries.is_some() {
            sum = film.renderer.carriage()?;
        }
        pictures.push(picture);
    }
    if let (Some(folder), Some(picture)) = (&args.pictures, pictures.last()) {
        save(&folder.join(format!("{spp}-{}.png", name.replace([',', ' '], "-"))), picture)?;
    }
    // The mean absolute difference of successive error images.
    let change = |pair: &[Vec<f64>]| {
        pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).sum::<f64>() / pair[0].len() as f64
    };
    let flicker = mean(offs.windows(2).skip(FIRST - 1).map(change));
    let truth: Vec<&Picture> = sequence.references.iter().skip(FIRST).map(|reference| &reference.picture).collect();
    let jod = seen::jod(&pictures[FIRST..], &truth, args.fps as f32)?;
    let of = |column: usize| tallow::profile::median(&times.iter().skip(2).map(|t| t[column]).collect::<Vec<_>>());
    Ok(Line { name, base, errors, flicker, jod, frame_ms: of(0), carrying_ms: of(1), sum })
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count.max(1))
}

fn save(path: &Path, picture: &Picture) -> Result<()> {
    image::write(path, &image::Film::from(picture), &WriteOptions::default())
        .map_err(|what| anyhow!("{}: {what}", path.display()))
}

/// Its name, its place's base ([`Line::base`]), and an arm.
type Named = (String, usize, Arm);

fn arms(filters: &[String], carries: Reproject) -> Vec<Named> {
    let carries = Some(carries);
    let arm = |policy, carries, filter| Arm { policy, carries, filter, quarters: false };
    let mut arms = vec![
        ("nothing".to_owned(), 0, arm("uniform", None, None)),
        ("reprojection".to_owned(), 0, arm("uniform", carries, None)),
    ];
    for filter in filters {
        let (base, filter): (_, &'static str) = (arms.len(), filter.clone().leak());
        arms.push((filter.to_owned(), base, arm("uniform", None, Some(filter))));
        arms.push((format!("reprojection, {filter}"), base, arm("uniform", carries, Some(filter))));
        arms.push((format!("reprojection, placed, {filter}"), base, arm("both", carries, Some(filter))));
    }
    arms
}

fn references(gpu: &Gpu, args: &Args, mut scene: Loaded) -> Result<Vec<Reference>> {
    let folders = args.references.iter().chain(&args.pictures);
    folders.into_iter().try_for_each(std::fs::create_dir_all)?;
    let of = |frame: u32| {
        pose(args, &mut scene, frame)?;
        let file = args.references.as_ref().map(|folder| folder.join(format!("{frame:04}.exr")));
        Reference::new(gpu, &scene, camera(args, &scene, frame)?, args.view.reference_spp, file.as_deref())
    };
    (0..args.frames).map(of).collect()
}

pub fn run(gpu: &Gpu, args: &Args) -> Result<()> {
    args.view.tell(gpu);
    let scene = args.view.load()?;
    let sequence = Sequence { references: references(gpu, args, scene.clone())?, scene };
    let references = &sequence.references;
    let noise = mean(references.iter().map(Reference::noise));
    let flicker = mean(references.windows(2).map(|pair| pair[0].flicker(&pair[1])));
    println!(
        "{} frames; of their errors {noise:.4} is the references' own noise, of flicker {flicker:.4}",
        args.frames
    );
    let mut carries = Reproject::default();
    args.carry.apply(&mut carries);
    for &spp in &args.spp {
        let of = |arm| measure(gpu, args, spp, arm, &sequence);
        let lines = arms(&args.filters, carries).into_iter().map(of).collect::<Result<Vec<_>>>()?;
        println!("\n{spp} samples a pixel of a frame");
        print(&lines, args.view.width * args.view.height);
        if let Some(path) = &args.view.plot {
            let series: Vec<_> = lines
                .iter()
                .map(|l| (l.name.clone(), (0..).map(f64::from).zip(l.errors.iter().copied()).collect()))
                .collect();
            let path = path.with_extension(format!("{spp}.svg"));
            plot::lines(&path, "error of each frame", ["frame", "relative MSE"], &series)?;
        }
    }
    Ok(())
}

fn print(lines: &[Line], pixels: u32) {
    let later = |l: &Line| mean(l.errors.iter().skip(FIRST).copied());
    let row = |l: &Line| {
        let at = |k: usize| l.errors.get(k).map_or(String::new(), |e| format!("{e:.4}"));
        let of = |value: fn(&Line, f64) -> f64| {
            let [own, base] = [l, &lines[l.base]].map(|line| value(line, later(line)));
            format!("{own:.4} ({:.2})", own / base)
        };
        let [frame, carrying] = [l.frame_ms, l.carrying_ms].map(|ms| format!("{ms:.1}"));
        let last = at(l.errors.len() - 1);
        let (error, flicker, jod) = (of(|_, error| error), of(|l, _| l.flicker), format!("{:.2}", l.jod));
        vec![l.name.clone(), at(0), at(FIRST - 1), last, error, flicker, jod, frame, carrying]
    };
    let head = ["arm", "frame 0", "7", "last", "8 on (of base)", "flicker (of base)", "JOD", "frame ms", "carrying ms"];
    println!("{}", table::text(&head, &lines.iter().map(row).collect::<Vec<_>>()));
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
