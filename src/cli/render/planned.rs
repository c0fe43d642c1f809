//! `--time`, `--error` and `--plan`: a render whose samples and filter are planned, or were planned by an earlier one.
use super::{Args, check_room};
use crate::cli::common::Warnings;
use crate::cli::files::Item;
use crate::cli::interrupt;
use crate::denoise::filter::Method;
use crate::error::{Checked, Error, Result};
use crate::gpu::{Gpu, milliseconds};
use crate::image::input::{self, BYTES_OF_JSON};
use crate::plan::{self, Plan, Target};
use crate::render::settings::Settings;
use crate::scene::Scene;
use crate::settings::entry;
use std::path::Path;
use std::time::Duration;

/// Parses a time such as `200ms`, `2s` or `1m 30s`.
pub fn duration(text: &str) -> Checked<Duration> {
    match humantime::parse_duration(text) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => Err("expected a time above 0 with its unit, such as 200ms, 2s or \"1m 30s\"".to_owned()),
    }
}

fn target(args: &Args) -> Option<Target> {
    let time = args.time.map(|time| Target::GpuMs(milliseconds(time)));
    time.or(args.error.map(Target::RelMse))
}

/// Whether this run makes the plan, by a probe.
pub fn is_made(args: &Args) -> bool {
    target(args).is_some()
}

/// Where the plan goes that this run makes.
pub fn to_write(args: &Args) -> Option<&Path> {
    args.plan.as_deref().filter(|_| is_made(args))
}

/// The plan that is to be followed, if one is.
///
/// # Errors
/// [`Error::Input`] for a file that is no plan, or one of another version.
pub fn read(args: &Args) -> Result<Option<Plan>> {
    let Some(path) = args.plan.as_deref().filter(|_| !is_made(args)) else { return Ok(None) };
    let text = input::read_text(path, BYTES_OF_JSON)?;
    let wrong = |what: String| Error::input(path, what);
    let text = String::from_utf8(text).map_err(|_| wrong("is no text, and no plan".to_owned()))?;
    Plan::parse(&text).map(Some).map_err(|e| wrong(e.to_string()))
}

/// The settings of a plan that is followed.
///
/// # Errors
/// [`Error::Usage`] for options that ask for something else, and for a plan of another scene.
pub fn settings(args: &Args, plan: &Plan, scene: &Scene) -> Result<Settings> {
    let file = args.plan.as_deref().unwrap_or(Path::new("--plan")).display();
    plan.check_scene(scene).map_err(|e| Error::Usage(format!("{file}: {e}")))?;
    let mut settings = plan.settings.clone();
    args.overrides.apply(&mut settings);
    let other = settings != plan.settings || args.denoise.is_some();
    if other {
        let what = "the plan says all settings and the filter: leave out options that say others";
        return Err(Error::Usage(what.to_owned()));
    }
    Ok(settings)
}

/// Plans what is asked for, if something is.
///
/// # Errors
/// Those of [`check_room`] and [`plan::plan`].
pub fn make(
    args: &Args,
    gpu: &Gpu,
    scene: &Scene,
    settings: &Settings,
    warnings: &mut Warnings,
) -> Result<Option<Plan>> {
    let Some(target) = target(args) else { return Ok(None) };
    check_room(args.filter(settings), settings, gpu)?;
    interrupt::leave_at_once("interrupted while the render was planned: nothing was rendered, and nothing written");
    let methods = args.denoise.map_or_else(|| fitting(gpu, settings, warnings), |method| vec![method]);
    let plan = plan::plan(gpu, scene, settings, args.wanted(), &methods, target)?;
    interrupt::leave_at_once("interrupted: nothing was written");
    Ok(Some(plan))
}

/// What a plan may choose among that names no filter, less what this film has no room for, which is said.
fn fitting(gpu: &Gpu, settings: &Settings, warnings: &mut Warnings) -> Vec<Method> {
    let mut methods = plan::usual_methods();
    methods.retain(|method| match check_room(Some(*method), settings, gpu) {
        Err(why) if !method.is_none() => {
            warnings.add([format!("the plan leaves out {}: {why}", method.name())]);
            false
        }
        _ => true,
    });
    methods
}

/// The options and settings of the render that a plan asks for.
///
/// # Errors
/// [`Error::Usage`] for a filter that is not known.
pub fn applied(args: &Args, settings: Settings, plan: Option<&Plan>) -> Result<(Args, Settings)> {
    let Some(plan) = plan else { return Ok((args.clone(), settings)) };
    Ok((Args { denoise: plan.method()?, ..args.clone() }, plan.settings.clone()))
}

/// What a render goes on with that followed a plan: the plan's filter, and its settings where others were asked for.
pub fn instead(plan: &Plan, asked: &Settings) -> String {
    let settings = entry::options(&asked.entries(), &plan.settings.entries());
    let filter = plan.chosen.denoise.as_ref().map_or_else(String::new, |filter| format!(" --denoise {filter}"));
    format!("{settings}{filter} in place of --time, --error and --plan")
}

/// The plan's file.
///
/// # Errors
/// Those of [`Plan::text`].
pub fn item(args: &Args, plan: Option<&Plan>) -> Result<Option<Item<'static>>> {
    let Some((path, plan)) = to_write(args).zip(plan) else { return Ok(None) };
    Ok(Some(Item::bytes(path.to_owned(), plan.text()?.into_bytes())))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{DeviceOptions, Tuning};
    use crate::plan::Expected;
    use clap::Parser;

    /// The scene's own film is another one, and its samples are even.
    #[test]
    fn what_was_planned_goes_on_by_options() {
        let asked = Settings { width: 512, ..Settings::default() };
        let chosen = Expected { denoise: Some("auto".to_owned()), spp: 37, gpu_ms: 1.0, relmse: 0.1 };
        let plan = Plan {
            version: 1,
            target: Target::GpuMs(1.0),
            scene: String::new(),
            device: String::new(),
            settings: Settings { width: 33, spp: 37, ..asked.clone() },
            chosen,
            others: Vec::new(),
            probe_ms: 1.0,
        };
        assert_eq!(
            instead(&plan, &asked),
            " --width 33 --spp 37 --denoise auto in place of --time, --error and --plan"
        );
    }

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn what_a_film_is_too_large_for_is_no_part_of_a_plan() {
        let tuning = Some(Tuning { longest_edge: 64, ..Tuning::CPU });
        let gpu = Gpu::open(&DeviceOptions { tuning, ..DeviceOptions::default() }).unwrap();
        let of_width = |width| Settings { width, height: 1, ..Settings::default() };
        let args = |words: &[&str]| Command::parse_from([&["render", "scene.toml", "--quiet"], words].concat()).args;
        let of_film = |width| {
            let mut warnings = args(&["--time", "1s"]).common.warnings();
            let methods = fitting(&gpu, &of_width(width), &mut warnings);
            (methods.into_iter().map(Method::name).collect::<Vec<_>>(), warnings.all().to_vec())
        };
        assert_eq!(of_film(64), (vec!["none", "auto"], vec![]));
        let (named, warnings) = of_film(65);
        assert_eq!((named, warnings.len()), (vec!["none"], 1));
        assert!(warnings[0].starts_with("the plan leaves out auto: "), "{warnings:?}");
        let fits = |name: &str, settings: Settings| {
            check_room(args(&["--denoise", name]).filter(&settings), &settings, &gpu).is_ok()
        };
        assert!(fits("auto", of_width(64)) && !fits("auto", of_width(65)) && fits("none", of_width(65)));
        assert!(!fits("none", Settings { indirect_stride: 2, ..of_width(65) }), "it is filled in");
    }

    #[test]
    fn times_have_units() {
        assert_eq!(duration("200ms"), Ok(Duration::from_millis(200)));
        assert_eq!(duration("1m 30s"), Ok(Duration::from_secs(90)));
        for wrong in ["", "0s", "5", "-1s", "fast"] {
            assert!(duration(wrong).unwrap_err().contains("200ms"), "{wrong}");
        }
    }
}
