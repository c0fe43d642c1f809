//! A profile as it is written to a file and read again.
use super::measure::Measured;
use super::spread::{Spread, median};
use super::work::Work;
use super::{Ceilings, FrameRun};
use crate::error::{Error, Result};
use crate::gpu::{Gpu, Pass, PassTime, total_ms};
use crate::image::input::{self, BYTES_OF_JSON};
use crate::machine;
use crate::own_json::OwnJson;
use crate::render::settings::Settings;
use crate::render::{Counters, traces_paths};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Version of what [`Profile`] is written as.
pub const SCHEMA: u32 = 1;
/// Shares of both ceilings below which neither is what limits a pass.
const FAR_FROM_BOTH: f64 = 0.1;

/// What frames of a scene took, and why.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Profile {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Version of the program.
    pub tallow: String,
    /// The scene file; what is not UTF-8 in its name is replaced.
    pub scene: String,
    /// [`Scene::fingerprint`].
    pub scene_fingerprint: String,
    /// What was rendered.
    pub settings: Settings,
    /// Name of the filter behind it.
    pub denoise: Option<String>,
    /// What ran it.
    pub host: Host,
    /// How it was timed.
    pub timer: Timer,
    /// What the device can do at most.
    pub ceilings: Ceilings,
    /// [`Ceilings::arithmetic_gop_s`] after the frames: it differs where clocks have changed.
    pub arithmetic_gop_s_after: f64,
    /// Clock of the device in MHz before and after the frames, of the processor where that is the device; `None` where the system does
    /// not tell.
    #[serde(default)]
    pub device_mhz: Option<[u64; 2]>,
    /// Milliseconds of all passes of a frame.
    pub frame_ms: Spread,
    /// Its passes, in the order in which they first ran.
    pub passes: Vec<PassProfile>,
    /// Rays of a frame and the nodes that they visited.
    pub counters: Counters,
    /// Millions of rays per second of the passes that trace paths.
    pub mrays_s: f64,
    /// What timing the passes took.
    pub overhead: Overhead,
}

/// What a profile is of. Times of two that are not of the same say nothing side by side.
#[derive(Clone, Copy, Debug)]
pub struct Subject<'a> {
    /// What is rendered.
    pub settings: &'a Settings,
    /// [`crate::scene::Scene::fingerprint`].
    pub scene_fingerprint: &'a str,
    /// Name of the filter behind it.
    pub denoise: Option<&'a str>,
}

impl Subject<'_> {
    /// Checks that an older profile is of the same, which is known before frames are run.
    ///
    /// # Errors
    /// [`Error::Usage`] with what differs.
    pub fn check_beside(&self, old: &Profile) -> Result<()> {
        let before = old.subject();
        let [former, filter] = [before.denoise, self.denoise].map(|name| name.unwrap_or("none"));
        let what = match () {
            // Before the scene, whose fingerprint depends on the film's size.
            () if before.settings != self.settings => {
                format!("the settings differ: {}", self.settings.differences(before.settings))
            }
            () if before.scene_fingerprint != self.scene_fingerprint => {
                format!("it is of another scene, {}, or the scene was changed", old.scene)
            }
            () if before.denoise != self.denoise => format!("filters differ: {former} and {filter}"),
            () => return Ok(()),
        };
        Err(Error::Usage(format!("the old profile cannot be compared: {what}: profile both alike")))
    }
}

/// A device, its driver and its processor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Host {
    /// Name of the device.
    pub device: String,
    /// The driver's name, version and build.
    pub driver: String,
    /// Make of the processor.
    pub cpu: String,
}

/// The clock that passes are timed by.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timer {
    /// Nanoseconds of a tick as the driver tells it.
    pub period_ns: f64,
    /// Nanoseconds that all measured times are multiples of: the clock may advance in steps of many ticks.
    pub quantum_ns: u64,
    /// Nanoseconds by which the clocks of device and host may be apart in a trace; none without calibrated timestamps.
    pub calibration_deviation_ns: Option<u64>,
}

/// What a pass is nearer to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// The fastest copy.
    Memory,
    /// The fastest arithmetic.
    Arithmetic,
    /// Below a tenth of both: it waits for single loads, for threads that do something else, or has too little to do.
    Neither,
}

/// A pass of a frame; all of its calls count together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassProfile {
    /// Its name.
    pub pass: String,
    /// Milliseconds of a frame.
    pub ms: Spread,
    /// Its share of the median frame, 0 to 1.
    pub share: f64,
    /// What it does in a frame.
    pub work: Work,
    /// Billions of bytes per second at the median.
    pub gb_s: f64,
    /// Billions of operations per second at the median.
    pub gop_s: f64,
    /// `gb_s` of what a copy of [`Work::working_set`] bytes reaches.
    pub memory_share: f64,
    /// `gop_s` of what arithmetic reaches, before the frames or after them, whichever is faster.
    pub arithmetic_share: f64,
    /// Which of the two it is nearer to.
    pub limit: Limit,
}

/// Frames with timestamps beside frames without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Overhead {
    /// Milliseconds of frames with timestamps on the host's clock.
    pub timed_ms: Spread,
    /// Milliseconds of frames without.
    pub untimed_ms: Spread,
    /// Median of the differences between frames that ran one after the other.
    pub cost_ms: f64,
}

impl Profile {
    /// Judges what was measured of the scene in this file.
    ///
    /// # Errors
    /// [`Error::Usage`] when the scene's camera is broken.
    pub fn new(gpu: &Gpu, path: &Path, scene: &Scene, settings: &Settings, measured: &Measured) -> Result<Self> {
        let Measured { frames, frame_work, ceilings, arithmetic_gop_s_after, .. } = measured;
        let fastest = fastest(ceilings, *arithmetic_gop_s_after);
        let timed: Vec<&[Pass]> = frames.timed.iter().map(|run| &run.passes[..]).collect();
        let frame_ms = Spread::of(timed.iter().map(|passes| milliseconds_of(passes, None)).collect());
        let work = timed.first().map(|passes| frame_work.of(passes)).unwrap_or_default();
        let of = |(pass, work): (String, Work)| {
            let ms = Spread::of(timed.iter().map(|passes| milliseconds_of(passes, Some(&pass))).collect());
            PassProfile::new(pass, ms, work, frame_ms.median, &fastest)
        };
        let passes: Vec<_> = work.into_iter().map(of).collect();
        let path_ms: f64 = passes.iter().filter(|p| traces_paths(&p.pass)).map(|p| p.ms.median).sum();
        Ok(Self {
            schema: SCHEMA,
            tallow: env!("CARGO_PKG_VERSION").to_owned(),
            scene: path.display().to_string(),
            scene_fingerprint: scene.fingerprint(settings.size())?.to_string(),
            settings: settings.clone(),
            denoise: None,
            host: Host::of(gpu),
            timer: Timer {
                period_ns: gpu.info().timestamp_period.into(),
                quantum_ns: quantum_ns(timed.iter().flat_map(|passes| passes.iter())),
                calibration_deviation_ns: measured.calibration.map(|moment| moment.deviation_ns),
            },
            ceilings: ceilings.clone(),
            arithmetic_gop_s_after: *arithmetic_gop_s_after,
            device_mhz: measured.device_mhz,
            frame_ms,
            passes,
            counters: frame_work.counters,
            mrays_s: frame_work.counters.rays() as f64 * 1e-3 / path_ms.max(1e-9),
            overhead: Overhead::of(&frames.timed, &frames.untimed),
        })
    }

    /// What it is of.
    pub fn subject(&self) -> Subject<'_> {
        let Self { settings, scene_fingerprint, denoise, .. } = self;
        Subject { settings, scene_fingerprint, denoise: denoise.as_deref() }
    }

    /// Reads what `tallow profile --json` printed.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that cannot be read, is no profile, or is one of another version.
    pub fn read(path: &Path) -> Result<Self> {
        let kind = OwnJson {
            what: "profile, which tallow profile --json prints",
            version: "schema",
            versions: SCHEMA.into()..=SCHEMA.into(),
            remedy: "profile again, or use the tallow that wrote it",
        };
        kind.parse(&input::read_text(path, BYTES_OF_JSON)?).map_err(|what| Error::input(path, what))
    }
}

impl PassProfile {
    fn new(pass: String, ms: Spread, work: Work, frame_ms: f64, ceilings: &Ceilings) -> Self {
        let per_second = |count: u64| count as f64 * 1e-6 / ms.median.max(1e-9);
        let (gb_s, gop_s) = (per_second(work.bytes.count), per_second(work.operations.count));
        let [memory_share, arithmetic_share] =
            [gb_s / ceilings.copy_gb_s(work.working_set), gop_s / ceilings.arithmetic_gop_s];
        let limit = Limit::of(memory_share, arithmetic_share);
        let share = ms.median / frame_ms.max(1e-9);
        Self { pass, ms, share, work, gb_s, gop_s, memory_share, arithmetic_share, limit }
    }
}

impl Limit {
    /// The nearer one of two ceilings, of which a pass reaches these shares.
    pub fn of(memory_share: f64, arithmetic_share: f64) -> Self {
        match memory_share.max(arithmetic_share) {
            nearest if nearest < FAR_FROM_BOTH => Self::Neither,
            _ if memory_share >= arithmetic_share => Self::Memory,
            _ => Self::Arithmetic,
        }
    }
}

impl Host {
    /// The machine of this device.
    pub fn of(gpu: &Gpu) -> Self {
        let info = gpu.info();
        Self { device: info.name.clone(), driver: info.driver(), cpu: machine::cpu() }
    }
}

impl Overhead {
    fn of(timed: &[FrameRun], untimed: &[FrameRun]) -> Self {
        let wall = |run: &FrameRun| run.wall.duration_ms();
        let [timed, untimed] = [timed, untimed].map(|runs| runs.iter().map(wall).collect::<Vec<f64>>());
        let differences: Vec<f64> = timed.iter().zip(&untimed).map(|(with, without)| with - without).collect();
        Self { cost_ms: median(&differences), timed_ms: Spread::of(timed), untimed_ms: Spread::of(untimed) }
    }
}

/// The most that the device was seen to do, of which passes have their shares: clocks may have risen since the ceilings were measured.
fn fastest(before: &Ceilings, arithmetic_gop_s_after: f64) -> Ceilings {
    Ceilings { arithmetic_gop_s: before.arithmetic_gop_s.max(arithmetic_gop_s_after), ..before.clone() }
}

/// Of all passes, or of one.
fn milliseconds_of(passes: &[Pass], name: Option<&str>) -> f64 {
    let of = passes.iter().filter(|pass| name.is_none_or(|name| pass.time.name == name));
    total_ms(of.map(|pass| &pass.time))
}

/// The greatest number of nanoseconds that all times since the first are multiples of.
fn quantum_ns<'a>(passes: impl Iterator<Item = &'a Pass>) -> u64 {
    let times: Vec<u64> =
        passes.flat_map(|Pass { time: PassTime { begin_ns, end_ns, .. }, .. }| [*begin_ns, *end_ns]).collect();
    let first = times.first().copied().unwrap_or(0);
    times.iter().fold(0, |common, time| greatest_common_divisor(common, time.abs_diff(first))).max(1)
}

fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::PassShape;
    use crate::profile::ceilings::CopySpeed;

    fn pass(name: &'static str, begin_ns: u64, end_ns: u64) -> Pass {
        let shape = PassShape { groups: [1; 3], threads: 1, ranges: Vec::new(), code: None };
        Pass { time: PassTime { name, begin_ns, end_ns }, shape }
    }

    #[test]
    fn the_clock_s_steps_and_the_time_of_a_pass_are_found() {
        let passes = [pass("a", 1_005, 1_037), pass("b", 1_101, 1_165), pass("a", 1_165, 1_197)];
        assert_eq!(quantum_ns(passes.iter()), 32);
        assert_eq!(quantum_ns([pass("a", 7, 7)].iter()), 1, "of nothing");
        assert_eq!(milliseconds_of(&passes, Some("a")), 64e-6);
        assert_eq!(milliseconds_of(&passes, None), 128e-6);
    }

    #[test]
    fn the_nearer_ceiling_limits_a_pass() {
        assert_eq!(Limit::of(0.5, 0.2), Limit::Memory);
        assert_eq!(Limit::of(0.1, 0.2), Limit::Arithmetic);
        assert_eq!(Limit::of(0.09, 0.09), Limit::Neither);
        let copies = [(1000, 20.0), (2000, 10.0)].map(|(bytes, gb_s)| CopySpeed { bytes, gb_s }).into();
        let ceilings = Ceilings { copies, arithmetic_gop_s: 100.0 };
        assert_eq!([1000, 1001, 9999].map(|bytes| ceilings.copy_gb_s(bytes)), [20.0, 10.0, 10.0]);
        let mut work = Work::default();
        (work.bytes.count, work.operations.count, work.working_set) = (8_000_000, 20_000_000, 2000);
        let row = PassProfile::new("a".into(), Spread::of(vec![2.0]), work.clone(), 8.0, &ceilings);
        assert_eq!((row.share, row.gb_s, row.gop_s), (0.25, 4.0, 10.0));
        assert_eq!((row.memory_share, row.arithmetic_share, row.limit), (0.4, 0.1, Limit::Memory));
        let share = |after: f64| {
            PassProfile::new("a".into(), Spread::of(vec![2.0]), work.clone(), 8.0, &fastest(&ceilings, after))
                .arithmetic_share
        };
        assert_eq!((share(500.0), share(20.0)), (0.02, 0.1), "of the faster one");
    }
}
