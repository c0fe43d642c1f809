//! Two profiles of one scene, told apart where the difference is more than their noise.
use super::record::Profile;
use super::spread::Spread;
use crate::error::Result;
use serde::Serialize;

/// What a change must exceed: this many times the range of repeats, this many steps of the clock, milliseconds, and a share of the
/// frame.
const RANGES: f64 = 3.0;
const QUANTA: f64 = 2.0;
const LEAST_MS: f64 = 0.05;
const LEAST_SHARE: f64 = 0.005;
/// The share by which clocks may differ, and by which arithmetic may be faster or slower at the same clocks.
const SAME_CLOCKS: f64 = 0.05;

/// What became of a pass, or of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// It takes as long as before, within its noise.
    Same,
    /// It takes longer.
    Slower,
    /// It takes less long.
    Faster,
    /// It did not run before.
    Added,
    /// It does not run any more.
    Removed,
    /// There were too few frames to know how its times vary.
    Unknown,
}

/// A pass before and now.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Its name; `frame` for all passes together.
    pub pass: String,
    /// Median milliseconds before; none where it did not run.
    pub old_ms: Option<f64>,
    /// Median milliseconds now; none where it does not run.
    pub new_ms: Option<f64>,
    /// What a change must exceed, in milliseconds; none where that is not known.
    pub threshold_ms: Option<f64>,
    /// What became of it.
    pub change: Change,
}

/// What a comparison finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing changed by more than its noise.
    Same,
    /// Something did.
    Changed,
    /// Devices, drivers or clocks differ, or there are too few frames.
    Inconclusive,
}

/// A profile beside an older one of the same scene and settings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// What was found.
    pub verdict: Verdict,
    /// Why it is inconclusive.
    pub reasons: Vec<String>,
    /// The frame, and then each pass.
    pub rows: Vec<Row>,
}

impl Comparison {
    /// Compares.
    ///
    /// # Errors
    /// Those of [`Subject::check_beside`](super::Subject::check_beside).
    pub fn new(old: &Profile, new: &Profile) -> Result<Self> {
        new.subject().check_beside(old)?;
        let noise = Noise { quantum_ms: QUANTA * quantum_ms(old, new), frame_ms: old.frame_ms.median };
        let mut rows = vec![noise.row("frame", Some(&old.frame_ms), Some(&new.frame_ms))];
        let of = |profile: &Profile, pass: &str| profile.passes.iter().find(|p| p.pass == pass).map(|p| p.ms.clone());
        let gone = old.passes.iter().filter(|p| of(new, &p.pass).is_none());
        for pass in new.passes.iter().chain(gone) {
            let [before, now] = [old, new].map(|profile| of(profile, &pass.pass));
            rows.push(noise.row(&pass.pass, before.as_ref(), now.as_ref()));
        }
        let mut reasons = differences(old, new);
        if rows.iter().any(|row| row.change == Change::Unknown) {
            reasons.push("too few frames to know how times vary: profile 4 or more".to_owned());
        }
        let verdict = match () {
            () if !reasons.is_empty() => Verdict::Inconclusive,
            () if rows.iter().any(|row| row.change != Change::Same) => Verdict::Changed,
            () => Verdict::Same,
        };
        Ok(Self { verdict, reasons, rows })
    }
}

/// What all passes of a comparison share.
struct Noise {
    quantum_ms: f64,
    frame_ms: f64,
}

impl Noise {
    fn row(&self, pass: &str, old: Option<&Spread>, new: Option<&Spread>) -> Row {
        let threshold_ms = old.zip(new).and_then(|(old, new)| {
            let range = old.range_of_repeats?.max(new.range_of_repeats?);
            Some((RANGES * range).max(self.quantum_ms).max(LEAST_MS).max(LEAST_SHARE * self.frame_ms))
        });
        let [old_ms, new_ms] = [old, new].map(|spread| spread.map(|spread| spread.median));
        let change = match (old_ms, new_ms, threshold_ms) {
            (None, _, _) => Change::Added,
            (_, None, _) => Change::Removed,
            (_, _, None) => Change::Unknown,
            (Some(old), Some(new), Some(most)) if new - old > most => Change::Slower,
            (Some(old), Some(new), Some(most)) if old - new > most => Change::Faster,
            _ => Change::Same,
        };
        Row { pass: pass.to_owned(), old_ms, new_ms, threshold_ms, change }
    }
}

fn quantum_ms(old: &Profile, new: &Profile) -> f64 {
    old.timer.quantum_ns.max(new.timer.quantum_ns) as f64 * 1e-6
}

/// Why times of the two mean nothing side by side.
fn differences(old: &Profile, new: &Profile) -> Vec<String> {
    let names = [
        ("devices", &old.host.device, &new.host.device),
        ("drivers", &old.host.driver, &new.host.driver),
        ("processors", &old.host.cpu, &new.host.cpu),
    ];
    let differ = names.into_iter().filter(|(_, old, new)| old != new);
    let mut reasons: Vec<_> = differ.map(|(what, old, new)| format!("{what} differ: {old} and {new}")).collect();
    let clocks = old.device_mhz.zip(new.device_mhz).map(|(old, new)| [old, new].concat());
    let [least, most] = clocks.map_or([0.0; 2], |mhz| range(mhz.iter().map(|&mhz| mhz as f64)));
    if least < (1.0 - SAME_CLOCKS) * most {
        reasons.push(format!("clocks differ: {least} to {most} MHz"));
    }
    let rates = |p: &Profile| [p.ceilings.arithmetic_gop_s, p.arithmetic_gop_s_after];
    let [least, most] = range([rates(old), rates(new)].concat().into_iter());
    if least < (1.0 - SAME_CLOCKS) * most {
        let share = 100.0 * (1.0 - least / most.max(1e-9));
        reasons.push(format!(
            "clocks differ, or others use the machine: arithmetic ran up to {share:.0} % slower at times"
        ));
    }
    reasons
}

/// The least and the most.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, 0.0], |[least, most], value| [least.min(value), most.max(value)])
}

#[cfg(test)]
mod tests;
