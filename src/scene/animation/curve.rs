//! Numbers that change with time.
use super::time::{reaches, within};
use crate::error::Checked;
use crate::scene::description::Interpolation;
use glam::DQuat;
use std::ops::Range;

/// Keys in the order of their times, and what lies between them.
#[derive(Clone, Debug)]
pub struct Curve {
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
    interpolation: Interpolation,
    /// Whether values are unit quaternions (x, y, z, w).
    turns: bool,
    /// Seconds after which it begins again.
    period: Option<f64>,
}

impl Curve {
    /// Of pairs of time and value, at least one.
    ///
    /// # Errors
    /// A sentence about times that do not grow, and numbers that are none.
    pub fn new(keys: Vec<(f64, Vec<f64>)>, interpolation: Interpolation, turns: bool) -> Checked<Self> {
        for (number, (time, value)) in (1..).zip(&keys) {
            if !time.is_finite() || !value.iter().all(|v| v.is_finite()) {
                return Err(format!("key {number}, at {time}, has a number that is NaN or infinite"));
            }
        }
        if let Some(at) = keys.windows(2).position(|pair| pair[1].0 <= pair[0].0) {
            let ([a, b], number) = ([keys[at].0, keys[at + 1].0], at + 1);
            let what = if a == b { "are at one time" } else { "are out of order" };
            return Err(format!(
                "keys {number} and {} {what}, {a} and {b}: sort them, and give each its own",
                number + 1
            ));
        }
        let (times, values) = keys.into_iter().unzip();
        Ok(Self { times, values, interpolation, turns, period: None })
    }

    /// Begins again at the end of a period that starts at 0.
    pub fn repeated(self, period: f64) -> Self {
        Self { period: (period > 0.0).then_some(period), ..self }
    }

    /// Time of the last key.
    pub fn end(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// From the first key to the last, between which values change, or always where it repeats; none where there is one key.
    pub fn moving(&self) -> Option<Range<f64>> {
        let (first, last) = (self.times.first()?, self.times.last()?);
        let span = if self.period.is_some() { f64::NEG_INFINITY..f64::INFINITY } else { *first..*last };
        (self.times.len() > 1).then_some(span)
    }

    /// The value at a time; before the first and after the last key, theirs.
    pub fn at(&self, seconds: f64) -> Vec<f64> {
        let seconds = self.period.map_or(seconds, |period| within(seconds, period));
        let after = self.times.partition_point(|&time| reaches(seconds, time));
        let (Some(a), Some(b)) = (after.checked_sub(1), self.values.get(after)) else {
            let end = if after == 0 { self.values.first() } else { self.values.last() };
            return end.cloned().unwrap_or_default();
        };
        let (from, share) =
            (&self.values[a], ((seconds - self.times[a]) / (self.times[after] - self.times[a])).max(0.0));
        match (self.interpolation, self.turns) {
            (Interpolation::Step, _) => from.clone(),
            (_, false) => from.iter().zip(b).map(|(a, b)| a + (b - a) * share).collect(),
            (_, true) => {
                let [a, b] = [from, b].map(|v| DQuat::from_slice(v));
                a.slerp(b, share).normalize().to_array().to_vec()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(keys: &[(f64, f64)], interpolation: Interpolation) -> Checked<Curve> {
        Curve::new(keys.iter().map(|&(t, v)| (t, vec![v])).collect(), interpolation, false)
    }

    #[test]
    fn values_lie_on_lines_or_steps_and_the_ends_last() {
        let line = curve(&[(1.0, 10.0), (3.0, 20.0)], Interpolation::Linear).unwrap();
        assert_eq!([0.0, 1.0, 2.5, 3.0, 9.0].map(|t| line.at(t)[0]), [10.0, 10.0, 17.5, 20.0, 20.0]);
        let steps = curve(&[(1.0, 10.0), (3.0, 20.0)], Interpolation::Step).unwrap();
        assert_eq!([0.0, 2.9, 3.0].map(|t| steps.at(t)[0]), [10.0, 10.0, 20.0]);
        let again = curve(&[(0.0, 0.0), (2.0, 8.0)], Interpolation::Linear).unwrap().repeated(2.0);
        assert_eq!([0.5, 2.5, 21.0, -0.5].map(|t| again.at(t)[0]), [2.0, 2.0, 4.0, 6.0]);
        let alone = curve(&[(5.0, 1.0)], Interpolation::Linear).unwrap().repeated(5.0);
        let always = f64::NEG_INFINITY..f64::INFINITY;
        assert_eq!([line, again, alone].map(|c| c.moving()), [Some(1.0..3.0), Some(always), None]);
    }

    #[test]
    fn rotations_take_the_shortest_way() {
        let turn = |degrees: f64| DQuat::from_rotation_y(degrees.to_radians()).to_array().to_vec();
        for (end, middle) in [(90.0, 45.0), (270.0, -45.0)] {
            let c = Curve::new(vec![(0.0, turn(0.0)), (1.0, turn(end))], Interpolation::Linear, true).unwrap();
            let half = DQuat::from_slice(&c.at(0.5));
            assert!(half.dot(DQuat::from_slice(&turn(middle))).abs() > 1.0 - 1e-12, "to {end}: {half}");
        }
    }

    #[test]
    fn times_grow() {
        let error = |keys: &[(f64, f64)]| curve(keys, Interpolation::Linear).unwrap_err();
        assert!(error(&[(1.0, 0.0), (0.5, 0.0)]).contains("keys 1 and 2 are out of order, 1 and 0.5"));
        assert!(error(&[(0.0, 0.0), (1.0, 0.0), (1.0, 5.0)]).contains("keys 2 and 3 are at one time"));
        assert!(error(&[(f64::NAN, 0.0)]).contains("key 1, at NaN"));
        assert!(error(&[(0.0, f64::INFINITY)]).contains("NaN or infinite"));
    }
}
