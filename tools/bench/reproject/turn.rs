//! The experiment of Schalk 2018, 4.3: the camera turns by a total angle in steps, with so many samples for each, and rests. From then on
//! error is measured against time.
use crate::film::{Arm, Film, carries};
use crate::reference::Reference;
use crate::{View, plot};
use anyhow::{Result, ensure};
use glam::{Quat, Vec3};
use std::iter::repeat_n;
use tallow::gpu::{Gpu, total_ms};
use tallow::layout::{Camera, vec3};
use tallow::render::{Carriage, Reproject, ReprojectOverrides};
use tallow::report::table;
use tallow::scene::Loaded;

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    view: View,
    /// Where the camera stands, instead of where the scene puts it
    #[arg(long, allow_hyphen_values = true, value_name = "X,Y,Z", value_parser = point)]
    position: Option<vec3>,
    /// Degrees that it is turned by at first
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true)]
    from: f32,
    /// Degrees that the camera turns by
    #[arg(long, default_value_t = 100.0)]
    degrees: f32,
    /// Degrees of a step; the last one is what is left
    #[arg(long, value_delimiter = ',', default_values_t = [5.0, 10.0, 20.0, 50.0])]
    steps: Vec<f32>,
    /// Samples of a pixel for each step
    #[arg(long, default_value_t = 8)]
    spp: u32,
    /// Frames after the last step
    #[arg(long, default_value_t = 6)]
    rest: u32,
    /// Values of reproject-error
    #[arg(long, value_delimiter = ',', default_values_t = [0.25])]
    errors: Vec<f32>,
    /// Measure also with four samples of a pixel that are carried each on its own
    #[arg(long)]
    quarters: bool,
    #[command(flatten)]
    carry: ReprojectOverrides,
}

fn point(text: &str) -> Result<vec3, String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(str::parse).collect();
    numbers.ok().and_then(|numbers| numbers.try_into().ok()).ok_or_else(|| "expected X,Y,Z".to_owned())
}

impl Args {
    /// The camera of the first frame.
    fn start(&self, scene: &Loaded) -> Result<Camera> {
        let first = scene.camera([self.view.width, self.view.height])?;
        let position = self.position.unwrap_or(first.position);
        Ok(turned(&Camera { position, ..first }, self.from))
    }
}

fn turned(first: &Camera, degrees: f32) -> Camera {
    let turn = Quat::from_axis_angle(Vec3::from(first.up).normalize(), degrees.to_radians());
    let of = |v: vec3| (turn * Vec3::from(v)).to_array();
    Camera { right: of(first.right), up: of(first.up), forward: of(first.forward), ..*first }
}

/// The angle of each frame until the camera rests: a step more each from 0 on, and all degrees in the end.
fn angles(degrees: f32, step: f32) -> Vec<f32> {
    // What rounding leaves is no step.
    let count = (degrees / step - 1e-3).ceil() as u32;
    (0..count).map(|k| step * k as f32).chain([degrees]).collect()
}

/// What was seen of an arm from the last step on: milliseconds since then and the error, frame by frame.
pub struct Line {
    pub name: String,
    pub points: Vec<(f64, f64)>,
    frame_ms: f64,
    carrying_ms: f64,
    carriage: Option<Carriage>,
    pixels: u64,
}

fn arms(args: &Args) -> Vec<(String, Arm)> {
    let arm = |policy, carries, quarters| Arm { policy, carries, filter: None, quarters };
    let alone = |policy| arm(policy, None, false);
    let mut arms = vec![("uniform".to_owned(), alone("uniform")), ("placed".to_owned(), alone("variance"))];
    let mut carries = Reproject::default();
    args.carry.apply(&mut carries);
    for &error in &args.errors {
        let carries = Some(Reproject { reproject_error: error, ..carries });
        for &quarters in if args.quarters { &[false, true][..] } else { &[false] } {
            let each = if quarters { ", four each" } else { "" };
            let of = |name, policy| (format!("{name}, E = {error}{each}"), arm(policy, carries, quarters));
            arms.extend([of("reprojection", "uniform"), of("both", "variance")]);
        }
    }
    arms
}

fn measure(gpu: &Gpu, args: &Args, step: f32, name: String, arm: Arm, reference: &Reference) -> Result<Line> {
    let scene = args.view.load()?;
    let first = args.start(&scene)?;
    let mut film = Film::new(gpu, &scene, arm, args.spp)?;
    let angles = angles(args.degrees, step);
    let last = angles.len() as u32 - 1;
    let at_rest = repeat_n(args.degrees, args.rest as usize);
    let (mut points, mut clock, mut carriage, mut frame_ms, mut carrying_ms) = (Vec::new(), 0.0, None, 0.0, 0.0);
    let (mut means, mut weight) = (Vec::new(), 0.0);
    for (k, angle) in (0..).zip(angles.into_iter().chain(at_rest)) {
        let times = film.shoot(turned(&first, angle), None, k)?;
        if k < last {
            continue;
        }
        let ms = total_ms(&times);
        clock += ms;
        let picture = film.picture()?.0;
        // Without carried samples a camera at rest accumulates its frames.
        if arm.carries.is_none() {
            means = accumulated(means, &picture.pixels, weight);
            weight += 1.0;
        }
        let shown = if arm.carries.is_none() { &means } else { &picture.pixels };
        let shown = tallow::image::Picture { pixels: shown.clone(), ..picture };
        points.push((clock, reference.error(&shown)));
        if k == last && arm.carries.is_some() {
            carriage = Some(film.renderer.carriage()?);
            carrying_ms = total_ms(times.iter().filter(|pass| carries(pass)));
        }
        frame_ms = ms;
    }
    let size = film.renderer.settings();
    let pixels = u64::from(size.width) * u64::from(size.height);
    Ok(Line { name, points, frame_ms, carrying_ms, carriage, pixels })
}

fn accumulated(means: Vec<vec3>, new: &[vec3], weight: f32) -> Vec<vec3> {
    if means.is_empty() {
        return new.to_vec();
    }
    let mean = |(a, b): (&vec3, &vec3)| std::array::from_fn(|c| (a[c] * weight + b[c]) / (weight + 1.0));
    means.iter().zip(new).map(mean).collect()
}

pub fn run(gpu: &Gpu, args: &Args) -> Result<()> {
    args.view.tell(gpu);
    let scene = args.view.load()?;
    let end = turned(&args.start(&scene)?, args.degrees);
    let reference = Reference::new(gpu, &scene, end, args.view.reference_spp, None)?;
    let is_lit = reference.picture.pixels.iter().flatten().any(|&value| value > 0.0);
    ensure!(is_lit, "the camera sees no light once it has turned by {} degrees: choose fewer --degrees", args.degrees);
    println!(
        "{} degrees, {} samples a pixel for each step; relative MSE (the reference's own: {:.4}) of the frame after the last step and of \
         those that follow it",
        args.degrees,
        args.spp,
        reference.noise()
    );
    for &step in &args.steps {
        let lines = arms(args)
            .into_iter()
            .map(|(name, arm)| measure(gpu, args, step, name, arm, &reference))
            .collect::<Result<Vec<_>>>()?;
        print(step, &lines);
        if let Some(path) = &args.view.plot {
            let path = path.with_extension(format!("{step}.svg"));
            let series: Vec<_> = lines.iter().map(|l| (l.name.clone(), l.points.clone())).collect();
            plot::lines(
                &path,
                &format!("steps of {step} degrees"),
                ["ms after the last step", "relative MSE"],
                &series,
            )?;
        }
    }
    Ok(())
}

fn print(step: f32, lines: &[Line]) {
    let base = &lines[0].points;
    let row = |line: &Line| {
        let share = |n: u64| format!("{:.0} %", 100.0 * n as f64 / line.pixels as f64);
        let at =
            |k: usize| line.points.get(k).map_or(String::new(), |p| format!("{:.4} ({:.2})", p.1, p.1 / base[k].1));
        let last = line.points.len() - 1;
        let times = [line.frame_ms, line.carrying_ms].map(|ms| format!("{ms:.2}"));
        let what = line.carriage.map_or([String::new(), String::new()], |c| {
            [share(c.carried), format!("{:.1}", c.samples as f64 / c.carried.max(1) as f64)]
        });
        let reasons = line.carriage.map_or(String::new(), |c| {
            let of = [
                ("edge", c.edge),
                ("outside", c.outside),
                ("hidden", c.hidden),
                ("view", c.view),
                ("specular", c.specular),
            ];
            of.iter()
                .filter(|(_, n)| *n > 0)
                .map(|(why, n)| format!("{why} {}", share(*n)))
                .collect::<Vec<_>>()
                .join(", ")
        });
        let mut cells = vec![line.name.clone(), at(0), at(1), at(last)];
        cells.extend(times.into_iter().chain(what).chain([reasons]));
        cells
    };
    let head = [
        "arm",
        "error (of uniform)",
        "a frame later",
        "at the end",
        "frame ms",
        "carrying ms",
        "carried",
        "samples each",
        "dropped",
    ];
    println!("\nsteps of {step} degrees\n{}", table::text(&head, &lines.iter().map(row).collect::<Vec<_>>()));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_ends_at_its_last_degree_whatever_its_steps_are() {
        assert_eq!(angles(20.0, 50.0), [0.0, 20.0]);
        assert_eq!(angles(100.0, 30.0), [0.0, 30.0, 60.0, 90.0, 100.0]);
        let twenty: Vec<_> = (0..=20).map(|k| 5.0 * k as f32).collect();
        assert_eq!(angles(100.0, 5.0), twenty);
        assert_eq!(angles(0.0, 5.0), [0.0]);
    }
}
