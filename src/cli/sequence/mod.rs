//! `tallow sequence`: a scene becomes the frames of an animation.
mod chain;
mod preview;
mod range;
mod stage;
mod survey;

use super::common::{Warnings, frames_per_second, with_ranges};
use super::files::{check_not_of_scene, key, scene_name};
use super::render::{self, outputs};
use super::{Exit, complain, fail_on_messages, finite, interrupt, print, print_json, quoted};
use crate::error::{Error, Result};
use crate::image::{self, Film, output::is_special};
use crate::render::{Carriage, Reproject, ReprojectOverrides};
use crate::scene::Scene;
use crate::scene::description::numbered;
use clap::builder::Resettable;
use clap::{Arg, Id};
use preview::Preview;
use serde::Serialize;
use stage::Stage;
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Render the frames of an animation
///
/// Frame n shows the scene n / fps seconds after the start of its `[[animation]]` tables. Files have `####` for the number of the
/// frame, with that many digits. A frame whose .exr file holds all samples of this scene, pose, settings and filter is not rendered
/// again; its other pictures are written anew. A frame that fails, or cannot be written, does not stop the others, but two in a row
/// that cannot be written do: the exit code is 6 then, and the same command renders them again. A camera without position has in view
/// what all of --frames reach.
///
/// With --reproject forward a frame begins with samples of the one before, and so depends on all before it. The first frame that is
/// asked for, and one after a frame that failed, begins anew: --only 40..48 is the same sequence begun at frame 40. A run that goes
/// on takes up the .exr file of the last finished frame, to the same bits: its layers carried.samples and carried.age say how many
/// samples of a pixel are of earlier frames, and through how many they came on average. Parts of a sequence that several machines
/// render differ at their seams for that: render some frames before each part and throw them away (--only 32..48 for 40..48), or use
/// --reproject off. A command over the folder in which parts were put together renders anew what was begun elsewhere.
#[derive(clap::Args)]
#[command(
    mut_args(with_ranges(Reproject::default().entries())),
    mut_arg("outputs", |arg| arg.help("Image to write: .exr (all layers), .png or .hdr, with #### for the number of the frame; may be \
        given several times [default: the scene's name, its folder's for a file called scene, + .####.exr]")),
    mut_args(without_those_of_one),
)]
pub struct Args {
    /// Frames: 0..96 are 96 frames, 0..=96 one more, 7 is one [default: up to the last key of all that moves]
    #[arg(long, value_name = "FIRST..END", value_parser = range::parse, allow_hyphen_values = true)]
    pub frames: Option<Range<u32>>,
    /// Of them, render only these; what they show stays the same
    #[arg(long, value_name = "FIRST..END", value_parser = range::parse, allow_hyphen_values = true)]
    pub only: Option<Range<u32>>,
    /// Frames per second, such as 24 or 30000/1001
    #[arg(long, default_value = "24", value_parser = frames_per_second)]
    pub fps: f64,
    /// Give each frame random numbers of its own (the seed plus its number), for those who average over frames. Frames that carry
    /// samples have them, and where the camera moves, those that cannot, as behind a lens. With --reproject off one seed serves all,
    /// and noise stands still where nothing moves
    #[arg(long)]
    pub seed_per_frame: bool,
    /// Turn the camera about what it looks at, by so many degrees over all of --frames, from the first one
    #[arg(long, value_name = "DEGREES", value_parser = finite)]
    pub turntable: Option<f64>,
    /// Write a small animated .gif of all frames, or of those before an interruption; it leaves some out above 50 frames
    /// per second, more than viewers show
    #[arg(long, value_name = "FILE")]
    pub preview: Option<PathBuf>,
    /// Render finished frames again
    #[arg(long)]
    pub again: bool,
    /// Which samples those are.
    #[command(flatten, next_help_heading = "Samples of earlier frames")]
    pub carry: ReprojectOverrides,
    /// How each frame is rendered.
    #[command(flatten)]
    pub render: render::Args,
}

type IsGiven = fn(&render::Args) -> bool;

/// Most frames that one command renders.
const MOST_FRAMES: usize = 1_000_000;

/// Options for one image, which a sequence refuses, and whether they are given.
const OF_ONE: [(&str, IsGiven); 6] = [
    ("resume", |args| args.resume.is_some()),
    ("checkpoint", |args| args.checkpoint.is_some()),
    ("pixel", |args| args.pixel.is_some()),
    ("time", |args| args.time.is_some()),
    ("error", |args| args.error.is_some()),
    ("plan", |args| args.plan.is_some()),
];

/// Hides the options for one image. They conflict with no other option, so that what is said of them is what [`Args::check`] says.
fn without_those_of_one(arg: Arg) -> Arg {
    match OF_ONE.iter().any(|(id, _)| arg.get_id() == id) {
        true => arg.hide(true).conflicts_with(Resettable::<Id>::Reset),
        false => arg,
    }
}

impl Args {
    /// The options of one frame, whose files have its number.
    fn of_frame(&self, number: u32) -> Result<render::Args> {
        let mut args = self.render.clone();
        if args.outputs.is_empty() {
            let mut name = scene_name(&self.render.scene);
            name.push(".####.exr");
            args.outputs = vec![name.into()];
        }
        let files = args.outputs.iter_mut().chain(&mut args.heatmap).chain(&mut args.profile);
        for file in files {
            let text = file.to_str().ok_or_else(|| {
                Error::Usage(format!("{}: is not UTF-8: choose another name, as by -o NAME.####.exr", file.display()))
            })?;
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            if name.split(|c| c != '#').filter(|run| !run.is_empty()).count() > 1 {
                let what = "has two places for the number of the frame: keep one run of #";
                return Err(Error::Usage(format!("{text}: {what}")));
            }
            let name = numbered(text, number).ok_or_else(|| {
                let example = with_place(text);
                Error::Usage(format!("{text}: every frame would be written there: choose a name as {example}"))
            })?;
            *file = name.into();
        }
        (args.common.quiet, args.common.json) = (true, false);
        Ok(args)
    }

    /// Numbers of the frames to render, in order, of a sequence that consists of `frames`.
    ///
    /// # Errors
    /// [`Error::Usage`] when there are none.
    fn numbers(&self, frames: &Range<u32>) -> Result<Range<u32>> {
        let only = self.only.as_ref().unwrap_or(frames);
        let numbers = only.start.max(frames.start)..only.end.min(frames.end);
        match numbers.len() {
            0 => Err(Error::Usage("none of the frames is in --frames and --only: 0..96 are 96 frames".to_owned())),
            1..=MOST_FRAMES => Ok(numbers),
            many => Err(Error::Usage(format!(
                "{many} frames are more than {MOST_FRAMES}: choose some of them by --frames or --only"
            ))),
        }
    }

    fn check(&self) -> Result<()> {
        if let Some((option, _)) = OF_ONE.iter().find(|(_, is_given)| is_given(&self.render)) {
            return Err(Error::Usage(format!(
                "--{option} is for one image: leave it out, or use tallow render; a sequence takes the samples that --spp says, and \
                 goes on by itself where it stopped"
            )));
        }
        let is_gif = |file: &&PathBuf| file.extension().is_some_and(|e| e.eq_ignore_ascii_case("gif"));
        if let Some(file) = self.render.outputs.iter().find(is_gif) {
            let (name, option) = (file.display(), quoted(&file.display().to_string()));
            let what =
                format!("frames go to .exr, .png or .hdr files; --preview {option} writes a moving picture of them");
            return Err(Error::Usage(format!("{name}: {what}")));
        }
        if let Some(method) = self.render.denoise {
            method.check()?;
        }
        let first = match &self.frames {
            Some(frames) => self.numbers(frames)?.start,
            None => 0,
        };
        self.preview.iter().try_for_each(|path| preview::check(path))?;
        outputs::check(&self.of_frame(first)?)
    }

    /// What is written, once the scene is loaded.
    fn check_with(&self, frames: &Range<u32>, scene: &Scene) -> Result<()> {
        let mut files: Vec<_> = self.preview.iter().map(|path| ("--preview", path.clone())).collect();
        let mut frame_of = vec![None; files.len()];
        for number in self.numbers(frames)? {
            files.extend(outputs::all(&self.of_frame(number)?));
            frame_of.resize(files.len(), Some(number));
        }
        check_apart(&files, &frame_of)?;
        check_not_of_scene(&files, scene)
    }
}

/// Checks that no two files of a sequence, each with the number of its frame, are one: `a.#.png` and `a.##.png` are from frame 10 on.
///
/// # Errors
/// [`Error::Usage`].
fn check_apart(files: &[(&str, PathBuf)], frame_of: &[Option<u32>]) -> Result<()> {
    let mut taken = HashMap::with_capacity(files.len());
    let files = files.iter().zip(frame_of).filter(|((_, path), _)| !is_special(path));
    for ((option, path), frame) in files {
        if let Some((other, other_frame)) = taken.insert(key(path), (option, frame)) {
            let of = if frame == other_frame { "" } else { " of another frame" };
            let path = path.display();
            return Err(Error::Usage(format!("{option} {path} is the same file as {other}{of}: choose another name")));
        }
    }
    Ok(())
}

/// A name like this one with a place for the number of the frame: that of a `%04d`, or before the extension.
fn with_place(name: &str) -> String {
    let printf = name.rsplit_once('%').and_then(|(stem, rest)| {
        let (digits, rest) = rest.split_once('d')?;
        let digits = if digits.is_empty() { 4 } else { digits.parse::<u8>().ok()? };
        Some((stem, usize::from(digits.clamp(1, 9)), rest))
    });
    if let Some((stem, digits, rest)) = printf {
        return format!("{stem}{}{rest}", "#".repeat(digits));
    }
    let file = Path::new(name);
    match file.extension() {
        Some(extension) => format!("{}.####.{}", file.with_extension("").display(), extension.display()),
        None => format!("{name}.####.exr"),
    }
}

/// What became of a frame.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FrameReport {
    /// Its number.
    pub frame: u32,
    /// Whether it was found finished.
    pub skipped: bool,
    /// Why it failed, if it did.
    pub error: Option<String>,
    /// Wall time of all that was done for it.
    pub seconds: f64,
    /// Wall time of moving the scene: hierarchies, lights, what is uploaded. In a frame that makes a renderer, as the first does, that of
    /// compiling it is part of it.
    pub pose_seconds: f64,
    /// What rays pay in the worst of the refitted hierarchies over when that was built; none when nothing is deformed.
    pub refit_cost: Option<f32>,
    /// Meshes whose hierarchies were built anew.
    pub rebuilt: usize,
    /// What became of the pixels of the frame before; none where a frame begins anew.
    pub carriage: Option<Carriage>,
}

/// What `--json` prints.
#[derive(Clone, Debug, Serialize)]
struct Summary<'a> {
    frames: Vec<FrameReport>,
    failed: usize,
    /// Whether a signal came before all frames were there.
    interrupted: bool,
    seconds: f64,
    device: String,
    /// What is odd in the scene, the frames and the options.
    warnings: &'a [String],
}

/// Runs the subcommand.
///
/// # Errors
/// What fails before the first frame, the loss of the device, and a preview that cannot be written.
pub fn run(args: &Args) -> Result<Exit> {
    args.check()?;
    let begun = Instant::now();
    let preview = args.preview.as_ref().map(|_| Preview::default());
    let mut told = Told { preview, reports: Vec::new(), warnings: args.render.common.warnings() };
    let mut stage = Stage::new(args, &mut told.warnings)?;
    let numbers = args.numbers(stage.frames())?;
    let ended = render_frames(args, &mut stage, numbers, &mut told);
    let Told { preview, reports, warnings } = told;
    if let Ok(end) = &ended {
        interrupt::leave_at_once(end.line().unwrap_or("interrupted: all frames are finished"));
    }
    let interrupted = matches!(ended, Ok(End::Interrupted(_)));
    let mut shown = Vec::new();
    // What takes no frames takes no preview of them either.
    if let (Ok(End::Finished | End::Interrupted(_)), Some(preview), Some(path)) = (&ended, &preview, &args.preview) {
        shown = preview.save(path, args.fps, !interrupted)?;
    }
    let failed = reports.iter().filter(|report| report.error.is_some()).count();
    let (seconds, device) = (begun.elapsed().as_secs_f64(), stage.gpu().info().name.clone());
    if args.render.common.json {
        let warnings = warnings.all();
        print_json(&Summary { frames: reports, failed, interrupted, seconds, device, warnings })?;
    }
    let end = ended?;
    fail_on_messages(stage.gpu())?;
    let preview: String = shown.iter().map(|path| format!("; {} shows those before", path.display())).collect();
    end.line().iter().for_each(|line| complain(&format!("{line}{preview}")));
    Ok(match end {
        End::Interrupted(_) => Exit::Interrupted,
        End::Finished if failed == 0 => Exit::Done,
        End::Finished | End::Unwritable(_) => Exit::PartlyFailed,
    })
}

/// What is told of all frames, beside their own files.
struct Told {
    preview: Option<Preview>,
    reports: Vec<FrameReport>,
    warnings: Warnings,
}

impl Told {
    /// Adds a frame to the preview, if there is one.
    fn show(&mut self, film: &Film, args: &render::Args) -> Result<()> {
        let Some(preview) = &mut self.preview else { return Ok(()) };
        preview.add(film, &args.png.write_options()).map_err(|what| Error::Usage(format!("--preview: {what}")))
    }
}

/// Why no more frames are rendered, and what is said of that.
enum End {
    Finished,
    Interrupted(String),
    Unwritable(String),
}

impl End {
    fn line(&self) -> Option<&str> {
        match self {
            Self::Finished => None,
            Self::Interrupted(line) | Self::Unwritable(line) => Some(line),
        }
    }
}

/// Renders frames until all are there, a signal comes, or two in a row cannot be written: a full disk, or a folder that has gone,
/// takes none of those after them either.
///
/// # Errors
/// The loss of the device.
fn render_frames(args: &Args, stage: &mut Stage, numbers: Range<u32>, told: &mut Told) -> Result<End> {
    let mut unwritten = false;
    for number in numbers.clone() {
        let line = interruption(args, &format!("in frame {number}"));
        match told.reports.is_empty() {
            // Nothing is there to be told yet, and to compile the first frame's kernels may take long.
            true if interrupt::leave_at_once(&line) => interrupt::leave(&line),
            false if interrupt::flag().load(Ordering::SeqCst) => return Ok(End::Interrupted(line)),
            _ => {}
        }
        let (report, result) = stage.frame(number, told);
        match result {
            Err(error @ Error::DeviceLost(_)) => {
                told.reports.push(report);
                return Err(error);
            }
            Ok(Exit::Interrupted) => return Ok(End::Interrupted(line)),
            _ => {}
        }
        let left = numbers.end - number - 1;
        tell(args, &report, left, &told.reports);
        told.reports.push(report);
        let last_unwritten = std::mem::replace(&mut unwritten, matches!(result, Err(Error::Output { .. })));
        if unwritten && last_unwritten && left > 0 {
            let why =
                format!("error: frames {} and {number} could not be written, so that no more are rendered", number - 1);
            return Ok(End::Unwritable(format!("{why}: {}", what_stays(args))));
        }
    }
    Ok(End::Finished)
}

/// What an interruption at this place says.
pub fn interruption(args: &Args, place: &str) -> String {
    format!("interrupted {place}: {}", what_stays(args))
}

/// What becomes of finished frames, and how to go on.
fn what_stays(args: &Args) -> &'static str {
    match args.render.output_files().iter().any(|path| image::has_layers(path)) {
        // Of other files nothing tells which samples they hold.
        false => "finished frames stay, but are rendered anew unless -o NAME.####.exr is given too",
        true if args.again => "finished frames stay, and the same command without --again goes on there",
        true => "finished frames stay, and the same command goes on there",
    }
}

/// One line for a frame; a failure is always told.
fn tell(args: &Args, report: &FrameReport, left: u32, before: &[FrameReport]) {
    if let Some(error) = &report.error {
        let preview = args.preview.as_ref().map(|path| format!("; {} lacks it", path.display()));
        complain(&format!("error: frame {}: {error}{}", report.frame, preview.unwrap_or_default()));
        return;
    }
    if !args.render.common.talkative() {
        return;
    }
    let rendered: Vec<f64> = before.iter().chain([report]).filter(|r| !r.skipped).map(|r| r.seconds).collect();
    let mean = rendered.iter().sum::<f64>() / rendered.len().max(1) as f64;
    let rest = match left {
        0 => String::new(),
        n => format!("; {n} more, {} left", clock(mean * f64::from(n))),
    };
    let did = match (report.skipped, report.rebuilt) {
        (true, _) => "is finished".to_owned(),
        (false, 0) => format!("{:.2} s", report.seconds),
        (false, n) => format!("{:.2} s, {n} hierarchies built anew", report.seconds),
    };
    // A closed stdout ends no sequence.
    let _ = print(&format!("frame {}: {did}{rest}\n", report.frame));
}

/// Hours, minutes and seconds.
fn clock(seconds: f64) -> String {
    let whole = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX).as_secs();
    match whole {
        0..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}
