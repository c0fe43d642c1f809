//! `tallow render`: a scene becomes image files.
mod shot;
mod summary;

use super::checkpoint::{self, CheckpointFile};
use super::common::Common;
use super::files::{Files, Item, check_distinct};
use super::overrides::Overrides;
use super::progress::Progress;
use super::{Exit, complain, fail_on_messages, interrupt};
use crate::denoise::filter::{self, FilterSettings, Row};
use crate::denoise::{self, Demodulation, Filtered, Noisy, Recipe};
use crate::error::{Error, Result};
use crate::gpu::{self, FrameResources, Gpu, PassTime};
use crate::image::difference::false_colours;
use crate::image::output::{self, Stream};
use crate::image::{self, Film, NOISY, Samples, WriteOptions};
use crate::layout::vec3;
use crate::memory;
use crate::render::settings::Settings;
use crate::render::{self, Checkpoint, FilmBuffers, Job, Outputs, Renderer, Status, StopReason};
use crate::report::trace::chrome_trace;
use crate::scene::{Scene, SceneFile};
use crate::statistics::BrokenSamples;
use shot::Shot;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};
use summary::{Outcome, report};

/// Which effects are compiled into the kernels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum EffectChoice {
    /// What the scene calls for.
    #[default]
    Auto,
    /// Everything, to see what that costs.
    All,
}

/// Render a scene to image files
///
/// Options override the settings of the scene file; defaults are for what it does not set.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (.toml) or model (.obj)
    pub scene: PathBuf,
    /// Image to write: .exr (all layers), .png or .hdr; may be given several times [default: the scene's name + .exr]
    #[arg(short, long = "output", value_name = "FILE")]
    pub outputs: Vec<PathBuf>,
    /// Effects to compile in
    #[arg(long, value_enum, default_value_t)]
    pub effects: EffectChoice,
    /// Write a trace of CPU and GPU for Perfetto
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Continue a render from the .exr file that it wrote when it was interrupted, or that has fewer samples
    #[arg(long, value_name = "FILE")]
    pub resume: Option<PathBuf>,
    /// Every so many minutes, write what there is to NAME.partial.exr, beside the first .exr output: --resume continues it
    /// after a crash. It is removed when the render is complete
    #[arg(long, value_name = "MINUTES", value_parser = checkpoint::minutes)]
    pub checkpoint: Option<Duration>,
    /// Write the samples per pixel in false colours to a .png
    #[arg(long, value_name = "FILE")]
    pub heatmap: Option<PathBuf>,
    /// Filter the image as `tallow filter` does with the file; the noisy one stays as the layer "Noisy Image"
    #[arg(long, value_name = "FILTER")]
    pub denoise: Option<&'static Row>,
    /// Count rays and visited nodes
    #[arg(long)]
    pub counters: bool,
    /// Device and output.
    #[command(flatten)]
    pub common: Common,
    /// Replace the scene's own settings.
    #[command(flatten)]
    pub overrides: Overrides,
}

impl Args {
    /// Files to write.
    pub fn output_files(&self) -> Vec<PathBuf> {
        if !self.outputs.is_empty() {
            return self.outputs.clone();
        }
        vec![checkpoint::default_output(&self.scene)]
    }

    /// More than radiance is kept only where a file or a filter takes it.
    fn wanted(&self) -> Outputs {
        let layers = self.denoise.is_some()
            || self.checkpoint.is_some()
            || self.output_files().iter().any(|file| image::has_layers(file));
        Outputs { split_light: layers, guides: layers, counters: self.counters }
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Of every kind. What fails before the first sample leaves nothing written; when `--denoise` fails the noisy image is there;
/// an output that fails keeps no other from being written.
pub fn run(args: &Args) -> Result<Exit> {
    check_outputs(args)?;
    let mut host = Spans::default();
    let (scene, settings) = host.time("load scene", || load(args))?;
    let earlier = args.resume.as_deref().map(|path| Checkpoint::read(path, &scene, &settings)).transpose()?;
    if args.common.talkative() {
        scene.warnings.iter().for_each(|w| complain(&format!("warning: {w}")));
    }
    let gpu = host.time("open device", || args.common.open())?;
    let wanted = args.wanted();
    check_memory(args, &settings, &gpu)?;
    args.denoise
        .map_or(Ok(()), |_| filter::check_size(&gpu, [settings.width, settings.height], filter::GUIDE_TEXELS))?;
    let mut effects = match args.effects {
        EffectChoice::Auto => render::called_for(&scene, &settings, wanted),
        EffectChoice::All => render::all_effects(&scene, &settings),
    };
    effects.adaptive |= earlier.is_some();
    let renderer =
        host.time("upload and compile", || Renderer::specialised(&gpu, &scene, &settings, wanted, effects))?;
    let noisy = args.denoise.map(|_| Noisy::of_film(&renderer)).transpose()?;
    let job = Job { checkpoint: earlier.as_ref(), ..Job::new(&renderer) };
    let shot = Shot { args, gpu: &gpu, job };
    let mut files = Files::new(args.resume.as_deref());
    let (mut status, checkpoint) = host.time("render", || trace(&shot, &mut files))?;
    let interrupted = status.stopped == StopReason::Interrupted;
    if interrupted && status.traced == 0 {
        complain("interrupted before the first sample: nothing was written");
        return Ok(Exit::Interrupted);
    }
    let seconds = host.seconds("render");
    status.broken_samples.iter().for_each(warn_of_broken);
    let mut film = host.time("read back", || shot.film(&status, seconds))?;
    let counters = args.counters.then(|| renderer.counters()).transpose()?;
    // The film is all that is left to write and to filter, and large films need the memory.
    drop(renderer);
    let mut written = host.time("write", || Ok(save(args, &film, &mut files, checkpoint, !interrupted)))?;
    // By now what took hours is safe, whatever becomes of the filter.
    if let Some((row, noisy)) = args.denoise.zip(noisy).filter(|_| !interrupted) {
        let line = files.with_failures("interrupted: the noisy image was written, --denoise was not finished");
        if interrupt::leave_at_once(&line) {
            interrupt::leave(&line);
        }
        status.times.extend(host.time("denoise", || denoised(&gpu, row, noisy, &mut film))?);
        host.time("write", || Ok(save(args, &film, &mut files, None, true)))?;
    }
    fail_on_messages(&gpu)?;
    let trace = args.profile.iter().map(|path| Item::bytes(path.clone(), profile(&gpu, &host, &status).into_bytes()));
    let trace: Vec<_> = trace.collect();
    files.save(&trace, !interrupted);
    written.extend(files.pipe(&items(args, &film), !interrupted));
    files.pipe(&trace, !interrupted);
    let outcome = Outcome { gpu: &gpu, scene: &scene, film: &film, host: &host, status: &status };
    report(args, &outcome.summary(&written, counters))?;
    files.failure().map_or(Ok(()), Err)?;
    if interrupted {
        complain(&interruption(&written));
        return Ok(Exit::Interrupted);
    }
    Ok(Exit::Done)
}

/// The settings are checked before what may take long.
fn load(args: &Args) -> Result<(Scene, Settings)> {
    let file = SceneFile::open(&args.scene)?;
    let mut settings = file.settings()?;
    args.overrides.apply(&mut settings);
    settings.validate()?;
    Ok((file.load()?.scene, settings))
}

/// Takes the samples, shows how far it is, and writes checkpoints on the way.
fn trace(shot: &Shot, files: &mut Files) -> Result<(Status, Option<CheckpointFile>)> {
    let Shot { args, gpu, job } = *shot;
    let place = || checkpoint::path(&args.output_files(), &args.scene);
    let mut checkpoint = args.checkpoint.map(|every| CheckpointFile::new(every, place()));
    let (begun, mut progress) = (Instant::now(), None);
    // Until here there is nothing to keep, and a signal ends the process.
    let stop = interrupt::flag();
    let mut between = |status: &Status| {
        let progress = progress.get_or_insert_with(|| Progress::new(status.planned, !args.common.talkative()));
        progress.set(status.done);
        if progress.wants_speed() {
            progress.set_speed(job.rays_of_a_few(status)?);
        }
        if stop.load(Ordering::SeqCst) {
            return Ok(ControlFlow::Break(()));
        }
        if let Some(checkpoint) = checkpoint.as_mut().filter(|c| status.traced > 0 && c.is_due()) {
            checkpoint.write(files, &shot.film(status, begun.elapsed().as_secs_f64())?);
        }
        Ok(ControlFlow::Continue(()))
    };
    let status = job.run(&mut FrameResources::new(gpu)?, &mut between)?;
    progress.iter().for_each(Progress::finish);
    Ok((status, checkpoint))
}

/// Writes the images that are files, and brings the checkpoint up to date or removes it: where an image has all layers, or
/// the render is complete, it is not needed any more.
fn save(args: &Args, film: &Film, files: &mut Files, checkpoint: Option<CheckpointFile>, whole: bool) -> Vec<PathBuf> {
    let broken = film.picture(None).map_or(0, |p| p.non_finite());
    if broken > 0 {
        complain(&format!("warning: {broken} pixels are not finite"));
    }
    let mut written = files.save(&items(args, film), whole);
    let Some(mut checkpoint) = checkpoint else { return written };
    if !whole && !written.iter().any(|path| image::has_layers(path)) {
        written.extend(checkpoint.write(files, film));
    }
    if files.failure().is_none() {
        checkpoint.remove(&written);
    }
    written
}

/// The images: a film's own, and that of its samples.
fn items<'a>(args: &'a Args, film: &'a Film) -> Vec<Item<'a>> {
    let options = args.common.write_options();
    let images = args.output_files().into_iter().map(|path| Item::image(path, film, options));
    let heatmap = |path: &PathBuf| Item { path: path.clone(), fill: Box::new(|stream| heatmap(film, stream)) };
    images.chain(args.heatmap.iter().map(heatmap)).collect()
}

/// Says where what there is was written.
fn interruption(written: &[PathBuf]) -> String {
    let names = written.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ");
    let resumable = written.iter().find(|path| image::has_layers(path));
    let how = resumable.map(|path| format!("; --resume {} continues it", path.display())).unwrap_or_default();
    format!("interrupted: what there is was written to {names}{how}")
}

/// Always told: it is a bug, or light too strong for the numbers.
fn warn_of_broken(broken: &BrokenSamples) {
    let BrokenSamples { count, pixel: [x, y], sample, seed } = broken;
    complain(&format!(
        "warning: samples that were no number and count as black: {count}; the first: pixel ({x}, {y}), sample {sample}, \
         seed {seed}"
    ));
}

/// With the filter's default settings, scaled to the image.
fn denoised(gpu: &Gpu, row: &Row, noisy: Noisy, film: &mut Film) -> Result<Vec<PassTime>> {
    let settings = |scales: &filter::Scales| FilterSettings::default().scaled_by(scales);
    let recipe = Recipe { row, demodulation: Demodulation::default(), fireflies: None, settings: &settings };
    let (colour, times) = Filtered::new(gpu, noisy, &recipe)?.join(gpu)?;
    // The mean of the samples stays as a layer.
    const RGB: [&str; 3] = ["R", "G", "B"];
    for channel in film.channels.iter_mut().filter(|c| RGB.contains(&c.name.as_str())) {
        channel.name = format!("{NOISY}.{}", channel.name);
    }
    RGB.into_iter().zip(colour).for_each(|(name, plane)| film.add(name, Samples::F32(plane)));
    Ok(times)
}

/// Host-side stages, for the trace.
#[derive(Default)]
pub struct Spans(Vec<PassTime>);

impl Spans {
    fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let begin_ns = gpu::host_ns();
        let result = work();
        self.0.push(PassTime { name, begin_ns, end_ns: gpu::host_ns() });
        result
    }

    fn seconds(&self, name: &str) -> f64 {
        let spans = self.0.iter().filter(|s| s.name == name);
        spans.map(|s| s.duration_ns() as f64 * 1e-9).sum()
    }
}

/// Samples per pixel from 0 (dark) to the largest number (bright).
fn heatmap(film: &Film, stream: &mut dyn Stream) -> std::io::Result<()> {
    let counts = render::film::counts(film, "samples").unwrap_or_default();
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let values: Vec<f32> = counts.iter().map(|&n| n as f32).collect();
    let picture = false_colours(film.width, &values, most as f32);
    let mut map = Film::new(picture.width, picture.height);
    map.add_vec3("", ["R", "G", "B"], &picture.pixels);
    image::encode(Path::new("map.png"), &map, &WriteOptions::default(), stream)
}

fn profile(gpu: &Gpu, host: &Spans, status: &Status) -> String {
    let offset = gpu.calibrate().map(|(gpu_ns, host_ns)| host_ns as i64 - gpu_ns as i64);
    chrome_trace(&host.0, &status.times, offset)
}

/// A system that is out of memory ends the process hours later without a word.
fn check_memory(args: &Args, settings: &Settings, gpu: &Gpu) -> Result<()> {
    let refused = |what| format!("a film of {} x {} {what}: choose a smaller film", settings.width, settings.height);
    let bytes = bytes_of_film(settings, gpu.info().unified);
    // The renderer is gone when the filter begins; its film is part of what the filter takes.
    let while_filtered = |row: &Row| {
        let device = if gpu.info().unified { denoise::bytes_per_pixel(row) } else { 0 };
        bytes_of_film(settings, false) + settings.pixels() as u64 * (device + size_of::<vec3>() as u64)
    };
    let bytes = bytes.max(args.denoise.map_or(0, while_filtered));
    memory::check(bytes).map_err(|what| Error::Device(refused(what)))
}

/// Of host memory, at the moment when it is read back.
fn bytes_of_film(settings: &Settings, unified: bool) -> u64 {
    let placed = !settings.allocate.is_even();
    let device = if unified { FilmBuffers::bytes_per_pixel(placed) } else { 0 };
    settings.pixels() as u64 * (device + render::film::bytes_per_pixel(placed))
}

/// A render may take hours; what cannot be written, or would replace what it is not to, is told before.
fn check_outputs(args: &Args) -> Result<()> {
    let (images, checkpoint) = (args.output_files(), checkpoint::path(&args.output_files(), &args.scene));
    images.iter().try_for_each(|path| image::check_writable(path))?;
    args.heatmap.iter().try_for_each(|path| super::check_png("--heatmap", path))?;
    args.profile.iter().try_for_each(|path| output::check(path))?;
    args.checkpoint.map_or(Ok(()), |_| output::check(&checkpoint))?;
    let (layers, colours): (Vec<_>, Vec<_>) =
        images.iter().map(|path| ("-o", path.as_path())).partition(|(_, path)| image::has_layers(path));
    let maps = args.heatmap.iter().map(|path| ("--heatmap", path.as_path()));
    let traces = args.profile.iter().map(|path| ("--profile", path.as_path()));
    let others: Vec<_> = colours.into_iter().chain(maps).chain(traces).collect();
    let resumed: Vec<_> = args.resume.iter().map(|path| ("--resume", path.as_path())).collect();
    // A resumed file may become the complete one.
    check_distinct(&others, &resumed)?;
    let partial = args.checkpoint.map(|_| ("--checkpoint", checkpoint.as_path()));
    let all: Vec<_> = layers.into_iter().chain(others).chain(partial).collect();
    check_distinct(&all, &[("the scene", &args.scene)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use std::sync::atomic::Ordering;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn parse(words: &[&str]) -> Args {
        Command::parse_from([&["render"], words].concat()).args
    }

    #[test]
    fn the_output_defaults_to_the_scene_s_name_in_the_current_folder() {
        assert_eq!(parse(&["scenes/box/room.toml"]).output_files(), [Path::new("room.exr")]);
        assert_eq!(parse(&["room.toml", "-o", "a.png", "-o", "b.exr"]).output_files().len(), 2);
        assert_eq!(parse(&["room.v2.obj"]).output_files(), [Path::new("room.v2.exr")]);
        assert_eq!(parse(&["room.toml", "--exposure=-1.5"]).common.write_options().exposure, -1.5);
    }

    #[test]
    fn a_film_takes_its_records_and_its_channels() {
        // 32 bytes of statistics, 32 of light, 48 of guide; 30 channels. Placed: 24 more, and 2 channels.
        let mut settings = Settings { width: 3, height: 2, ..Settings::default() };
        assert_eq!(bytes_of_film(&settings, true), 6 * (112 + 4 * 30));
        settings.allocate.policy = &crate::allocate::both::ROW;
        assert_eq!(bytes_of_film(&settings, false), 6 * 4 * 32);
        assert_eq!(bytes_of_film(&settings, true), 6 * (112 + 24 + 4 * 32));
    }

    #[test]
    fn an_interrupt_before_the_first_sample_keeps_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let image = folder.path().join("box.exr");
        std::fs::write(&image, "old").unwrap();
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
        let small = ["--width", "8", "--height", "8", "--spp", "1", "--quiet", "-o", image.to_str().unwrap()];
        let args = parse(&[&[scene], &small[..]].concat());
        let exit_after = |asked| {
            interrupt::flag().store(asked, Ordering::SeqCst);
            run(&args).unwrap()
        };
        assert_eq!(exit_after(true), Exit::Interrupted);
        assert!(std::fs::read(&image).unwrap() == b"old");
        assert_eq!(exit_after(false), Exit::Done);
        assert!(std::fs::read(&image).unwrap() != b"old");
    }
}
