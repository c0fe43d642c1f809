//! What a method takes and reaches with other numbers of samples than those of a probe's levels: time is linear in samples, error a
//! power of them, from one level to the next and behind the last.
use super::probe::Level;

/// Powers of the number of samples by which error falls. Without a filter it is 1 for independent samples and up to about 1.6 for Sobol
/// points; what a filter blurs for good falls more slowly.
const POWERS: [f64; 2] = [0.2, 1.6];
/// Largest of them that counts on from four samples, which gain over a single one what more cannot gain again: the bust's error falls by a
/// power of 1.7 to four, and by 1.2 from there to 16.
const MOST_FROM_FOUR: f64 = 1.2;
/// Where one level alone was measured.
const USUAL_POWER: f64 = 1.0;
/// Errors below this are rounding.
const LEAST_ERROR: f64 = 1e-12;

/// Time and error of a method by samples per pixel.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// Milliseconds that do not depend on samples: of the render, and of its filter.
    start: f64,
    filter: f64,
    /// Milliseconds of a sample of every pixel.
    per_sample: f64,
    /// Samples and errors that were measured, fewest samples first. None has less error than those with more samples: where the few of
    /// two images miss a lamp, these are alike.
    measured: Vec<[f64; 2]>,
    /// The power behind the last of them.
    power: f64,
    /// Samples that a pixel can have.
    most: f64,
}

impl Forecast {
    /// From the levels of a probe, fewest samples first, of renders that have at most so many samples per pixel.
    pub fn new(levels: &[Level], method: usize, most: u32) -> Self {
        let last = &levels[levels.len() - 1];
        let error = |level: &Level| level.methods[method].error.max(LEAST_ERROR);
        // The last level may have few samples more than the one before: the noise of both would be the power.
        let power = match levels.iter().rfind(|before| 2 * before.spp <= last.spp) {
            Some(before) => {
                let samples = f64::from(last.spp) / f64::from(before.spp);
                let power = ((error(before) / error(last)).ln() / samples.ln()).clamp(POWERS[0], POWERS[1]);
                if before.spp == 1 { power.min(MOST_FROM_FOUR) } else { power }
            }
            None => USUAL_POWER,
        };
        let mut measured: Vec<_> = levels.iter().map(|level| [f64::from(level.spp), error(level)]).collect();
        for at in (1..measured.len()).rev() {
            measured[at - 1][1] = measured[at - 1][1].max(measured[at][1]);
        }
        Self {
            start: last.start_ms,
            filter: last.methods[method].ms,
            per_sample: last.samples_ms / f64::from(last.spp),
            measured,
            power,
            most: most.into(),
        }
    }

    /// The same where a render of so many samples took this time, its filter not counted.
    pub fn through(&self, spp: u32, ms: f64) -> Self {
        let per_sample = ((ms - self.start) / f64::from(spp)).max(f64::MIN_POSITIVE);
        Self { per_sample, ..self.clone() }
    }

    /// GPU time in milliseconds.
    pub fn time_of(&self, spp: u32) -> f64 {
        self.start + self.filter + self.per_sample * f64::from(spp)
    }

    /// RelMSE.
    pub fn error_of(&self, spp: u32) -> f64 {
        let spp = f64::from(spp);
        let ([samples, error], power) = self.part(|&[samples, _]| samples >= spp);
        error * (samples / spp).powf(power)
    }

    /// The first level that has arrived, and the power that leads there from the one before; else the last, and the power behind it.
    fn part(&self, arrived: impl Fn(&[f64; 2]) -> bool) -> ([f64; 2], f64) {
        let measured = &self.measured;
        let at = measured.iter().position(arrived).unwrap_or(measured.len());
        match (at.checked_sub(1).map(|before| measured[before]), measured.get(at)) {
            (Some([few, more_error]), Some(&[samples, error])) => {
                ([samples, error], (more_error / error).ln() / (samples / few).ln())
            }
            (Some(last), None) => (last, self.power),
            (None, _) => (measured[0], self.power),
        }
    }

    /// Samples that fit a time; none if not even one does.
    pub fn samples_within(&self, ms: f64) -> Option<u32> {
        let samples = ((ms - self.start - self.filter) / self.per_sample).floor();
        (samples >= 1.0).then(|| samples.min(self.most) as u32)
    }

    /// Samples that reach an error; none if more were needed than a pixel can have.
    pub fn samples_for(&self, error: f64) -> Option<u32> {
        let ([measured_at, measured], power) = self.part(|&[_, measured]| measured <= error);
        let samples = (measured_at * (measured / error).powf(1.0 / power)).ceil().max(1.0);
        (samples <= self.most).then_some(samples as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::probe::Measured;
    use super::*;

    const MOST: u32 = 1 << 24;

    fn level(spp: u32, error: f64) -> Level {
        let methods = vec![Measured { error, ms: 30.0 }];
        Level { spp, start_ms: 5.0, samples_ms: 10.0 * f64::from(spp), methods }
    }

    #[test]
    fn time_is_a_line_and_error_a_power() {
        let forecast = Forecast::new(&[level(1, 0.4), level(4, 0.1)], 0, MOST);
        assert_eq!(forecast.time_of(10), 135.0);
        assert_eq!(forecast.samples_within(135.0), Some(10));
        assert_eq!((forecast.samples_within(134.9), forecast.samples_within(44.0)), (Some(9), None));
        assert!((forecast.error_of(16) - 0.025).abs() < 1e-12);
        // 10 samples took 125 ms, of which 5 are not theirs: 12 ms each, so that 8 fit where 10 did.
        let rehearsed = forecast.through(10, 125.0);
        assert_eq!((rehearsed.time_of(10), rehearsed.samples_within(135.0)), (155.0, Some(8)));
        assert_eq!((forecast.samples_for(0.0251), forecast.samples_for(9.0)), (Some(16), Some(1)));
        // As fast as Sobol points, and as slow as what is blurred: the powers have ends.
        let fast = |few| Forecast::new(&[level(few, 1.0), level(4 * few, 1e-9)], 0, MOST).power;
        assert_eq!((fast(1), fast(4)), (MOST_FROM_FOUR, POWERS[1]));
        let stuck = Forecast::new(&[level(1, 0.1), level(4, 0.1)], 0, MOST);
        assert_eq!(stuck.samples_for(1e-6), None);
        assert_eq!(Forecast::new(&[level(2, 0.1)], 0, MOST).samples_for(0.05), Some(4));
    }

    #[test]
    fn a_power_is_that_of_twice_the_samples_or_more() {
        let cut = Forecast::new(&[level(1, 0.4), level(4, 0.1), level(5, 0.079)], 0, 5);
        assert_eq!(cut.power, Forecast::new(&[level(1, 0.4), level(5, 0.079)], 0, 5).power);
        assert_eq!(Forecast::new(&[level(4, 0.1), level(5, 0.1)], 0, 5).power, USUAL_POWER);
    }

    /// One sample of a small lamp is off by more than any power of 64 samples tells.
    #[test]
    fn what_was_measured_is_foretold() {
        let levels = [(1, 0.42), (4, 0.03), (16, 0.005), (64, 0.0013)];
        let forecast = Forecast::new(&levels.map(|(spp, error)| level(spp, error)), 0, MOST);
        levels.iter().for_each(|&(spp, error)| assert!((forecast.error_of(spp) / error - 1.0).abs() < 1e-9, "{spp}"));
        // Two samples lie between one and four by the logarithm, as sqrt(.42 * .03) = .1122 does.
        assert!((forecast.error_of(2) - 0.1122).abs() < 1e-4);
        assert_eq!(
            [0.5, 0.42, 0.1123, 0.1122, 0.0301].map(|error| forecast.samples_for(error)),
            [1, 1, 2, 3, 4].map(Some)
        );
        // Behind the last level, error falls as it did to there.
        assert_eq!(forecast.samples_for(0.0013 / 2f64.powf(forecast.power) * 1.001), Some(128));
    }

    #[test]
    fn no_level_is_better_than_one_with_more_samples() {
        let forecast = Forecast::new(&[level(1, 1e-12), level(4, 0.3), level(16, 0.1)], 0, MOST);
        assert_eq!([1, 4, 16].map(|spp| forecast.error_of(spp)), [0.3, 0.3, 0.1]);
        assert_eq!([0.3, 0.1].map(|error| forecast.samples_for(error)), [Some(1), Some(16)]);
    }

    #[test]
    fn no_pixel_has_more_samples_than_it_can() {
        let forecast = Forecast::new(&[level(1, 0.4), level(4, 0.1)], 0, 8);
        assert_eq!([115.0, 1e6].map(|ms| forecast.samples_within(ms)), [Some(8); 2]);
        assert_eq!([0.0501, 0.04].map(|error| forecast.samples_for(error)), [Some(8), None]);
    }
}
