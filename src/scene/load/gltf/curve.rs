//! Samplers of animations: numbers that change with time, by the three interpolations of glTF 2.0 (appendix C).
use super::accessor::Elements;
use super::asset::Asset;
use crate::error::Result;
use crate::memory;
use crate::scene::animation::time::reaches;
use glam::DQuat;
use gltf_json::animation::{Interpolation, Sampler};
use gltf_json::validation::Checked;
use std::ops::Range;

/// Keys in the order of their times.
#[derive(Debug)]
pub struct Curve {
    /// Seconds, increasing; at least one.
    times: Vec<f32>,
    /// Of each key its numbers; of a cubic spline the incoming tangent before them and the outgoing one behind.
    values: Vec<f32>,
    /// Numbers of a value.
    width: usize,
    interpolation: Interpolation,
    /// Whether values are quaternions.
    turns: bool,
}

impl Curve {
    /// Reads a sampler whose values have `width` numbers each, or are quaternions.
    ///
    /// # Errors
    /// [`crate::error::Error::Memory`]. The sentence within is about a sampler that cannot be played.
    pub fn read(
        asset: &Asset,
        sampler: &Sampler,
        width: usize,
        turns: bool,
    ) -> Result<std::result::Result<Self, String>> {
        let all = asset.root.accessors.len();
        let (input, output) = (sampler.input.value(), sampler.output.value());
        if input >= all || output >= all {
            return Ok(Err(format!("names accessors {input} and {output}, and there are {all}")));
        }
        let (times, values) = (Elements::of(asset, input)?, Elements::of(asset, output)?);
        let bytes = 8 * (times.count() + values.count() * values.width()) as u64;
        if bytes > 1 << 20 {
            memory::need(asset.path.display(), bytes)?;
        }
        Ok(Self::of(&times, &values, sampler, width, turns))
    }

    fn of(
        times: &Elements,
        values: &Elements,
        sampler: &Sampler,
        width: usize,
        turns: bool,
    ) -> std::result::Result<Self, String> {
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Err("has an interpolation other than LINEAR, STEP and CUBICSPLINE".into());
        };
        let times: Vec<f32> = times.numbers::<1>()?.into_iter().flatten().collect();
        let values: Vec<f32> = match values.width() {
            1 => values.numbers::<1>()?.into_iter().flatten().collect(),
            3 => values.numbers::<3>()?.into_iter().flatten().collect(),
            4 => values.numbers::<4>()?.into_iter().flatten().collect(),
            other => return Err(format!("has values of {other} numbers")),
        };
        let parts = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let needed = times.len() * parts * width;
        if values.len() != needed || needed == 0 {
            return Err(format!("has {} numbers for {} keys, which take {needed}", values.len(), times.len()));
        }
        if !times.iter().chain(&values).all(|v| v.is_finite()) {
            return Err("has a number that is NaN or infinite".into());
        }
        match times.windows(2).find(|pair| pair[1] <= pair[0]) {
            Some(pair) => Err(format!("has keys out of order, at {} s and {} s", pair[0], pair[1])),
            None => Ok(Self { times, values, width, interpolation, turns }),
        }
    }

    /// Time of the last key in seconds.
    pub fn end(&self) -> f64 {
        self.times.last().copied().map_or(0.0, f64::from)
    }

    /// From the first key to the last, between which values change; none where there is one key.
    pub fn moving(&self) -> Option<Range<f64>> {
        let [first, .., last] = self.times[..] else { return None };
        Some(f64::from(first)..f64::from(last))
    }

    /// The value at a time; before the first and after the last key, theirs. Quaternions are of length 1 unless they vanish.
    pub fn at(&self, seconds: f64) -> Vec<f64> {
        let after = self.times.partition_point(|&time| reaches(seconds, f64::from(time)));
        let value = match after {
            0 => self.key(0, 0),
            after if after == self.times.len() => self.key(after - 1, 0),
            after => self.between(after - 1, seconds),
        };
        match self.turns.then(|| DQuat::from_slice(&value)).filter(|q| q.length() > 1e-12) {
            Some(quaternion) => quaternion.normalize().to_array().to_vec(),
            None => value,
        }
    }

    /// The value between key `a` and the next.
    fn between(&self, a: usize, seconds: f64) -> Vec<f64> {
        let [from, to] = [a, a + 1].map(|key| f64::from(self.times[key]));
        let (length, t) = (to - from, ((seconds - from) / (to - from)).max(0.0));
        let (start, end) = (self.key(a, 0), self.key(a + 1, 0));
        match self.interpolation {
            Interpolation::Step => start,
            Interpolation::Linear if self.turns => {
                let [a, b] = [&start, &end].map(|v| DQuat::from_slice(v).normalize());
                // Opposite quaternions are one rotation: `slerp` takes the shorter way.
                if a.is_finite() && b.is_finite() { a.slerp(b, t).to_array().to_vec() } else { start }
            }
            Interpolation::Linear => start.iter().zip(end).map(|(a, b)| a + (b - a) * t).collect(),
            Interpolation::CubicSpline => {
                let (leaving, arriving) = (self.key(a, 1), self.key(a + 1, -1));
                let (t2, t3) = (t * t, t * t * t);
                let point = |i: usize| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * start[i]
                        + length * (t3 - 2.0 * t2 + t) * leaving[i]
                        + (3.0 * t2 - 2.0 * t3) * end[i]
                        + length * (t3 - t2) * arriving[i]
                };
                (0..self.width).map(point).collect()
            }
        }
    }

    /// Numbers of a key: its value (0), and of a spline the tangent before (-1) and behind it (1).
    fn key(&self, key: usize, part: isize) -> Vec<f64> {
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let part = if cubic { key as isize * 3 + 1 + part } else { key as isize };
        let first = part as usize * self.width;
        self.values[first..first + self.width].iter().map(|&v| f64::from(v)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(times: &[f32], values: &[f32], width: usize, interpolation: Interpolation) -> Curve {
        let turns = width == 4;
        Curve { times: times.to_vec(), values: values.to_vec(), width, interpolation, turns }
    }

    #[test]
    fn lines_and_steps_pass_through_their_keys_and_stay_at_the_ends() {
        let line = curve(&[1.0, 3.0], &[10.0, 20.0], 1, Interpolation::Linear);
        assert_eq!([0.0, 1.0, 2.5, 3.0, 9.0].map(|t| line.at(t)[0]), [10.0, 10.0, 17.5, 20.0, 20.0]);
        let step = curve(&[1.0, 3.0], &[10.0, 20.0], 1, Interpolation::Step);
        assert_eq!([2.9, 3.0].map(|t| step.at(t)[0]), [10.0, 20.0]);
    }

    #[test]
    fn splines_have_the_tangents_of_their_keys() {
        // From 0 to 1 in 2 s, leaving at 3 per second and arriving at 0.
        let spline = curve(&[0.0, 2.0], &[9.0, 0.0, 3.0, 0.0, 1.0, 9.0], 1, Interpolation::CubicSpline);
        assert_eq!([0.0, 2.0].map(|t| spline.at(t)[0]), [0.0, 1.0]);
        let slope = |t: f64| (spline.at(t + 1e-5)[0] - spline.at(t - 1e-5)[0]) / 2e-5;
        assert!((slope(1e-4) - 3.0).abs() < 1e-2 && slope(2.0 - 1e-4).abs() < 1e-2, "{}", slope(1e-4));
        // Half-way: 1/2 * 0 + 2 * 1/8 * 3 + 1/2 * 1 = 1.25.
        assert!((spline.at(1.0)[0] - 1.25).abs() < 1e-12);
    }

    #[test]
    fn rotations_are_of_length_one_and_take_the_shorter_way() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        // The second key is the same rotation as (0, 0, half, half), a quarter turn, of the opposite sign.
        let turn = curve(&[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -half, -half], 4, Interpolation::Linear);
        let eighth = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4);
        assert!(DQuat::from_slice(&turn.at(0.5)).dot(eighth).abs() > 1.0 - 1e-9);
        let (zero, one) = ([0.0; 4], [0.0, 0.0, 0.0, 1.0]);
        let values = [zero, one, zero, zero, [0.0, 0.0, 1.0, 0.0], zero].concat();
        let spline = curve(&[0.0, 1.0], &values, 4, Interpolation::CubicSpline);
        assert!((DQuat::from_slice(&spline.at(0.5)).length() - 1.0).abs() < 1e-12, "half-way its sum is shorter");
    }
}
