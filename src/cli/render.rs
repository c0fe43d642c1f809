//! `tallow render`: a scene becomes image files.
use super::common::Common;
use super::filter::{filter_names, filter_parts};
use super::job::{End, Job, Why};
use super::overrides::Overrides;
use super::resume::{self, Earlier};
use super::{Exit, fail_on_messages, interrupt, layers, origin, print, print_json};
use crate::composition::{self, Demodulation};
use crate::error::{Error, Result};
use crate::filter::{self, FilterSettings, Row};
use crate::gpu::{self, FrameResources, Gpu, PassTime};
use crate::image::aov::{Aovs, Names};
use crate::image::difference::false_colours;
use crate::image::{self, Film, Samples, WriteOptions, output};
use crate::memory;
use crate::renderer::{self, Counters, FilmBuffers, Outputs, Renderer};
use crate::report::table::{self, PassRow};
use crate::report::trace::chrome_trace;
use crate::scene::Scene;
use crate::settings::Settings;
use crate::statistics::BrokenSamples;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

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
    /// Write the samples per pixel in false colours to a .png
    #[arg(long, value_name = "FILE")]
    pub heatmap: Option<PathBuf>,
    /// Filter the image as `tallow filter` does with the file; the noisy one stays as the layer "Noisy Image"
    #[arg(long, value_name = "FILTER", value_parser = filter_names())]
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
        // A folder has no name of its own to give: `.` and `..`.
        let mut name = self.scene.file_stem().unwrap_or("image".as_ref()).to_owned();
        name.push(".exr");
        vec![name.into()]
    }

    /// More than radiance is kept only where a file or a filter takes it.
    fn wanted(&self) -> Outputs {
        let layers = self.denoise.is_some() || self.output_files().iter().any(|file| image::has_layers(file));
        Outputs { split_light: layers, guides: layers, counters: self.counters }
    }
}

/// What `--json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Files written; what is not UTF-8 in their names is replaced.
    pub files: Vec<String>,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples of all pixels, those of a resumed file included.
    pub samples: u64,
    /// Samples traced now.
    pub traced: u64,
    /// Of any pixel.
    pub least_samples: u32,
    /// Of any pixel.
    pub most_samples: u32,
    /// Why it ended.
    pub stopped: Why,
    /// Most priorities of one allocation that were not finite.
    pub broken_priorities: u32,
    /// Samples that were no number and counted as black, those of a resumed file included.
    pub broken_samples: Option<BrokenSamples>,
    /// Rays and nodes; none without `--counters`.
    pub counters: Option<Counters>,
    /// Wall time of reading the scene and building its hierarchy.
    pub load_seconds: f64,
    /// Wall time of the upload and of making pipelines.
    pub compile_seconds: f64,
    /// Wall time of the render without loading and writing.
    pub seconds: f64,
    /// Name of the device.
    pub device: String,
    /// GPU time by pass.
    pub passes: Vec<PassRow>,
    /// What was repaired in the scene.
    pub warnings: Vec<String>,
}

/// Runs the subcommand.
///
/// # Errors
/// Of every kind; nothing is written then, but for the noisy image when `--denoise` fails.
pub fn run(args: &Args) -> Result<Exit> {
    check_outputs(args)?;
    let mut host = Spans::default();
    let scene = host.time("load scene", || Scene::load(&args.scene, &|s| args.overrides.apply(s)))?;
    let earlier = args.resume.as_deref().map(|path| Earlier::read(path, &scene)).transpose()?;
    if args.common.talkative() {
        scene.warnings.iter().for_each(|w| eprintln!("warning: {w}"));
    }
    let gpu = host.time("open device", || args.common.open())?;
    let wanted = args.wanted();
    check_memory(args, &scene.settings, &gpu)?;
    args.denoise.map_or(Ok(()), |_| {
        filter::check_size(&gpu, [scene.settings.width, scene.settings.height], filter::GUIDE_TEXELS)
    })?;
    let mut effects = match args.effects {
        EffectChoice::Auto => renderer::called_for(&scene, wanted),
        EffectChoice::All => renderer::all_effects(&scene),
    };
    effects.adaptive |= earlier.is_some();
    let renderer = host.time("upload and compile", || Renderer::specialised(&gpu, &scene, wanted, effects))?;
    let mut frame = FrameResources::new(&gpu)?;
    // Until here there is nothing to keep, and Ctrl-C ends the process as it does any other.
    let job = Job { renderer: &renderer, stop: interrupt::flag(), quiet: !args.common.talkative() };
    let mut end = host.time("render", || job.run(&mut frame, earlier.as_ref()))?;
    if end.why == Why::Interrupted && end.traced == 0 {
        if args.common.talkative() {
            eprintln!("interrupted before the first sample: nothing is written");
        }
        return Ok(Exit::Interrupted);
    }
    let mut film = host.time("read back", || layers::film(&renderer))?;
    let seconds = host.seconds("render");
    film.metadata = metadata(args, &gpu, seconds, end.allocations);
    film.metadata.extend(origin::metadata(&scene, &film)?.map(|(k, v)| (k.to_owned(), v)));
    let before = earlier.as_ref().and_then(|earlier| earlier.broken);
    end.broken_samples = BrokenSamples::join(before, renderer.broken_samples()?);
    layers::set_broken_samples(&mut film, end.broken_samples);
    end.broken_samples.iter().for_each(warn_of_broken);
    if end.why == Why::Interrupted {
        let pending = resume::pending(&renderer, &film, &end)?;
        film.add(layers::PENDING, Samples::U32(pending));
    }
    let counters = args.counters.then(|| renderer.counters()).transpose()?;
    // The film is all that is left to write, and large films need the memory.
    drop(renderer);
    host.time("write", || write(args, &film))?;
    // By now what took hours is safe, whatever becomes of the filter.
    if let Some(row) = args.denoise.filter(|_| end.why != Why::Interrupted) {
        end.times.extend(host.time("denoise", || denoise(&gpu, row, &mut film))?);
        host.time("write", || write(args, &film))?;
    }
    fail_on_messages(&gpu)?;
    report(args, counters, &gpu, &scene, &film, &host, &end)?;
    Ok(if end.why == Why::Interrupted { Exit::Interrupted } else { Exit::Done })
}

/// Always told: it is a bug, or light too strong for the numbers.
fn warn_of_broken(broken: &BrokenSamples) {
    let BrokenSamples { count, pixel: [x, y], sample, seed } = broken;
    eprintln!(
        "warning: samples that were no number and count as black: {count}; the first: pixel ({x}, {y}), sample {sample}, seed {seed}"
    );
}

/// With the filter's default settings, scaled to the image.
fn denoise(gpu: &Gpu, row: &Row, film: &mut Film) -> Result<Vec<PassTime>> {
    let aovs = Aovs::find(film, &Names::new()).map_err(Error::Usage)?;
    let mut parts = composition::split(&aovs, Demodulation::default());
    let (light, times) = filter_parts(gpu, row, &mut parts, &|input| FilterSettings::default().scaled_to(input))?;
    layers::denoise(film, &parts.join(&light));
    Ok(times)
}

/// Host-side stages, for the trace.
#[derive(Default)]
struct Spans(Vec<PassTime>);

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

fn metadata(args: &Args, gpu: &Gpu, seconds: f64, allocations: u32) -> BTreeMap<String, String> {
    let info = gpu.info();
    let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let entries = [
        ("software", format!("tallow {}", env!("CARGO_PKG_VERSION"))),
        ("scene", args.scene.display().to_string()),
        (resume::ALLOCATIONS, allocations.to_string()),
        ("device", info.name.clone()),
        ("driver", format!("{} {} {}", info.driver_name, info.driver_version, info.driver_info)),
        ("renderSeconds", format!("{seconds:.3}")),
        ("dateUnix", since_epoch.as_secs().to_string()),
    ];
    entries.map(|(k, v)| (k.to_owned(), v)).into()
}

/// A broken pixel is a bug, and is told; the file is written all the same, so that it can be looked at.
fn write(args: &Args, film: &Film) -> Result<()> {
    let broken = film.picture(None).map_or(0, |p| p.non_finite());
    if broken > 0 {
        eprintln!("warning: {broken} pixels are not finite");
    }
    args.output_files().iter().try_for_each(|path| image::write(path, film, &args.common.write_options()))?;
    args.heatmap.iter().try_for_each(|path| write_heatmap(path, film))
}

/// Samples per pixel from 0 (dark) to the largest number (bright).
fn write_heatmap(path: &Path, film: &Film) -> Result<()> {
    let counts = layers::counts(film, "samples").map_err(|what| Error::output(path, what))?;
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let values: Vec<f32> = counts.iter().map(|&n| n as f32).collect();
    let picture = false_colours(film.width, &values, most as f32);
    let mut map = Film::new(picture.width, picture.height);
    map.add_vec3("", ["R", "G", "B"], &picture.pixels);
    image::write(path, &map, &WriteOptions::default())
}

fn report(
    args: &Args,
    counters: Option<Counters>,
    gpu: &Gpu,
    scene: &Scene,
    film: &Film,
    host: &Spans,
    end: &End,
) -> Result<()> {
    if let Some(path) = &args.profile {
        let offset = gpu.calibrate().map(|(gpu_ns, host_ns)| host_ns as i64 - gpu_ns as i64);
        output::write(path, chrome_trace(&host.0, &end.times, offset).as_bytes())?;
    }
    let counts = layers::counts(film, "samples").unwrap_or_default();
    let least_most = (counts.iter().copied().min().unwrap_or(0), counts.iter().copied().max().unwrap_or(0));
    let summary = Summary {
        files: args.output_files().iter().map(|f| f.display().to_string()).collect(),
        width: film.width,
        height: film.height,
        samples: counts.iter().map(|&n| u64::from(n)).sum(),
        traced: end.traced,
        least_samples: least_most.0,
        most_samples: least_most.1,
        stopped: end.why,
        broken_priorities: end.broken_priorities,
        broken_samples: end.broken_samples,
        counters,
        load_seconds: host.seconds("load scene"),
        compile_seconds: host.seconds("upload and compile"),
        seconds: host.seconds("render"),
        device: gpu.info().name.clone(),
        passes: table::summarise(&end.times),
        warnings: scene.warnings.clone(),
    };
    match (args.common.json, args.common.quiet) {
        (true, _) => print_json(&summary),
        (false, true) => Ok(()),
        (false, false) => print(&text(&summary)),
    }
}

fn text(s: &Summary) -> String {
    let speed = s.traced as f64 * 1e-6 / s.seconds.max(1e-9);
    let mut text = format!(
        "{} x {}, {} samples in {:.2} s ({speed:.2} Msamples/s) on {}; loaded in {:.2} s, compiled in {:.2} s\n",
        s.width, s.height, s.traced, s.seconds, s.device, s.load_seconds, s.compile_seconds
    );
    if s.least_samples != s.most_samples {
        let mean = s.samples as f64 / (f64::from(s.width) * f64::from(s.height));
        text += &format!("{} to {} samples per pixel, {mean:.2} on average\n", s.least_samples, s.most_samples);
    }
    text += &s.stopped.line();
    if s.broken_priorities > 0 {
        text += &format!("warning: {} priorities were not finite and counted for nothing\n", s.broken_priorities);
    }
    if let Some(c) = &s.counters {
        let per_ray = c.nodes as f64 / c.rays().max(1) as f64;
        text += &format!("{} closest-hit rays, {} any-hit rays, {per_ray:.1} nodes each\n", c.closest, c.any);
    }
    text + &table::timing_table(&s.passes)
}

/// A system that is out of memory ends the process hours later without a word.
fn check_memory(args: &Args, settings: &Settings, gpu: &Gpu) -> Result<()> {
    let refused = |what| format!("a film of {} x {} {what}: choose a smaller film", settings.width, settings.height);
    let bytes = bytes_of_film(settings, gpu.info().unified);
    // The renderer's buffers are gone when the filter begins.
    let filtered = bytes_of_film(settings, false) + settings.pixels() as u64 * BYTES_DENOISED;
    let bytes = if args.denoise.is_some() { bytes.max(filtered) } else { bytes };
    memory::check(bytes).map_err(|what| Error::Device(refused(what)))
}

/// What a pixel takes beside the film's channels while it is filtered, the largest: measured at 2400 x 2400 on a device without
/// memory of its own, 412 with `none`, 500 with `guided`, 1047 with `auto`, 1158 with `auto` where pixels lack direct light.
const BYTES_DENOISED: u64 = 1160;

/// Of host memory, at the moment when it is read back.
fn bytes_of_film(settings: &Settings, unified: bool) -> u64 {
    let placed = settings.allocate.policy != "uniform";
    let device = if unified { FilmBuffers::bytes_per_pixel(placed) } else { 0 };
    settings.pixels() as u64 * (device + layers::bytes_per_pixel(placed))
}

/// A render may take hours; what cannot be written is told before.
fn check_outputs(args: &Args) -> Result<()> {
    args.output_files().iter().try_for_each(|path| image::check_writable(path))?;
    args.heatmap.iter().try_for_each(|path| super::check_png("--heatmap", path))?;
    args.profile.iter().try_for_each(|path| image::output::check(path))
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
        assert_eq!(parse(&["room.toml", "--exposure", "-1.5"]).common.write_options().exposure, -1.5);
    }

    #[test]
    fn a_film_takes_its_records_and_its_channels() {
        // 32 bytes of statistics, 32 of light, 48 of guide; 30 channels. Placed: 24 more, and 2 channels.
        let mut settings = Settings { width: 3, height: 2, ..Settings::default() };
        assert_eq!(bytes_of_film(&settings, true), 6 * (112 + 4 * 30));
        settings.allocate.policy = "both".into();
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
