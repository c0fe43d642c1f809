//! What to render for a time or an error that is given: samples per pixel, and whether to filter, planned from a short probe of this
//! scene on this device.
//!
//! ```text
//! probe: two independent images of m samples a pixel, of 4 m, of 16 m ...   error and GPU time of each, filtered and not;
//!        where samples are placed and a time is given, the render that seems to fit as well
//! plan:  error ~ samples^-p between levels and behind them,                 the method that is cheapest, or most accurate
//!        time = fixed + samples * t
//! ```
//!
//! [`FramePacer`] is the other planner: it keeps the frames of an engine near a time, from one frame to the next.
mod forecast;
mod halves;
mod pacer;
mod probe;

pub use pacer::FramePacer;

use crate::allocate::Placing;
use crate::denoise::filter::{self, Method};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::own_json::OwnJson;
use crate::render::Outputs;
use crate::render::settings::Settings;
use crate::scene::Scene;
use forecast::Forecast;
use probe::{Level, Probe};
use serde::{Deserialize, Serialize};

/// Share of the planned time by which a render may be off before that is told.
const MISS: f64 = 0.25;

/// Version of a plan's file.
const VERSION: u32 = 1;

/// What a render may take, or how good it is to be.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// GPU time of the render and its filter in milliseconds, above 0. Kernels that a driver compiles at their first use are not
    /// part of it.
    GpuMs(f64),
    /// The image's relMSE (mean of squared errors over the squared radiance plus 0.01), above 0.
    RelMse(f64),
}

impl Target {
    fn check(self) -> Result<()> {
        let (value, article, name) = match self {
            Self::GpuMs(ms) => (ms, "a", "time"),
            Self::RelMse(error) => (error, "an", "error"),
        };
        match value.is_finite() && value > 0.0 {
            true => Ok(()),
            false => Err(Error::Usage(format!("{article} {name} of {value}: give a finite number above 0"))),
        }
    }
}

/// A method, the samples that it would take, and what is expected of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// The filter; none without.
    pub denoise: Option<String>,
    /// Samples per pixel.
    pub spp: u32,
    /// GPU time in milliseconds.
    pub gpu_ms: f64,
    /// RelMSE of the image.
    pub relmse: f64,
}

/// What is to be rendered, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Of this format.
    pub version: u32,
    /// What was asked for.
    pub target: Target,
    /// [`Scene::fingerprint`] of the scene.
    pub scene: String,
    /// Device that the probe ran on.
    pub device: String,
    /// All settings of the render.
    pub settings: Settings,
    /// What was chosen.
    pub chosen: Expected,
    /// The other methods that could have been.
    pub others: Vec<Expected>,
    /// GPU time that the probe took in milliseconds.
    pub probe_ms: f64,
}

/// Plans a render of `scene` with `settings`, whose samples per pixel are what is looked for, and which keeps `outputs`: what a filter
/// reads is added to them. `methods` are the filters to choose among, [`filter::find`] of `none` standing for no filter.
///
/// # Errors
/// [`Error::Usage`] for a target out of range or out of reach, for settings with a noise threshold or with a largest number of samples
/// that their policy does not place by, and for an empty list of methods; [`Error::Device`], before anything is rendered for a film that
/// is too large for one of the filters.
pub fn plan(
    gpu: &Gpu,
    scene: &Scene,
    settings: &Settings,
    outputs: Outputs,
    methods: &[Method],
    target: Target,
) -> Result<Plan> {
    check(settings, methods, target)?;
    let size = settings.size();
    let filters = !methods.iter().all(|method| method.is_none());
    if filters {
        filter::check_size(gpu, size)?;
    }
    let mut probe = Probe::new(gpu, scene, settings, outputs.or(Outputs::for_filter(filters)), methods)?;
    let levels = probe.levels(target)?;
    let mut forecasts = forecasts(&levels, methods, most_samples(settings));
    if let Target::GpuMs(ms) = target
        && !settings.allocate.is_even()
    {
        // Placed samples cost more than the few of a probe foretell.
        let most = forecasts.iter().filter_map(|forecast| forecast.samples_within(ms)).max();
        if let Some(spp) = most {
            let took = probe.rehearse(spp)?;
            forecasts.iter_mut().for_each(|forecast| *forecast = forecast.through(spp, took));
        }
    }
    let expected = |forecast: &Forecast| match target {
        Target::GpuMs(ms) => forecast.samples_within(ms),
        Target::RelMse(error) => forecast.samples_for(error),
    };
    let considered = methods.iter().zip(&forecasts).filter_map(|(method, forecast)| {
        let spp = expected(forecast)?;
        let denoise = (!method.is_none()).then(|| method.name().to_owned());
        Some(Expected { denoise, spp, gpu_ms: forecast.time_of(spp), relmse: forecast.error_of(spp) })
    });
    let mut considered = by_cost(target, considered.collect());
    if considered.is_empty() {
        return Err(out_of_reach(target, &forecasts, most_samples(settings)));
    }
    let chosen = considered.remove(0);
    Ok(Plan {
        version: VERSION,
        target,
        scene: scene.fingerprint(size)?.to_string(),
        device: gpu.info().name.clone(),
        settings: Settings { spp: chosen.spp, ..settings.clone() },
        chosen,
        others: considered,
        probe_ms: probe.spent_ms,
    })
}

/// The best first: of those that take as long the one with the least error, of those with one error the fastest.
fn by_cost(target: Target, mut considered: Vec<Expected>) -> Vec<Expected> {
    let cost = |e: &Expected| match target {
        Target::GpuMs(_) => e.relmse,
        Target::RelMse(_) => e.gpu_ms,
    };
    considered.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
    considered
}

fn check(settings: &Settings, methods: &[Method], target: Target) -> Result<()> {
    target.check()?;
    if settings.allocate.has_threshold() {
        let what = "a noise threshold ends a render by itself: give it, or a time or an error";
        return Err(Error::Usage(what.to_owned()));
    }
    if settings.allocate.is_even() && settings.allocate.max_spp > 0 {
        let what = "the samples of a policy that spreads them evenly are what is planned: leave out max_spp, or choose another policy";
        return Err(Error::Usage(what.to_owned()));
    }
    if methods.is_empty() {
        return Err(Error::Usage("no method to choose among: name a filter, or none".to_owned()));
    }
    if settings.indirect_stride > 1 {
        let what =
            "the error of pixels that are filled in cannot be planned: set indirect_stride to 1, or give the samples";
        return Err(Error::Usage(what.to_owned()));
    }
    settings.validate()
}

/// By method, of renders that have at most so many samples per pixel.
fn forecasts(levels: &[Level], methods: &[Method], most: u32) -> Vec<Forecast> {
    (0..methods.len()).map(|method| Forecast::new(levels, method, most)).collect()
}

/// Samples per pixel that a render has at most, on average. Where samples are chosen, `max_spp` is no limit of theirs.
fn most_samples(settings: &Settings) -> u32 {
    match settings.allocate.max_spp {
        max if max > 0 && settings.allocate.policy.placing != Placing::Chosen => max,
        _ => Settings::MAX_SPP,
    }
}

fn out_of_reach(target: Target, forecasts: &[Forecast], most: u32) -> Error {
    let least = forecasts.iter().map(|forecast| forecast.time_of(1)).fold(f64::INFINITY, f64::min);
    Error::Usage(match target {
        Target::GpuMs(ms) => {
            format!(
                "one sample a pixel takes {least:.3} ms here, {ms:.3} ms were given: allow more, or choose a smaller film"
            )
        }
        Target::RelMse(error) if most < Settings::MAX_SPP => {
            format!(
                "a relMSE of {error} takes more than {most} samples a pixel, which max_spp is: allow more of either"
            )
        }
        Target::RelMse(error) => {
            format!("a relMSE of {error} takes more than {most} samples a pixel: allow more error")
        }
    })
}

impl Plan {
    /// Reads the text of a plan's file.
    ///
    /// # Errors
    /// [`Error::Usage`] with one line for what is no plan, for one of another version, and for one whose settings are not what was chosen.
    pub fn parse(text: &str) -> Result<Self> {
        let kind = OwnJson {
            what: "plan, which tallow render --plan writes with --time or --error",
            version: "version",
            versions: VERSION.into()..=VERSION.into(),
            remedy: "plan again, or use the tallow that wrote it",
        };
        let plan: Self = kind.parse(text.as_bytes()).map_err(Error::Usage)?;
        plan.target.check()?;
        plan.settings.validate()?;
        plan.method()?;
        let (chosen, settings) = (plan.chosen.spp, plan.settings.spp);
        if chosen != settings {
            // The settings are rendered, and what was chosen is told and judged.
            let what = "set both alike, or plan anew";
            return Err(Error::Usage(format!("has {chosen} as spp of chosen, but {settings} of settings: {what}")));
        }
        Ok(plan)
    }

    /// The text of its file.
    ///
    /// # Errors
    /// [`Error::Usage`] when JSON cannot say it (a bug).
    pub fn text(&self) -> Result<String> {
        serde_json::to_string_pretty(self).map_err(|e| Error::Usage(e.to_string()))
    }

    /// Whether it was made for this scene, whatever device is to render it.
    ///
    /// # Errors
    /// [`Error::Usage`] for another scene.
    pub fn check_scene(&self, scene: &Scene) -> Result<()> {
        let found = scene.fingerprint(self.settings.size())?.to_string();
        match found == self.scene {
            true => Ok(()),
            false => {
                Err(Error::Usage("the plan is for another scene, or for this one before it was changed".to_owned()))
            }
        }
    }

    /// The filter, if one was chosen.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that no filter has.
    pub fn method(&self) -> Result<Option<Method>> {
        let Some(name) = &self.chosen.denoise else { return Ok(None) };
        let known = Method::all().find(|method| method.name() == name);
        known.map(Some).ok_or_else(|| Error::Usage(format!("the plan's filter \"{name}\" is not known")))
    }

    /// A line on a render that took so many milliseconds of GPU time, where that is far from the planned time.
    pub fn missed(&self, took_ms: f64) -> Option<String> {
        let (planned, device) = (self.chosen.gpu_ms, &self.device);
        ((took_ms - planned).abs() > MISS * planned).then(|| {
            format!(
                "the render took {took_ms:.1} ms of GPU time, where {planned:.1} ms were planned on {device}: times are kept where no \
                 other program uses the device"
            )
        })
    }

    /// What was chosen and why, in one line each.
    pub fn reasons(&self) -> Vec<String> {
        let of = |e: &Expected| {
            let filter =
                e.denoise.as_ref().map_or_else(|| "without a filter".to_owned(), |name| format!("with {name}"));
            format!("{} samples a pixel {filter}: relMSE {:.2e} in {:.1} ms", e.spp, e.relmse, e.gpu_ms)
        };
        let target = match self.target {
            Target::GpuMs(ms) => format!("{ms} ms of GPU time"),
            Target::RelMse(error) => format!("a relMSE of {error}"),
        };
        let chosen = format!("planned for {target}: {}", of(&self.chosen));
        std::iter::once(chosen).chain(self.others.iter().map(|other| format!("rather than {}", of(other)))).collect()
    }
}

/// What a render chooses among that names no filter: none, and `auto`.
pub fn usual_methods() -> Vec<Method> {
    ["none", "auto"].iter().filter_map(|name| filter::find(name)).map(Method::Kernels).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_method_is_that_of_the_target() {
        let of = |spp, gpu_ms, relmse| Expected { denoise: None, spp, gpu_ms, relmse };
        let first = |target| by_cost(target, vec![of(1, 2.0, 0.3), of(2, 1.0, 0.2), of(3, 3.0, 0.1)])[0].spp;
        assert_eq!([first(Target::GpuMs(3.0)), first(Target::RelMse(0.3))], [3, 2]);
    }

    #[test]
    fn rounds_until_chance_decides_are_no_limit_of_samples() {
        let most = |name: &str, max_spp| {
            let mut settings = Settings::default();
            settings.allocate.policy = crate::allocate::policy(name).unwrap();
            settings.allocate.max_spp = max_spp;
            most_samples(&settings)
        };
        assert_eq!([most("both", 8), most("both", 0), most("threshold", 8)], [8, Settings::MAX_SPP, Settings::MAX_SPP]);
    }

    #[test]
    fn a_time_is_missed_by_more_than_a_quarter() {
        let chosen = Expected { denoise: None, spp: 1, gpu_ms: 100.0, relmse: 0.1 };
        let plan = Plan {
            version: VERSION,
            target: Target::GpuMs(110.0),
            scene: String::new(),
            device: "a device".to_owned(),
            settings: Settings::default(),
            chosen,
            others: Vec::new(),
            probe_ms: 1.0,
        };
        let told = [70.0, 80.0, 120.0, 130.0].map(|ms| plan.missed(ms).is_some());
        assert_eq!(told, [true, false, false, true]);
        let line = plan.missed(130.0).unwrap();
        assert!(line.contains("130.0 ms") && line.contains("100.0 ms were planned on a device"), "{line}");
    }
}
