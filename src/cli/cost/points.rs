//! The points that `tallow cost` measures: the scene, how it moves, the settings of each point, and the command that renders it.
use super::options::Words;
use super::{Args, knobs};
use crate::cost::grid::{self, Candidate};
use crate::cost::{JudgedFrame, Motion};
use crate::denoise::filter::{FilterSettings, Method};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::render::settings::Settings;
use crate::render::{Reproject, Reprojection, can_carry};
use crate::scene::animation::Animation;
use crate::scene::{Loaded, Scene};
use crate::settings::entry::{self, Value};
use std::collections::BTreeSet;
use std::path::Path;

/// What is measured.
pub struct Points {
    /// How the scene moves; `None` at rest.
    pub motion: Option<Motion>,
    /// Its settings with those of the options.
    pub base: Settings,
    /// The points.
    pub candidates: Vec<Candidate>,
    /// What was left out of them, and why.
    pub notes: Vec<String>,
}

impl Points {
    /// Loads a scene, in the pose of the frame that is judged if it moves, and makes its points.
    ///
    /// # Errors
    /// Of scene and options.
    pub fn new(args: &Args, path: &Path, gpu: &Gpu) -> Result<(Scene, Self)> {
        let mut file = args.choices.open(path)?;
        file.stays_still();
        let (mut base, mut filters, mut carries) = (file.settings()?, FilterSettings::default(), Reproject::default());
        args.film.apply(&mut base);
        Words::parse(&args.with)?.apply(&mut base, &mut filters, &mut carries);
        base.validate()?;
        filters.validate()?;
        entry::check(&carries.entries())?;
        let Loaded { mut scene, animation, .. } = file.load()?;
        let motion = motion(args, animation)?;
        motion.iter().try_for_each(|motion| motion.pose(&mut scene, motion.judged.frame).map(|_| ()))?;
        let able = motion.as_ref().map(|_| can_carry(gpu, &scene, &base));
        let of = |way| (way != Reprojection::Off).then_some(Reproject { reproject: way, ..carries });
        let axes = args.axes(reproject(args, able)?.into_iter().map(of).collect());
        let mut candidates = grid::grid(&base, &filters, &axes);
        candidates.iter().try_for_each(|candidate| candidate.settings.validate())?;
        candidates.iter().try_for_each(|candidate| candidate.settings.check_most())?;
        candidates.iter().try_for_each(Candidate::check_stride)?;
        let mut notes = Vec::new();
        candidates.extend(varied(args, &candidates, &mut notes)?);
        // A variant may be a step of a knob, or given twice.
        let mut known = BTreeSet::new();
        candidates.retain(|candidate| known.insert(candidate.method.clone()));
        Ok((scene, Self { motion, base, candidates, notes }))
    }
}

/// How a scene moves that is not at rest.
fn motion(args: &Args, animation: Animation) -> Result<Option<Motion>> {
    let asked = args.frame.is_some() || args.reproject.iter().any(|way| *way != Reprojection::Off);
    match (animation.is_empty(), asked) {
        (true, true) => Err(Error::Usage("nothing moves in the scene: leave out --frame and --reproject".to_owned())),
        (true, false) => Ok(None),
        (false, _) => {
            // The first with a whole history.
            let judged = JudgedFrame { frame: args.frame.unwrap_or(JudgedFrame::BEFORE), fps: args.fps };
            Ok(Some(Motion { judged, animation }))
        }
    }
}

/// How samples are carried, in the order of the list; `able` says of a scene that moves whether they can be.
fn reproject(args: &Args, able: Option<Result<()>>) -> Result<Vec<Reprojection>> {
    use Reprojection::{Forward, Off};
    match able {
        Some(able) if args.reproject.iter().any(|way| *way != Off) => able.map(|()| args.reproject.clone()),
        Some(Ok(())) if args.reproject.is_empty() && args.ablate => Ok(vec![Forward]),
        Some(Ok(())) if args.reproject.is_empty() => Ok(vec![Off, Forward]),
        _ => Ok(vec![Off]),
    }
}

/// Each point of the grid with the options of every variant that it reads, and with every step of the knobs that it has.
fn varied(args: &Args, grid: &[Candidate], notes: &mut Vec<String>) -> Result<Vec<Candidate>> {
    let with = |point: &Candidate, option: &str, words: &Words| {
        point.varied(option, |settings, filters, carries| words.apply(settings, filters, carries))
    };
    let mut all = Vec::new();
    for text in &args.variants {
        let words = Words::parse(text)?.checked_as_variant(text)?;
        let reading = |point| with(point, text.trim(), &words).filter(|varied| knobs::reads_change(point, varied));
        let variants: Vec<Candidate> = grid.iter().filter_map(reading).collect();
        if variants.is_empty() {
            return Err(Error::Usage(format!("\"{}\" changes no point of the grid", text.trim())));
        }
        all.extend(possible(variants, notes)?);
    }
    for point in grid.iter().filter(|_| args.ablate) {
        for step in knobs::steps(point) {
            let varied = with(point, &step, &Words::parse(&step)?);
            all.extend(varied.filter(|varied| varied.settings.validate().is_ok()));
        }
    }
    Ok(all)
}

/// Those of some variants that make an image of the whole light, and a note for each method whose do not.
fn possible(variants: Vec<Candidate>, notes: &mut Vec<String>) -> Result<Vec<Candidate>> {
    let (able, unable): (Vec<_>, Vec<_>) = variants.into_iter().partition(|variant| variant.check_stride().is_ok());
    if able.is_empty() {
        unable.iter().try_for_each(Candidate::check_stride)?;
    }
    let why =
        |variant: &Candidate| Some(format!("left out {}: {}", variant.method.name(), variant.check_stride().err()?));
    notes.extend(unable.iter().filter_map(why));
    notes.dedup();
    Ok(able)
}

/// The command that renders a point's first image of `scene`, which are words for a shell. Unfiltered points go to .hdr: for an .exr more
/// layers are kept, which takes longer than what was measured. `device` is the option that chooses it, if any. Filters
/// with settings of their own run behind the render, to the same bits.
pub fn command(
    scene: &str,
    judged: Option<JudgedFrame>,
    from: &Settings,
    candidate: &Candidate,
    ray_queries: bool,
    device: &str,
) -> String {
    let tracing = if ray_queries { " --tracing ray-query" } else { "" };
    let settings = entry::options(&from.entries(), &candidate.settings.entries()) + tracing + device;
    let (render, number) = match judged {
        None => (format!("tallow render {scene}{settings}"), String::new()),
        Some(judged) => {
            let how = candidate.carries;
            let first = if how.is_some() { judged.first(true) } else { judged.frame };
            let frames = format!("--frames 0..={0} --only {first}..={0} --fps {1}", judged.frame, judged.fps);
            let options = |how: Reproject| {
                let from = Reproject { reproject: how.reproject, ..Reproject::default() };
                format!("{}{}", how.reproject.text(), entry::options(&from.entries(), &how.entries()))
            };
            let reproject = format!(" --reproject {}", how.map_or("off".to_owned(), options));
            (format!("tallow sequence {scene}{settings} {frames}{reproject}"), format!(".{:04}", judged.frame))
        }
    };
    let out = |name: &str| format!("{name}{}", if number.is_empty() { "" } else { ".####" });
    let Some(filter) = candidate.filter.map(Method::name) else { return format!("{render} -o {}.hdr", out("point")) };
    match &entry::options(&FilterSettings::default().entries(), &candidate.filter_settings.entries())[..] {
        "" => format!("{render} --denoise {filter} -o {}.exr", out("point")),
        own => format!(
            "{render} -o {}.exr && tallow filter noisy{number}.exr --filter {filter}{own}{device} -o point{number}.exr",
            out("noisy")
        ),
    }
}
