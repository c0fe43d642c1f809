//! Runs the frames of a profile.
use super::Args;
use crate::cli::files::check_not_of_scene;
use crate::cli::progress::Stages;
use crate::cli::{fail_on_messages, render};
use crate::denoise::filter::{Method, Row};
use crate::error::{Error, Result};
use crate::gpu::PassTime;
use crate::profile::{Measured, Profile, Subject, measure};
use crate::render::settings::Settings;
use crate::report::trace::chrome_trace;
use crate::scene::Scene;

/// Frames that are timed unless a number is given.
const FRAMES: u16 = 20;

/// A profile, with what is told beside it.
pub struct Fresh {
    /// What its frames took.
    pub profile: Profile,
    /// Of its frames, where it is asked for.
    pub trace: Option<String>,
    /// What was repaired in the scene.
    pub warnings: Vec<String>,
}

/// The profile of a scene, to be compared with an old one if there is one.
///
/// # Errors
/// As a render of the scene; [`Error::Usage`] for an old profile of something else.
pub fn profile(args: &Args, old: Option<&Profile>) -> Result<Fresh> {
    args.denoise.map(row).transpose()?;
    let (file, settings) = args.choices.open_at_rest(&args.scene, &args.overrides)?;
    settings.validate()?;
    let denoise = args.denoise.filter(|method| method.changes(settings.indirect_stride));
    let filter = denoise.map(row).transpose()?;
    let scene = file.load()?.scene;
    let outputs: Vec<_> = args.outputs().map(|(option, path)| (option, path.to_owned())).collect();
    check_not_of_scene(&outputs, &scene)?;
    args.common.warnings().add(scene.warnings.clone());
    if let Some(old) = old {
        check_beside(old, &scene, &settings, filter)?;
    }
    let gpu = args.common.open(args.tracing.unwrap_or_default())?;
    render::check_room(denoise, &settings, &gpu)?;
    let count = usize::from(args.frames.unwrap_or(FRAMES));
    let (stages, mut frames) = (Stages::new(!args.common.talkative()), 0);
    let all = 2 * count as u64 + 1;
    stages.set("frames", frames, all);
    let mut frame_is_done = || {
        frames += 1;
        stages.set("frames", frames, all);
    };
    let measured = measure(&gpu, &scene, &settings, filter, count, &mut frame_is_done)?;
    stages.finish();
    fail_on_messages(&gpu)?;
    let denoise = filter.map(|row| row.name.to_owned());
    let profile = Profile { denoise, ..Profile::new(&gpu, &args.scene, &scene, &settings, &measured)? };
    Ok(Fresh { profile, trace: args.trace.is_some().then(|| trace(&measured)), warnings: scene.warnings })
}

/// Frames may run for long; what they cannot be compared with is told before.
fn check_beside(old: &Profile, scene: &Scene, settings: &Settings, filter: Option<&Row>) -> Result<()> {
    let scene_fingerprint = &scene.fingerprint(settings.size())?.to_string();
    Subject { settings, scene_fingerprint, denoise: filter.map(|row| row.name) }.check_beside(old)
}

/// The kernels of a filter.
fn row(method: Method) -> Result<&'static Row> {
    match method {
        Method::Kernels(row) => Ok(row),
        Method::Oidn => Err(Error::Usage("oidn has no passes to time: choose another filter".to_owned())),
    }
}

fn trace(measured: &Measured) -> String {
    let frames = &measured.frames;
    let host: Vec<PassTime> = frames.timed.iter().chain(&frames.untimed).map(|run| run.wall).collect();
    let passes: Vec<PassTime> = frames.timed.iter().flat_map(|run| &run.passes).map(|pass| pass.time).collect();
    chrome_trace(&host, &passes, measured.calibration)
}
