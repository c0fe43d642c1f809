//! `tallow render`: a scene becomes image files.
pub mod black;
pub mod outputs;
mod planned;
mod shot;
mod spans;
mod summary;
mod taken;

use super::checkpoint;
use super::choices::Choices;
use super::common::{Common, PngOptions, Warnings};
use super::files::Files;
use super::overrides::Overrides;
use super::{Exit, complain};
use crate::allocate::Placing;
use crate::denoise;
use crate::denoise::filter::{self, Method};
use crate::error::{Checked, Error, Result};
use crate::gpu::{Gpu, Tracing};
use crate::image;
use crate::render::settings::{Allocate, Settings};
use crate::render::{Checkpoint, Job, Outputs, Renderer, all_effects};
use crate::scene::{Loaded, Scene, light_and_camera_effects};
pub use shot::{FRAME, Shot};
pub use spans::Spans;
use std::path::PathBuf;
use std::time::Duration;
pub use taken::{Taken, shoot};

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
#[derive(Clone, clap::Args)]
pub struct Args {
    /// Scene file (.toml, .gltf, .glb) or model (.obj, .ply)
    pub scene: PathBuf,
    /// Image to write: .exr (all layers), .png or .hdr; may be given several times [default: the scene's name, its
    /// folder's for a file called scene, + .exr]
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
    /// Every so many minutes, write what there is to NAME.partial.exr, beside the first .exr output, or else the first output:
    /// --resume continues it after a crash. It is removed when the render is complete
    #[arg(long, value_name = "MINUTES", value_parser = checkpoint::minutes)]
    pub checkpoint: Option<Duration>,
    /// Write the samples per pixel in false colours to a .png
    #[arg(long, value_name = "FILE")]
    pub heatmap: Option<PathBuf>,
    /// Filter the image as `tallow filter` does with the file; the noisy one stays as the layer "Noisy Image"
    #[arg(long, value_name = "FILTER")]
    pub denoise: Option<Method>,
    /// Render the best image within a GPU time, such as 200ms, 2s or "1m 30s": a probe of the scene on this device, which is not part of
    /// that time and may take longer, tells how many samples fit, and whether to filter (with --denoise, that filter is taken)
    #[arg(long, value_name = "DURATION", value_parser = planned::duration, allow_hyphen_values = true,
          conflicts_with_all = ["error", "spp", "resume", "pixel"])]
    pub time: Option<Duration>,
    /// Render in the least time an image of this relMSE, which is estimated without a reference by a probe, which may take longer than
    /// the render
    #[arg(long, value_name = "RELMSE", conflicts_with_all = ["spp", "resume", "pixel"])]
    pub error: Option<f64>,
    /// With --time or --error: where to write what was planned. Without: the plan to render, to the same bits
    #[arg(long, value_name = "FILE", conflicts_with_all = ["spp", "resume", "pixel"])]
    pub plan: Option<PathBuf>,
    /// Render only the pixel in this column and row, with the samples that it has in the whole image, wherever those were
    /// placed: --spp says how many
    #[arg(long, value_name = "X,Y", value_parser = pixel, allow_hyphen_values = true,
          conflicts_with_all = ["resume", "checkpoint", "denoise"])]
    pub pixel: Option<[u32; 2]>,
    /// What of a glTF file is seen.
    #[command(flatten)]
    pub choices: Choices,
    /// Count rays and visited nodes; those that ray queries visit, nobody counts
    #[arg(long)]
    pub counters: bool,
    /// Who finds what rays meet
    #[arg(long, value_enum, default_value_t)]
    pub tracing: Tracing,
    /// The device, and what is printed.
    #[command(flatten)]
    pub common: Common,
    /// How .png files show radiance.
    #[command(flatten)]
    pub png: PngOptions,
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

    /// What filters the film, if anything does.
    pub fn filter(&self, settings: &Settings) -> Option<Method> {
        self.denoise.filter(|method| method.changes(settings.indirect_stride))
    }

    /// More than radiance is kept only where a file or a filter takes it.
    pub fn wanted(&self) -> Outputs {
        let layers = self.denoise.is_some()
            || self.checkpoint.is_some()
            || self.output_files().iter().any(|file| image::has_layers(file));
        Outputs { counters: self.counters, ..Outputs::for_filter(layers) }
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Of every kind. What fails before the first sample leaves nothing written; when `--denoise` fails the noisy image is there;
/// an output that fails keeps no other from being written.
pub fn run(args: &Args) -> Result<Exit> {
    outputs::check(args)?;
    if let Some(method) = args.denoise {
        method.check()?;
    }
    let mut host = Spans::default();
    let plan = planned::read(args)?;
    let (scene, settings) = host.time("load scene", || load(args))?;
    outputs::check_with(args, &scene)?;
    let asked = settings.clone();
    let settings = plan.as_ref().map_or(Ok(settings), |plan| planned::settings(args, plan, &scene))?;
    let mut warnings = args.common.warnings();
    warn_of_unread(args, &settings, &mut warnings);
    let earlier = args.resume.as_deref().map(|path| Checkpoint::read(path, &scene, &settings)).transpose()?;
    warnings.add(scene.warnings.clone());
    let filtered = earlier.as_ref().and_then(|earlier| earlier.filtered.as_ref());
    if let Some(filter) = filtered.filter(|_| args.denoise.is_none_or(Method::is_none)) {
        let will = format!("and this one will not be: add --denoise {filter}");
        warnings.add([format!("the resumed image was filtered ({filter}), {will}")]);
    }
    let gpu = host.time("open device", || args.common.open(args.tracing))?;
    let plan = match plan {
        Some(plan) => Some(plan),
        None => host.time("plan", || planned::make(args, &gpu, &scene, &settings, &mut warnings))?,
    };
    let (args, settings) = &planned::applied(args, settings, plan.as_ref())?;
    warn_of_unplaced(settings, &mut warnings);
    if let Some(method) = args.denoise {
        method.check()?;
    }
    check_room(args.filter(settings), settings, &gpu)?;
    check_stride(args, settings, &mut warnings)?;
    warn_of_lens(args, &scene, &mut warnings);
    let renderer = host.time("upload and compile", || renderer(args, &gpu, &scene, settings))?;
    if args.checkpoint.is_some() && !renderer.can_resume() {
        let what = "a film of this size cannot go on from a checkpoint on this device, which keeps the picture alone";
        warnings.insist([what.to_owned()]);
    }
    let job = Job { checkpoint: earlier.as_ref(), ..Job::new(&renderer) };
    let files = Files::new(args.resume.as_deref());
    let taken = shoot(Shot { args, gpu: &gpu, job }, files, host, &mut warnings)?;
    let can_resume = renderer.can_resume();
    // The film is all that is left to write and to filter, and large films need the memory.
    drop(renderer);
    let Some(mut taken) = taken else {
        complain("interrupted before the first sample: nothing was written");
        return Ok(Exit::Interrupted);
    };
    if taken.is_whole() && args.pixel.is_none() {
        warnings.add(black::why(taken.film(), &scene, settings));
    }
    taken.resumes_by(plan.as_ref().map_or_else(String::new, |plan| planned::instead(plan, &asked)));
    let written = taken.finish(args, plan.as_ref(), true, &mut warnings)?;
    if !taken.is_whole() {
        complain(&taken.interruption(&written, can_resume));
        return Ok(Exit::Interrupted);
    }
    Ok(Exit::Done)
}

/// The settings are checked before what may take long.
///
/// # Errors
/// Of usage and input.
pub fn load(args: &Args) -> Result<(Loaded, Settings)> {
    let (file, mut settings) = args.choices.open_at_rest(&args.scene, &args.overrides)?;
    if let Some([x, y]) = args.pixel {
        settings.allocate = Allocate::default();
        if x >= settings.width || y >= settings.height {
            let size = format!("{}x{}", settings.width, settings.height);
            return Err(Error::Usage(format!("--pixel {x},{y} is outside of the film, which is {size}")));
        }
    }
    settings.validate()?;
    // A plan chooses the samples, and says itself what it cannot keep to.
    if args.time.is_none() && args.error.is_none() && args.plan.is_none() {
        settings.check_most()?;
    }
    Ok((file.load()?, settings))
}

/// Parses a column and a row.
fn pixel(text: &str) -> Checked<[u32; 2]> {
    let numbers = text.split_once(',').map(|(x, y)| (x.trim().parse(), y.trim().parse()));
    match numbers {
        Some((Ok(x), Ok(y))) => Ok([x, y]),
        _ => Err("expected a column and a row, such as 12,34".to_owned()),
    }
}

/// With the kernels that the scene calls for, or with all.
fn renderer(args: &Args, gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Renderer> {
    let wanted = args.wanted();
    match (args.effects, &args.resume) {
        (EffectChoice::All, _) => Renderer::specialised(gpu, scene, settings, wanted, all_effects(scene, settings)),
        (EffectChoice::Auto, Some(_)) => Renderer::resumable(gpu, scene, settings, wanted),
        (EffectChoice::Auto, None) => Renderer::new(gpu, scene, settings, wanted),
    }
}

/// A system that is out of memory ends the process hours later without a word; what the filter cannot bind is told before, too.
///
/// # Errors
/// [`Error::Memory`], and [`Error::Device`] for what the filter cannot bind.
pub fn check_room(denoise: Option<Method>, settings: &Settings, gpu: &Gpu) -> Result<()> {
    let size = settings.size();
    let refused = |what| Error::Memory(format!("a film of {} x {} {what}: choose a smaller film", size[0], size[1]));
    denoise::check_room(denoise, settings, gpu.info().unified).map_err(refused)?;
    if denoise.is_some() {
        filter::check_size(gpu, size)?;
    }
    Ok(())
}

/// Tells which settings the policy, that of the scene file or of the options, does not read. A plan chooses the policy itself.
pub fn warn_of_unread(args: &Args, settings: &Settings, warnings: &mut Warnings) {
    let policy = settings.allocate.policy;
    if args.time.is_some() || args.error.is_some() {
        return;
    }
    warnings.add_unread(args.overrides.allocate.given(), policy.name, |option| policy.reads(option));
}

/// Tells where other settings leave a policy no samples to place. Where samples are carried from frame to frame they count, too.
pub fn warn_of_unplaced(settings: &Settings, warnings: &mut Warnings) {
    let Allocate { policy, min_spp, max_spp, .. } = settings.allocate;
    let (spp, name) = (settings.spp, policy.name);
    if settings.allocate.has_threshold() || settings.allocate.is_even() {
        return;
    }
    let told = if min_spp >= spp {
        format!("min-spp is {min_spp}: spp, {spp}, leaves no samples that {name} could place")
    } else if policy.placing != Placing::Chosen && (1..=spp).contains(&max_spp) {
        format!("max-spp is {max_spp}, and spp {spp}: all pixels get {max_spp}, and {name} places none")
    } else {
        return;
    };
    warnings.add([told]);
}

/// Of light that is not traced for every pixel a picture can be made by some filters alone.
///
/// # Errors
/// [`Error::Usage`] for another filter; without any a warning tells what is left to do.
pub fn check_stride(args: &Args, settings: &Settings, warnings: &mut Warnings) -> Result<()> {
    let stride = settings.indirect_stride;
    if args.denoise.is_none() && stride > 1 {
        let missing = filter::missing_light(stride);
        warnings.add([format!("{missing}: add --denoise, or use tallow filter on the .exr")]);
    }
    if let Some(method) = args.denoise {
        method.check_stride(stride)?;
    }
    Ok(())
}

/// What a lens blurs has noise, of which most filters leave that of sharp light, lamps and sky.
pub fn warn_of_lens(args: &Args, scene: &Scene, warnings: &mut Warnings) {
    let leaves = args.denoise.filter(|method| method.leaves_noise_of_lens() && light_and_camera_effects(scene).lens);
    let what = "leaves the noise of direct light, lamps and sky where the lens blurs them: auto and svgf filter it";
    warnings.add(leaves.map(|method| format!("{} {what}", method.name())));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::interrupt;
    use crate::gpu::DeviceOptions;
    use crate::image::Film;
    use clap::Parser;
    use std::path::Path;
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
        assert_eq!(parse(&["room.toml", "--exposure=-1.5"]).png.write_options().exposure, -1.5);
    }

    #[test]
    fn options_of_the_scene_and_of_pictures_reach_them() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.gltf");
        std::fs::write(&file, r#"{ "asset": { "version": "2.0" }, "scenes": [{}] }"#).unwrap();
        let file = file.to_str().unwrap();
        assert!(load(&parse(&[file])).is_ok());
        let refused = |words: &[&str]| load(&parse(&[&[file], words].concat())).map(drop).unwrap_err().to_string();
        assert!(refused(&["--clip", "walk"]).contains("walk") && refused(&["--camera", "left"]).contains("left"));
        assert_eq!(parse(&["a.toml", "--tonemap", "aces"]).png.write_options().tone_map, image::tone::ToneMap::Aces);
        let counted = |words: &[&str]| parse(&[&["a.toml"], words].concat()).wanted().counters;
        assert_eq!([counted(&["--counters"]), counted(&[])], [true, false]);
    }

    #[test]
    fn a_film_that_no_host_has_room_for_is_told_as_memory() {
        let gpu = Gpu::open(&DeviceOptions::default()).unwrap();
        // 4 EiB for each 1024 bytes of a pixel; the scene file and the options have no such films.
        let of_edge = |edge| Settings { width: edge, height: edge, ..Settings::default() };
        assert!(check_room(None, &of_edge(8), &gpu).is_ok());
        let error = check_room(None, &of_edge(1 << 26), &gpu).unwrap_err();
        let line = error.to_string();
        assert!(matches!(error, Error::Memory(_)) && line.starts_with("a film of 67108864 x 67108864 needs"), "{line}");
    }

    #[test]
    fn one_file_is_written_before_a_filter() {
        let first = |words: &[&str]| outputs::before_filter(&parse(words), &Film::default()).map(|item| item.path);
        let outputs = ["-o", "a.png", "-o", "b.exr", "-o", "c.exr", "--heatmap", "map.png"];
        assert_eq!(first(&[&["room.toml"], &outputs[..]].concat()), Some("b.exr".into()));
        assert_eq!(first(&["room.toml", "-o", "a.hdr", "-o", "b.png"]), Some("a.hdr".into()));
        #[cfg(unix)]
        assert_eq!(first(&["room.toml", "-o", "/dev/null", "--heatmap", "map.png"]), None);
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
