//! `tallow explain`: lists the effects that a scene needs and measures what each of them costs.
mod text;

use super::choices::Choices;
use super::common::Warnings;
use super::overrides::Overrides;
use super::progress::Stages;
use super::{Exit, print, print_json};
use crate::cost::document::Estimate;
use crate::cost::interval;
use crate::error::{Error, Result};
use crate::gpu::{DeviceKind, DeviceOptions, FrameResources, Gpu, total_ms};
use crate::layout::*;
use crate::render::settings::{Allocate, Settings};
use crate::render::{Job, Outputs, Renderer, bytes_in_flight, called_for};
use crate::scene::{self, Loaded, Scene};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use text::text;

/// List every effect: on or off, what calls for it, and what it costs
///
/// Options override the settings of the scene file. Times are those of one sample per pixel of the film, made smaller if it has more
/// than 128 x 128 pixels, or 256 x 256 where a graphics card renders. Bytes are those of the film in its own size.
#[derive(clap::Args)]
pub struct Args {
    /// Scene file (.toml, .gltf, .glb) or model (.obj, .ply)
    pub scene: PathBuf,
    /// Effects to measure [default: all of them]
    #[arg(value_name = "EFFECT")]
    pub effects: Vec<String>,
    /// What of a glTF file is seen.
    #[command(flatten)]
    pub choices: Choices,
    /// Device, by index or part of its name [default: the best one]
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Say what is on and what calls for it, and measure nothing: needs no device
    #[arg(long, conflicts_with = "device")]
    pub no_measure: bool,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Replace the scene's own settings.
    #[command(flatten)]
    pub overrides: Overrides,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Report<'a> {
    effects: Vec<EffectRow>,
    /// `None` where nothing was measured.
    #[serde(flatten)]
    sizes: Option<Sizes>,
    /// What was repaired in the scene.
    warnings: &'a [String],
}

/// Width and height of the films that costs are of.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Sizes {
    /// The film of all times.
    pub timed_size: [u32; 2],
    /// The film of all bytes, which is the scene's own.
    pub film_size: [u32; 2],
}

/// One effect of a render that writes an EXR file. Costs that were not measured are `None`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct EffectRow {
    /// Name of the effect.
    pub effect: &'static str,
    /// Whether the scene calls for it.
    pub on: bool,
    /// Object, material or setting that calls for it; empty if it is off.
    pub called_for_by: String,
    /// GPU time in ms of one sample per pixel of [`Sizes::timed_size`] with the effect compiled in.
    pub gpu_ms_with: Option<f64>,
    /// GPU time in ms without it.
    pub gpu_ms_without: Option<f64>,
    /// What the effect adds to the GPU time in ms: ends of a 95 % interval of the median difference of runs in turn. If it holds 0, the
    /// difference may be chance.
    pub gpu_ms_added: Option<[f64; 2]>,
    /// Time in ms to compile the pipelines with the effect, less that without it; 0 if there is no measurable difference.
    pub compile_ms: Option<f64>,
    /// Bytes of device memory that the effect adds: records of the scene that nothing else reads, and buffers of the
    /// render at [`Sizes::film_size`].
    pub bytes: Option<u64>,
}

/// Runs the subcommand in a process whose drivers cache no compiled kernels, because a cache would hide the cost of
/// compilation.
///
/// # Errors
/// As a render of the scene.
pub fn run(args: &Args) -> Result<Exit> {
    let is_cold = || COLD.iter().all(|(name, value)| std::env::var(name).as_deref() == Ok(*value));
    if !args.no_measure && !is_cold() {
        return run_cold();
    }
    let (file, settings) = args.choices.open_at_rest(&args.scene, &args.overrides)?;
    settings.validate()?;
    let scene = file.load()?.with(|own| *own = settings);
    let mut warnings = Warnings::new(!args.json);
    warnings.add(scene.warnings.clone());
    let mut effects = listed(&args.effects, &scene)?;
    let sizes = (!args.no_measure).then(|| measure(&mut effects, args, scene)).transpose()?;
    if args.json {
        print_json(&Report { effects, sizes, warnings: warnings.all() })?;
    } else {
        print(&text(&effects, sizes))?;
    }
    Ok(Exit::Done)
}

/// Name of the output that is no effect of a kernel but is listed like one.
const GUIDES: &str = "guides";

/// Environment variables that switch caches off: those of Mesa and NVIDIA, which drivers read when they are loaded, and the
/// folder of Tallow's own pipeline cache, set to one that cannot exist.
const COLD: [(&str, &str); 3] =
    [("MESA_SHADER_CACHE_DISABLE", "true"), ("__GL_SHADER_DISK_CACHE", "0"), ("XDG_CACHE_HOME", "/dev/null")];

/// Replaces this process by the same command with [`COLD`] set, so that signals reach it and the caller sees its exit code.
#[cfg(unix)]
fn run_cold() -> Result<Exit> {
    use std::os::unix::process::CommandExt;
    let again = std::env::current_exe().map(|program| again(&program).exec());
    Err(Error::Device(format!("this program cannot be started once more: {}", again.unwrap_or_else(|e| e))))
}

/// Runs the same command with [`COLD`] set and ends with its exit code.
#[cfg(not(unix))]
fn run_cold() -> Result<Exit> {
    let ended = std::env::current_exe().and_then(|program| again(&program).status());
    let ended = ended.map_err(|e| Error::Device(format!("this program cannot be started once more: {e}")))?;
    let killed = || Error::Device(format!("this program, started once more, was ended: {ended}"));
    std::process::exit(ended.code().ok_or_else(killed)?)
}

fn again(program: &Path) -> Command {
    let mut again = Command::new(program);
    again.args(std::env::args_os().skip(1)).envs(COLD);
    again
}

/// The costs measured so far.
#[derive(Clone, Copy)]
struct Cost {
    /// Least time of all passes together for one sample per pixel.
    gpu_ms: f64,
    /// Time to create the pipelines, plus the time by which the first run was slower than a later one, because drivers may
    /// compile then.
    compile_ms: f64,
    /// Bytes of device memory that the renderer allocates, less those of samples in flight.
    bytes: u64,
    /// Bytes of samples in flight in a render of the scene's own film.
    in_flight: u64,
}

/// A renderer on a device of its own, for which nothing was compiled before.
struct Variant {
    renderer: Renderer,
    frame: FrameResources,
    cost: Cost,
}

impl Variant {
    /// `whole`: the settings of the scene's own film.
    fn new(args: &Args, scene: &Loaded, whole: &Settings, outputs: Outputs, effects: Effects) -> Result<Self> {
        let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
        let renderer = Renderer::specialised(&gpu, scene, &scene.settings, outputs, effects)?;
        let created: f64 = renderer.compile_times().iter().map(|(_, ms)| ms).sum();
        let in_flight = |settings| bytes_in_flight(&gpu, scene, settings, renderer.effects());
        let bytes = gpu.allocated_bytes().saturating_sub(in_flight(&scene.settings));
        let cost = Cost { gpu_ms: f64::INFINITY, compile_ms: created, bytes, in_flight: in_flight(whole) };
        let mut variant = Self { renderer, frame: FrameResources::new(&gpu)?, cost };
        let first = variant.run()?;
        variant.cost.compile_ms += (first - variant.run()?).max(0.0);
        Ok(variant)
    }

    /// Renders once and returns the GPU time in milliseconds.
    fn run(&mut self) -> Result<f64> {
        let times = Job::new(&self.renderer).run_to_end(&mut self.frame)?.times;
        Ok(total_ms(&times))
    }
}

/// The effects that are named, or all, without their costs.
fn listed(named: &[String], scene: &Loaded) -> Result<Vec<EffectRow>> {
    let Outputs { split_light, counters, .. } = Outputs::FILTERED;
    let (base, reasons) = scene::effects(scene, &scene.settings, split_light, counters);
    let reason = |effect| reasons.iter().find(|(of, _)| *of == effect).map_or("", |(_, by)| by).to_owned();
    let effects = Effect::ALL.iter().zip(base.switches()).map(|(&e, on)| (e.name(), on, reason(e)));
    let all: Vec<_> = effects.chain([(GUIDES, true, "an output that keeps primary hits".to_owned())]).collect();
    let names: Vec<_> = all.iter().map(|(name, ..)| *name).collect();
    if let Some(unknown) = named.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(Error::Usage(format!("no effect \"{unknown}\": choose of {}", names.join(", "))));
    }
    let wanted = all.into_iter().filter(|(name, ..)| named.is_empty() || named.iter().any(|effect| effect == name));
    let row = |(effect, on, called_for_by)| EffectRow { effect, on, called_for_by, ..EffectRow::default() };
    Ok(wanted.map(row).collect())
}

/// Measures what each of the rows costs, in a small render of the scene.
fn measure(rows: &mut [EffectRow], args: &Args, scene: Loaded) -> Result<Sizes> {
    let gpu = Gpu::open(&DeviceOptions { device: args.device.clone(), ..DeviceOptions::default() })?;
    let pixels = PIXELS_BY_KIND[usize::from(gpu.info().kind != DeviceKind::Cpu)];
    let whole = scene.settings.clone();
    let scene = scene.with(|settings| shrink(settings, pixels));
    let sizes = [scene.settings.pixels(), whole.pixels()].map(|pixels| pixels as u64);
    let base = called_for(&scene, &scene.settings, Outputs::FILTERED);
    let usual = || Variant::new(args, &scene, &whole, Outputs::FILTERED, base);
    let first = usual()?.cost.compile_ms;
    let mut usual = usual()?;
    usual.cost.compile_ms = usual.cost.compile_ms.min(first);
    let (stages, all) = (Stages::new(false), rows.len() as u64);
    for (row, done) in rows.iter_mut().zip(0..) {
        stages.set("effects", done, all);
        let effect = Effect::ALL.iter().copied().find(|effect| effect.name() == row.effect);
        let then = effect.map_or(base, |effect| base.toggled(effect));
        let guides = effect.is_some();
        let outputs = Outputs { split_light: then.split_light, guides, counters: then.counters };
        let (usual, other, pairs) = beside(&mut usual, || Variant::new(args, &scene, &whole, outputs, then))?;
        let (with, without) = if row.on { (usual, other) } else { (other, usual) };
        row.bytes = Some(bytes_added(with, without, sizes) + effect.map_or(0, |effect| scene_bytes(effect, &scene)));
        // With and without it are different renders and not one picture at two costs; `tools/papers policies` compares them.
        if effect != Some(Effect::adaptive) {
            let added = |[usual, other]: [f64; 2]| if row.on { usual - other } else { other - usual };
            let Estimate { low, high, .. } = interval::median(&pairs.into_iter().map(added).collect::<Vec<_>>(), 0.95);
            [row.gpu_ms_with, row.gpu_ms_without] = [with, without].map(|cost| Some(cost.gpu_ms));
            row.gpu_ms_added = low.zip(high).map(<[f64; 2]>::from);
            row.compile_ms = Some((with.compile_ms - without.compile_ms).max(0.0));
        }
    }
    stages.finish();
    Ok(Sizes { timed_size: scene.settings.size(), film_size: whole.size() })
}

/// Bytes that buffers of the render take more, of a film of `whole` pixels, where films of `timed` pixels were measured.
fn bytes_added(with: Cost, without: Cost, [timed, whole]: [u64; 2]) -> u64 {
    let film = with.bytes.saturating_sub(without.bytes);
    // A buffer that is not needed has one element, so that some bytes are no matter of size.
    let per_pixel = (film + timed / 2) / timed;
    film + per_pixel * (whole - timed) + with.in_flight.saturating_sub(without.in_flight)
}

/// Times that each variant runs beside the usual one, at least and at most: where other programs use the machine, until its two
/// least times are [`ALIKE`]. Six differences are the fewest that give their median an interval of 95 %.
const RUNS: [usize; 2] = [6, 40];
/// Times that differ by less than this share.
const ALIKE: f64 = 0.02;
/// Pixels that are enough to compare costs: where processors render, a quarter of what fills a graphics card.
const PIXELS_BY_KIND: [f64; 2] = [16_384.0, 65_536.0];

/// Reduces the film to so many pixels with one sample each, since kernels are timed for every effect.
fn shrink(settings: &mut Settings, most: f64) {
    let scale = (most / settings.pixels() as f64).sqrt().min(1.0);
    let shrunk = |edge: u32| ((f64::from(edge) * scale) as u32).max(1);
    (settings.width, settings.height) = (shrunk(settings.width), shrunk(settings.height));
    settings.spp = 1;
    settings.allocate = Allocate { policy: settings.allocate.policy, ..Allocate::default() };
}

/// Measures a variant beside the usual one: both run in turn, so that changes in the machine's speed affect both, and the least times
/// count; all are returned in pairs. What seems to take longer to compile is compiled again, lest that be chance.
fn beside(usual: &mut Variant, other: impl Fn() -> Result<Variant>) -> Result<(Cost, Cost, Vec<[f64; 2]>)> {
    let mut found = other()?;
    if found.cost.compile_ms > usual.cost.compile_ms {
        let first = found.cost.compile_ms;
        found = other()?;
        found.cost.compile_ms = found.cost.compile_ms.min(first);
    }
    let mut pairs: Vec<[f64; 2]> = Vec::new();
    let two_least = |pairs: &[[f64; 2]], which: usize| {
        let mut ms: Vec<f64> = pairs.iter().map(|pair| pair[which]).collect();
        ms.sort_by(f64::total_cmp);
        [ms[0], ms[1]]
    };
    // One alone may be chance.
    let is_settled = |[least, next]: [f64; 2]| next - least <= ALIKE * least;
    let all_settled = |pairs: &[[f64; 2]]| [0, 1].into_iter().all(|which| is_settled(two_least(pairs, which)));
    while pairs.len() < RUNS[0] || pairs.len() < RUNS[1] && !all_settled(&pairs) {
        pairs.push([usual.run()?, found.run()?]);
    }
    [usual.cost.gpu_ms, found.cost.gpu_ms] = [0, 1].map(|which| two_least(&pairs, which)[0]);
    Ok((usual.cost, found.cost, pairs))
}

/// Bytes of the scene's records that only this effect reads. A new effect with records of its own needs an entry here.
fn scene_bytes(effect: Effect, scene: &Scene) -> u64 {
    let attributes = |bit: u32| {
        let records = scene.shading.iter().filter(|s| s.attributes & bit != 0).count();
        records * scene::attribute_words(bit) as usize * size_of::<u32>()
    };
    // Textures may share the texels of a picture.
    let pictures = |of: &dyn Fn(Effect) -> bool| -> BTreeSet<(u32, usize)> {
        let read = scene.materials.iter().flat_map(Material::textures).filter(|&(reader, _)| of(reader));
        let textures = read.map(|(_, index)| &scene.textures[index as usize]);
        textures.map(|t| (t.first, t.width as usize * t.height as usize)).collect()
    };
    let bytes = match effect {
        Effect::textures | Effect::bump_maps | Effect::normal_maps | Effect::coat_normals | Effect::alpha_masks => {
            let others = pictures(&|reader| reader != effect);
            let own = pictures(&|reader| reader == effect);
            own.difference(&others).map(|(_, texels)| texels * size_of::<u32>()).sum()
        }
        Effect::vertex_colors => attributes(ATTRIBUTE_COLORS),
        Effect::second_uv => attributes(ATTRIBUTE_SECOND_UV),
        Effect::tangents => attributes(ATTRIBUTE_TANGENTS),
        Effect::smooth_normals => size_of_val(&scene.shading[..]),
        Effect::instances => size_of_val(&scene.instances[..]),
        Effect::environment_map => {
            scene.environment.as_ref().map_or(0, |e| size_of_val(&e.texels[..]) + size_of_val(&e.table[..]))
        }
        Effect::emissive
        | Effect::point_lights
        | Effect::spot_lights
        | Effect::directional_lights
        | Effect::environment => {
            let lights = scene.lights.iter().filter(|light| light.effect() == Some(effect));
            lights.count() * (size_of::<Light>() + size_of::<AliasEntry>())
        }
        Effect::light_tree => size_of_val(&scene.light_nodes[..]),
        // Every texture has room for its modes, and every material for its cutoff and the parameters of all BSDFs; a sphere takes the
        // record of a triangle, and other effects take none.
        _ => 0,
    };
    bytes as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_those_of_what_no_other_effect_reads() {
        let texture = |first, width, height| Texture { first, width, height, ..Texture::default() };
        let maps = Material { opacity_texture: NONE, bump_texture: NONE, ..Material::default() };
        let [sphere, mirrored] = [LIGHT_SPHERE, LIGHT_MIRRORED].map(|kind| Light { kind, ..Light::default() });
        let mut scene = Scene {
            textures: vec![texture(0, 1 << 16, 1 << 16), texture(1, 2, 2), texture(5, 3, 1), texture(5, 3, 1)],
            materials: vec![Material { clearcoat_roughness_texture: 1, clearcoat_normal_texture: 2, ..maps }],
            lights: vec![sphere, mirrored],
            ..Scene::default()
        };
        assert_eq!(scene_bytes(Effect::textures, &scene), 4 * ((1 << 32) + 4));
        assert_eq!([Effect::coat_normals, Effect::alpha_masks].map(|e| scene_bytes(e, &scene)), [12, 0]);
        assert_eq!(scene_bytes(Effect::emissive, &scene), 2 * (size_of::<Light>() + size_of::<AliasEntry>()) as u64);
        scene.materials.push(Material { bump_texture: 3, clearcoat_normal_texture: NONE, ..maps });
        assert_eq!(scene_bytes(Effect::coat_normals, &scene), 0, "a bump map has the same texels");
    }
}
