//! `--time`, `--error` and `--plan`: a render whose samples and filter are planned, or were planned by an earlier one.
use super::Args;
use crate::cli::files::Item;
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::image::input;
use crate::plan::{self, Plan, Target};
use crate::render::settings::Settings;
use crate::scene::Scene;
use std::path::Path;
use std::time::Duration;

/// Bytes of memory that a byte of a plan takes at most while it is read.
const BYTES_OF_JSON: u64 = 64;

/// Parses a time such as `200ms`, `2s` or `1m 30s`.
pub fn duration(text: &str) -> std::result::Result<Duration, String> {
    match humantime::parse_duration(text) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => Err("expected a time above 0 with its unit, such as 200ms, 2s or \"1m 30s\"".to_owned()),
    }
}

fn target(args: &Args) -> Option<Target> {
    let time = args.time.map(|time| Target::GpuMs(time.as_secs_f64() * 1e3));
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
    plan.check_scene(scene)?;
    let mut settings = plan.settings.clone();
    args.overrides.apply(&mut settings);
    let other = settings != plan.settings || args.denoise.is_some();
    match other {
        true => {
            Err(Error::Usage("the plan says all settings and the filter: leave out options that say others".to_owned()))
        }
        false => Ok(settings),
    }
}

/// Plans what is asked for, if something is.
///
/// # Errors
/// Those of [`plan::plan`].
pub fn make(args: &Args, gpu: &Gpu, scene: &Scene, settings: &Settings) -> Result<Option<Plan>> {
    let Some(target) = target(args) else { return Ok(None) };
    let methods = args.denoise.map_or_else(plan::usual_methods, |method| vec![method]);
    plan::plan(gpu, scene, settings, &methods, target).map(Some)
}

/// The options and settings of the render that a plan asks for.
///
/// # Errors
/// [`Error::Usage`] for a filter that is not known.
pub fn applied(args: &Args, settings: Settings, plan: Option<&Plan>) -> Result<(Args, Settings)> {
    let Some(plan) = plan else { return Ok((args.clone(), settings)) };
    Ok((Args { denoise: plan.method()?, ..args.clone() }, plan.settings.clone()))
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

    #[test]
    fn times_have_units() {
        assert_eq!(duration("200ms"), Ok(Duration::from_millis(200)));
        assert_eq!(duration("1m 30s"), Ok(Duration::from_secs(90)));
        for wrong in ["", "0s", "5", "-1s", "fast"] {
            assert!(duration(wrong).unwrap_err().contains("200ms"), "{wrong}");
        }
    }
}
