//! `tallow filter`: denoises an image file.
pub mod options;
mod supersampling;

use super::common::{Common, PngOptions};
use super::compare::{self, check_sizes};
use super::files::{Files, Item, check_distinct};
use super::{Exit, fail_on_messages, readable};
use crate::denoise::filter::firefly::Fireflies;
use crate::denoise::filter::{self, FilterSettings, Method};
use crate::denoise::{self, Colour, Demodulation, Filtered, Recipe, file};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, PassTime, Tracing};
use crate::image::aov::{Aov, Aovs, Plane, is_noisy};
use crate::image::metrics::{self, Metrics};
use crate::image::source::{Source, Unread};
use crate::image::{self, Claim, Film, NOISY, Picture};
use crate::layout::vec3;
use crate::memory;
use crate::report::table::{self, PassRow};
use options::{Layers, Overrides};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use supersampling::Supersampling;

/// Which light of an image is filtered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Light {
    /// All but lamps and sky that are seen directly.
    All,
    /// Indirect light, where the file holds it apart.
    Indirect,
}

/// Filter a noisy image, of this renderer or another
///
/// Takes albedo, normals, positions, depth and variance from the layers of an EXR file, as Tallow, Blender, Mitsuba 3,
/// pbrt-v4, V-Ray, Arnold, Octane and Unreal name them, and does without those that are missing. Surface colour is
/// divided out before and multiplied back after. In Tallow's own files the layer of direct light stays as it is: lamps and
/// sky that are seen, and the sharp shadows of the point, spot or directional light that a place chooses most often.
#[derive(clap::Args)]
pub struct Args {
    /// Image to filter (EXR; PNG, JPEG, HDR, TGA and BMP hold no layers)
    pub image: PathBuf,
    /// Filter to apply
    #[arg(long, default_value = "auto")]
    pub filter: Method,
    /// Image to write: .exr (all layers, the colour filtered), .png or .hdr; may be given several times
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    pub outputs: Vec<PathBuf>,
    /// Print how far the image is from this one, before and after
    #[arg(long, value_name = "FILE")]
    pub reference: Option<PathBuf>,
    /// Light to filter, where the file holds direct light apart (Tallow's own do) [default: all, but indirect where
    /// direct light holds no noise of lamps, sky, or a choice among lights]
    #[arg(long, value_enum, conflicts_with = "no_demodulate")]
    pub light: Option<Light>,
    /// Filter the colour as it is: textures blur too
    #[arg(long)]
    pub no_demodulate: bool,
    /// First cut pixels that are more than N times brighter than all but one around them, if one sample has brought
    /// their light as far as the image tells its variance, and say what that took away, or `off` [default: 8; off for
    /// none and oidn]
    #[arg(long, value_name = "N")]
    pub fireflies: Option<Fireflies>,
    /// The device, and what is printed.
    #[command(flatten)]
    pub common: Common,
    /// How .png files show radiance.
    #[command(flatten)]
    pub png: PngOptions,
    /// Names of the layers.
    #[command(flatten)]
    pub layers: Layers,
    /// Options of the lookup along eye rays.
    #[command(flatten)]
    pub supersampling: Supersampling,
    /// Settings of the filters.
    #[command(flatten)]
    pub overrides: Overrides,
}

/// The object that `--json` prints.
#[derive(Clone, Debug, Serialize)]
pub struct Summary {
    /// Files written; anything in their names that is not UTF-8 is replaced.
    pub files: Vec<String>,
    /// Name of the filter.
    pub filter: &'static str,
    /// Width of the stored image in pixels.
    pub width: u32,
    /// Height of the stored image in pixels.
    pub height: u32,
    /// Layers that were found or missing in the file, and how they were used.
    pub notes: Vec<String>,
    /// Wall time of filtering in seconds, without reading and writing.
    pub seconds: f64,
    /// Name of the device.
    pub device: String,
    /// GPU time by pass.
    pub passes: Vec<PassRow>,
    /// Metrics of the noisy image against the reference; `None` without `--reference` or if a pixel is NaN or infinite.
    pub before: Option<Metrics>,
    /// Metrics of the filtered image, in the same way.
    pub after: Option<Metrics>,
    /// What is odd in the options.
    pub warnings: Vec<String>,
}

/// Runs the subcommand.
///
/// # Errors
/// Errors of every kind. No file is written unless the error is about writing.
pub fn run(args: &Args) -> Result<Exit> {
    check_outputs(args)?;
    check_filter(args)?;
    let mut warnings = args.common.warnings();
    warnings.add_unread(args.overrides.given.given(), args.filter.name(), |option| args.filter.reads(option));
    let file = Unread::open(&args.image)?;
    let gpu = args.common.open(Tracing::Auto)?;
    check_room(args, &gpu, &file.claim)?;
    let source = file.decode()?;
    let aovs = aovs(args, &source)?;
    let reference = reference(args, &source)?;
    let start = Instant::now();
    let (colour, times, notes) = as_it_is(args, &aovs).map_or_else(|| filtered(args, &gpu, &aovs), Ok)?;
    let seconds = start.elapsed().as_secs_f64();
    let clean = Clean::new(args, &source, &aovs, colour)?;
    fail_on_messages(&gpu)?;
    let (written, files) = write(args, &clean);
    let noisy = reference.as_ref().map(|_| source.shown(noisy_layer(args, &source), &[])).transpose()?;
    let distance = |picture: &Option<Picture>| distance(picture.as_ref()?, reference.as_ref()?);
    let summary = Summary {
        files: written,
        filter: args.filter.name(),
        width: source.film.width,
        height: source.film.height,
        notes: [aovs.notes, notes].concat(),
        seconds,
        device: gpu.info().name.clone(),
        passes: table::summarise(&times),
        before: distance(&noisy),
        after: distance(&clean.shown),
        warnings: warnings.all().to_vec(),
    };
    args.common.report(&summary, || text(args, &summary))?;
    files.check()?;
    Ok(Exit::Done)
}

fn aovs<'a>(args: &Args, source: &'a Source) -> Result<Aovs<'a>> {
    let unnamed = args.layers.colour.is_none() && source.film.find(None).is_none();
    let remedy = if unnamed { "; name the layer to filter with --colour" } else { "" };
    let find = if asks_for_nothing(args) { Aovs::find_shown } else { Aovs::find };
    find(&source.film, &args.layers.names()).map_err(|what| Error::input(&args.image, what + remedy))
}

/// Whether nothing is to be filtered, cut or looked up.
fn asks_for_nothing(args: &Args) -> bool {
    let cuts = args.fireflies.is_some_and(|fireflies| fireflies != Fireflies::Off);
    args.filter.is_none() && !cuts && args.supersampling.scene.is_none()
}

/// The filter that made the colour, where that stays as it is.
fn earlier_filter<'a>(args: &Args, film: &'a Film) -> Option<&'a str> {
    let keeps = asks_for_nothing(args) && !args.layers.colour.as_deref().is_some_and(is_noisy);
    film.metadata.get(image::FILTERED).filter(|_| keeps).map(String::as_str)
}

/// Whether no pixel of the colour is another one than before: none was filtered or cut, and none that holds no number filled in.
fn is_as_before(args: &Args, aovs: &Aovs, colour: &Colour) -> bool {
    let is_same = |stored: Plane| (0..aovs.film.pixels()).all(|i| stored.at(i) == colour.each_ref().map(|c| c[i]));
    args.filter.is_none() && aovs.get(Aov::Colour).is_some_and(is_same)
}

/// What [`filtered`] returns where the colour stays as it is. Indirect light that was not traced for every pixel is filled in, once.
fn as_it_is(args: &Args, aovs: &Aovs) -> Option<(Colour, Vec<PassTime>, Vec<String>)> {
    let layers = asks_for_nothing(args).then(|| file::Layers::new(aovs))?;
    let whole = layers.holds().indirect_stride == 1 || earlier_filter(args, aovs.film).is_some();
    let note = vec!["filtered: nothing, the colour stays as it is".to_owned()];
    whole.then(|| (layers.colour(), Vec::new(), [note, layers.notes].concat()))
}

/// Bytes of host memory that filtering takes besides the file itself: the file's channels and the filtered colour, and then
/// whichever is larger of two. While the image is filtered, these are the device's planes, if the device has no memory of its
/// own. While the colour is put into the file, these are three copies of the file with the colour added: encoded as EXR if it is
/// none, decoded, and encoded again.
fn bytes_needed(args: &Args, claim: &Claim, unified: bool) -> u64 {
    let colour = claim.pixels().saturating_mul(size_of::<vec3>() as u64);
    let planes = if unified { claim.pixels().saturating_mul(denoise::bytes_per_pixel(args.filter)) } else { 0 };
    let decoded = claim.bytes.saturating_add(colour);
    let filtering = planes.saturating_add(claim.pixels().saturating_mul(args.filter.host_bytes()));
    decoded.saturating_add(filtering.max(decoded.saturating_mul(3)))
}

/// Checks before decoding, which can take minutes, that the image can be filtered.
fn check_room(args: &Args, gpu: &Gpu, claim: &Claim) -> Result<()> {
    if !asks_for_nothing(args) {
        filter::check_size(gpu, claim.size)?;
    }
    let bytes = bytes_needed(args, claim, gpu.info().unified);
    let refused =
        |what| format!("{}: filtering its {} x {} pixels {what}", args.image.display(), claim.size[0], claim.size[1]);
    memory::check_beside_driver(bytes).map_err(|what| Error::Memory(refused(what)))
}

/// Checks the paths of the outputs. They may include the image itself.
fn check_outputs(args: &Args) -> Result<()> {
    args.outputs.iter().try_for_each(|path| image::check_writable(path))?;
    let outputs: Vec<_> = args.outputs.iter().map(|path| ("-o", path.as_path())).collect();
    let reference = args.reference.iter().map(|path| ("--reference", path.as_path()));
    let scene = args.supersampling.scene.iter().map(|path| ("--scene", path.as_path()));
    check_distinct(&outputs, &reference.chain(scene).collect::<Vec<_>>())
}

/// Checks that the filter can run, and is one for what is asked of it.
fn check_filter(args: &Args) -> Result<()> {
    if args.light == Some(Light::All) && args.supersampling.scene.is_some() {
        return Err(Error::Usage("--scene looks filtered indirect light up: leave --light all out".to_owned()));
    }
    if matches!(args.filter, Method::Oidn) && args.supersampling.scene.is_some() {
        let what =
            "--scene looks filtered indirect light up, but oidn filters the colour whole: choose another --filter";
        return Err(Error::Usage(what.to_owned()));
    }
    if matches!(args.filter, Method::Oidn) && args.light.is_some() {
        return Err(Error::Usage("--light is for filters of Tallow's own: oidn filters the colour whole".to_owned()));
    }
    args.filter.check()
}

/// What is left to write: only what the outputs and the reference call for.
struct Clean {
    /// The file with the filtered colour.
    exr: Option<Vec<u8>>,
    /// The filtered colour, where it is shown.
    shown: Option<Picture>,
}

impl Clean {
    /// Puts the filtered colour into the file and keeps the noisy one as a layer. A single grey channel gets the mean of the
    /// three, or what they are where they are equal, since a mean rounds. A colour that is as before is not called filtered, and has no noisy one beside it.
    fn new(args: &Args, source: &Source, aovs: &Aovs, mut colour: Colour) -> Result<Self> {
        let filter = (!is_as_before(args, aovs, &colour)).then_some(args.filter.name());
        let keep_as = filter.and_then(|_| aovs.keep_as());
        let entry = (image::FILTERED, earlier_filter(args, &source.film).or(filter));
        if aovs.colour[0] == aovs.colour[1] {
            let [r, g, b] = &colour;
            let mean = |r: f32, g: f32, b: f32| if [r, r] == [g, b] { r } else { (r + g + b) / 3.0 };
            let grey: Vec<f32> = r.iter().zip(g).zip(b).map(|((r, g), b)| mean(*r, *g, *b)).collect();
            colour = [0; 3].map(|_| grey.clone());
        }
        let channels: Vec<_> = aovs.colour.into_iter().zip(colour.iter().map(Vec::as_slice)).collect();
        let has_layers = |path: &PathBuf| image::has_layers(path);
        let whole = args.outputs.iter().any(has_layers);
        let shown = args.reference.is_some() || !args.outputs.iter().all(has_layers);
        let encoded = || source.encoded(&channels, keep_as, entry);
        Ok(Self {
            exr: whole.then(encoded).transpose()?,
            shown: shown.then(|| source.shown(result_layer(args), &channels)).transpose()?,
        })
    }
}

fn write<'a>(args: &'a Args, clean: &'a Clean) -> (Vec<String>, Files) {
    let film = clean.shown.as_ref().map(Film::from).unwrap_or_default();
    let item = |path: &'a PathBuf| match &clean.exr {
        Some(exr) if image::has_layers(path) => {
            Item { path: path.clone(), fill: Box::new(move |stream| stream.write_all(exr)) }
        }
        _ => Item::image(path.clone(), &film, args.png.write_options()),
    };
    let items: Vec<_> = args.outputs.iter().map(item).collect();
    let mut files = Files::default();
    let mut written = files.save(&items, true);
    written.extend(files.pipe(&items, true));
    files.end();
    (written.iter().map(|path| path.display().to_string()).collect(), files)
}

fn demodulation(args: &Args) -> Option<Demodulation> {
    let looked_up = args.supersampling.scene.is_some();
    match args.light {
        _ if args.no_demodulate => Some(Demodulation::Off),
        Some(Light::All) => Some(Demodulation::Albedo),
        Some(Light::Indirect) => Some(Demodulation::Light),
        None => looked_up.then_some(Demodulation::Light),
    }
}

fn filtered(args: &Args, gpu: &Gpu, aovs: &Aovs) -> Result<(Colour, Vec<PassTime>, Vec<String>)> {
    let layers = file::Layers::new(aovs);
    let whole = args.no_demodulate || args.light == Some(Light::All);
    if whole && layers.holds().indirect_stride > 1 {
        let option = if args.no_demodulate { "--no-demodulate" } else { "--light all" };
        let what = "what is filtered is light that not every pixel has (indirect_stride)";
        return Err(Error::Usage(format!("leave out {option}: {what}")));
    }
    let recipe = Recipe {
        method: args.filter,
        demodulation: demodulation(args),
        looked_up: args.supersampling.scene.is_some(),
        fireflies: args.fireflies.unwrap_or_default(),
        settings: &|scales| args.overrides.settings(FilterSettings::default().scaled_by(scales)),
    };
    let filtered = Filtered::new(gpu, layers.upload(gpu)?, &recipe)?;
    let mut notes = vec![recipe.demodulation(layers.holds()).note().to_owned()];
    notes.extend(layers.notes);
    if filtered.in_painted {
        notes.push("direct light of pixels without a sample is made of that of the others".to_owned());
    }
    let clean = match args.supersampling.look_up(gpu, &args.image, aovs, &filtered)? {
        Some((indirect, more)) => filtered.join_reflected(&indirect, more)?,
        None => filtered.join(gpu)?,
    };
    notes.extend(clean.notes());
    notes.extend(denoise::note_of_lost_light(aovs, &clean.colour));
    Ok((clean.colour, clean.times, notes))
}

/// Reads the reference, before any long work, and checks that it has the size of the image.
fn reference(args: &Args, source: &Source) -> Result<Option<Picture>> {
    let Some(path) = &args.reference else { return Ok(None) };
    let reference = compare::load(path, None, "save its colour as R, G, B")?;
    check_sizes((&args.image, source.shown_size()?), (path, reference.size()))?;
    Ok(Some(reference))
}

/// The layer that is filtered; none for the colour.
fn noisy_layer<'a>(args: &'a Args, image: &Source) -> Option<&'a str> {
    args.layers.colour.as_deref().or_else(|| image.film.find(Some(NOISY)).map(|_| NOISY))
}

/// The layer that holds the result; none for the colour.
fn result_layer(args: &Args) -> Option<&str> {
    args.layers.colour.as_deref().filter(|name| !is_noisy(name))
}

/// `None` for a picture that is not finite.
fn distance(picture: &Picture, reference: &Picture) -> Option<Metrics> {
    (picture.non_finite() == 0).then(|| metrics::compare(picture, reference))
}

fn text(args: &Args, s: &Summary) -> String {
    let mut text = s.notes.iter().map(|note| readable(note) + "\n").collect::<String>();
    text += &format!("{} x {}, {} in {:.3} s on {}\n", s.width, s.height, s.filter, s.seconds, s.device);
    if !s.passes.is_empty() {
        text += &table::timing_table(&s.passes);
    }
    if args.reference.is_some() {
        text += &metrics_table(&s.before, &s.after);
    }
    text
}

/// Formats the metrics before and after, with dashes for an image that is not finite.
fn metrics_table(before: &Option<Metrics>, after: &Option<Metrics>) -> String {
    let column = |m: &Option<Metrics>| m.as_ref().map(compare::values);
    let (before, after) = (column(before), column(after));
    let cell = |column: &Option<[String; 5]>, i: usize| {
        column.as_ref().map_or("- (not finite)".to_owned(), |rows| rows[i].clone())
    };
    let row = |i: usize| vec![compare::NAMES[i].to_owned(), cell(&before, i), cell(&after, i)];
    table::text(&["metric", "before", "after"], &(0..compare::NAMES.len()).map(row).collect::<Vec<_>>())
}
