//! `tallow render`: a scene becomes image files.
use super::progress::Progress;
use super::{Exit, fail_on_messages, finite, interrupt, layers, print, print_json};
use crate::error::{Error, Result};
use crate::gpu::{self, DeviceOptions, FrameResources, Gpu, PassTime};
use crate::image::{self, Film, WriteOptions, output, tone::ToneMap};
use crate::renderer::{self, Counters, Outputs, Renderer};
use crate::report::table::{self, PassRow};
use crate::report::trace::chrome_trace;
use crate::scene::Scene;
use crate::settings::{PixelFilter, Sampler, Settings};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
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
/// Options override the settings of the scene file.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (.toml) or model (.obj)
    pub scene: PathBuf,
    /// Image to write: .exr (all layers), .png or .hdr; may be given several times [default: the scene's name + .exr]
    #[arg(short, long = "output", value_name = "FILE")]
    pub outputs: Vec<PathBuf>,
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Effects to compile in
    #[arg(long, value_enum, default_value_t)]
    pub effects: EffectChoice,
    /// Exposure of PNG files in stops
    #[arg(long, value_name = "STOPS", default_value = "0", value_parser = finite, allow_negative_numbers = true)]
    pub exposure: f64,
    /// Tone curve of PNG files
    #[arg(long, value_enum, default_value_t)]
    pub tonemap: ToneMap,
    /// Write a trace of CPU and GPU for Perfetto
    #[arg(long, value_name = "FILE")]
    pub profile: Option<PathBuf>,
    /// Count rays and visited nodes
    #[arg(long)]
    pub counters: bool,
    /// Run under the Vulkan validation layers and fail on any message
    #[arg(long)]
    pub validation: bool,
    /// Print one JSON object at the end
    #[arg(long)]
    pub json: bool,
    /// No progress bar and no table
    #[arg(short, long)]
    pub quiet: bool,
    /// Replace the scene's own settings.
    #[command(flatten)]
    pub overrides: Overrides,
}

/// Settings given on the command line.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Settings")]
pub struct Overrides {
    /// Film width in pixels
    #[arg(long, value_name = "N")]
    pub width: Option<u32>,
    /// Film height in pixels
    #[arg(long, value_name = "N")]
    pub height: Option<u32>,
    /// Samples per pixel
    #[arg(long, value_name = "N")]
    pub spp: Option<u32>,
    /// Path edges: 2 is direct light, 3 one bounce of indirect light
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Edges after which Russian roulette starts; 0 is off
    #[arg(long, value_name = "N")]
    pub roulette_depth: Option<u32>,
    /// Largest value of an indirect sample; 0 is off, others bias the image
    #[arg(long, value_name = "N")]
    pub clamp_indirect: Option<f32>,
    /// Chooses the random sequence
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// Pixel filter
    #[arg(long, value_enum)]
    pub filter: Option<PixelFilter>,
    /// Random numbers
    #[arg(long, value_enum)]
    pub sampler: Option<Sampler>,
}

impl Overrides {
    /// Replaces those settings that were given.
    pub fn apply(&self, settings: &mut Settings) {
        let Settings { width, height, spp, max_depth, roulette_depth, clamp_indirect, seed, filter, sampler } =
            settings;
        set(width, self.width);
        set(height, self.height);
        set(spp, self.spp);
        set(max_depth, self.max_depth);
        set(roulette_depth, self.roulette_depth);
        set(clamp_indirect, self.clamp_indirect);
        set(seed, self.seed);
        set(filter, self.filter);
        set(sampler, self.sampler);
    }
}

fn set<T>(setting: &mut T, given: Option<T>) {
    if let Some(value) = given {
        *setting = value;
    }
}

impl Args {
    /// Files to write.
    pub fn output_files(&self) -> Vec<PathBuf> {
        if !self.outputs.is_empty() {
            return self.outputs.clone();
        }
        let mut name = self.scene.file_stem().unwrap_or_default().to_owned();
        name.push(".exr");
        vec![name.into()]
    }

    /// How PNG files are made.
    pub fn write_options(&self) -> WriteOptions {
        WriteOptions { exposure: self.exposure as f32, tone_map: self.tonemap }
    }
}

/// What `--json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Files written.
    pub files: Vec<PathBuf>,
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Samples taken, over all pixels.
    pub samples: u64,
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
/// Of every kind; nothing is written then.
pub fn run(args: &Args) -> Result<Exit> {
    check_outputs(args)?;
    let stop = interrupt::flag();
    let mut host = Spans::default();
    let scene = host.time("load scene", || Scene::load(&args.scene, &|s| args.overrides.apply(s)))?;
    let talkative = !args.quiet && !args.json;
    if talkative {
        scene.warnings.iter().for_each(|w| eprintln!("warning: {w}"));
    }
    let options = DeviceOptions { device: args.device.clone(), validation: args.validation };
    let gpu = host.time("open device", || Gpu::open(&options))?;
    let wanted = Outputs { split_light: true, guides: true, counters: args.counters };
    let effects = match args.effects {
        EffectChoice::Auto => renderer::called_for(&scene, wanted),
        EffectChoice::All => renderer::all_effects(&scene),
    };
    let renderer = host.time("upload and compile", || Renderer::specialised(&gpu, &scene, wanted, effects))?;
    let mut frame = FrameResources::new(&gpu)?;
    let Some(times) = host.time("render", || render(&renderer, &mut frame, stop, !talkative))? else {
        return Ok(Exit::Interrupted);
    };
    let mut film = host.time("read back", || layers::film(&renderer))?;
    let seconds = host.seconds("render");
    film.metadata = metadata(args, &renderer, &gpu, seconds)?;
    host.time("write", || write(args, &film))?;
    fail_on_messages(&gpu)?;
    report(args, &renderer, &gpu, &scene, &host, &times)?;
    Ok(Exit::Done)
}

/// Times of all passes, or none when the user stopped it.
fn render(
    renderer: &Renderer,
    frame: &mut FrameResources,
    stop: &AtomicBool,
    quiet: bool,
) -> Result<Option<Vec<PassTime>>> {
    let settings = renderer.settings();
    let total = settings.pixels() as u64 * u64::from(settings.spp);
    let mut progress = Progress::new(total, quiet);
    let (mut times, mut rays) = (Vec::new(), 0);
    for batch in renderer.batches() {
        if stop.load(Ordering::SeqCst) {
            progress.finish();
            return Ok(None);
        }
        times.extend(renderer.run(frame, &batch)?);
        let counters = if renderer.outputs().counters { renderer.counters()? } else { Counters::default() };
        progress.add(u64::from(batch.pixels) * u64::from(batch.samples), counters.rays() - rays);
        rays = counters.rays();
    }
    progress.finish();
    Ok(Some(times))
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
        spans.map(|s| s.end_ns.saturating_sub(s.begin_ns) as f64 * 1e-9).sum()
    }
}

fn metadata(args: &Args, renderer: &Renderer, gpu: &Gpu, seconds: f64) -> Result<BTreeMap<String, String>> {
    let info = gpu.info();
    let settings = serde_json::to_string(renderer.settings()).map_err(|e| Error::Usage(e.to_string()))?;
    let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let entries = [
        ("software", format!("tallow {}", env!("CARGO_PKG_VERSION"))),
        ("scene", args.scene.display().to_string()),
        ("settings", settings),
        ("seed", renderer.settings().seed.to_string()),
        ("device", info.name.clone()),
        ("driver", format!("{} {} {}", info.driver_name, info.driver_version, info.driver_info)),
        ("renderSeconds", format!("{seconds:.3}")),
        ("dateUnix", since_epoch.as_secs().to_string()),
    ];
    Ok(entries.map(|(k, v)| (k.to_owned(), v)).into())
}

/// A broken pixel is a bug, and is told; the file is written all the same, so that it can be looked at.
fn write(args: &Args, film: &Film) -> Result<()> {
    let broken = film.picture(None).map_or(0, |p| p.non_finite());
    if broken > 0 {
        eprintln!("warning: {broken} pixels are not finite");
    }
    args.output_files().iter().try_for_each(|path| image::write(path, film, &args.write_options()))
}

fn report(args: &Args, renderer: &Renderer, gpu: &Gpu, scene: &Scene, host: &Spans, times: &[PassTime]) -> Result<()> {
    if let Some(path) = &args.profile {
        let offset = gpu.calibrate().map(|(gpu_ns, host_ns)| host_ns as i64 - gpu_ns as i64);
        output::write(path, chrome_trace(&host.0, times, offset).as_bytes())?;
    }
    let settings = renderer.settings();
    let counters = if args.counters { Some(renderer.counters()?) } else { None };
    let summary = Summary {
        files: args.output_files(),
        width: settings.width,
        height: settings.height,
        samples: settings.pixels() as u64 * u64::from(settings.spp),
        counters,
        load_seconds: host.seconds("load scene"),
        compile_seconds: host.seconds("upload and compile"),
        seconds: host.seconds("render"),
        device: gpu.info().name.clone(),
        passes: table::summarise(times),
        warnings: scene.warnings.clone(),
    };
    match (args.json, args.quiet) {
        (true, _) => print_json(&summary),
        (false, true) => Ok(()),
        (false, false) => print(&text(&summary)),
    }
}

fn text(s: &Summary) -> String {
    let speed = s.samples as f64 * 1e-6 / s.seconds.max(1e-9);
    let mut text = format!(
        "{} x {}, {} samples in {:.2} s ({speed:.2} Msamples/s) on {}; loaded in {:.2} s, compiled in {:.2} s\n",
        s.width, s.height, s.samples, s.seconds, s.device, s.load_seconds, s.compile_seconds
    );
    if let Some(c) = &s.counters {
        let per_ray = c.nodes as f64 / c.rays().max(1) as f64;
        text += &format!("{} closest-hit rays, {} any-hit rays, {per_ray:.1} nodes each\n", c.closest, c.any);
    }
    text + &table::timing_table(&s.passes)
}

/// A render may take hours; what cannot be written is told before.
fn check_outputs(args: &Args) -> Result<()> {
    args.output_files().iter().try_for_each(|path| image::check_writable(path))?;
    args.profile.iter().try_for_each(|path| image::output::check(path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use std::path::Path;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    fn parse(words: &[&str]) -> Args {
        Command::parse_from([&["render"], words].concat()).args
    }

    #[test]
    fn every_setting_given_replaces_that_of_the_scene_and_no_other() {
        let mut settings = Settings { spp: 7, ..Settings::default() };
        parse(&["a.toml"]).overrides.apply(&mut settings);
        assert_eq!(settings, Settings { spp: 7, ..Settings::default() });
        let words = "a.toml --width 1 --height 2 --spp 3 --max-depth 4 --roulette-depth 5 --clamp-indirect 6 --seed 8 \
            --filter tent --sampler independent";
        parse(&words.split_whitespace().collect::<Vec<_>>()).overrides.apply(&mut settings);
        let expected = Settings {
            width: 1,
            height: 2,
            spp: 3,
            max_depth: 4,
            roulette_depth: 5,
            clamp_indirect: 6.0,
            seed: 8,
            filter: PixelFilter::Tent,
            sampler: Sampler::Independent,
        };
        assert_eq!(settings, expected);
    }

    #[test]
    fn the_output_defaults_to_the_scene_s_name_in_the_current_folder() {
        assert_eq!(parse(&["scenes/box/room.toml"]).output_files(), [Path::new("room.exr")]);
        assert_eq!(parse(&["room.toml", "-o", "a.png", "-o", "b.exr"]).output_files().len(), 2);
        assert_eq!(parse(&["room.v2.obj"]).output_files(), [Path::new("room.v2.exr")]);
        assert_eq!(parse(&["room.toml", "--exposure", "-1.5"]).write_options().exposure, -1.5);
    }
}
