//! How the error of a method falls with time: a curve through its points, straight between them on logarithmic axes.

/// A point of a curve: the logarithms of time and error.
type Place = [f64; 2];

/// Error by time of one method and one seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Sorted by time, no two at the same time.
    places: Vec<Place>,
}

/// A value on a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The value, not its logarithm.
    pub value: f64,
    /// Whether the curve was continued beyond its ends.
    pub extrapolated: bool,
}

impl Curve {
    /// Makes a curve of (time, error). `None` if there is no point, or if a value is not above 0.
    pub fn new(points: &[(f64, f64)]) -> Option<Self> {
        let mut places: Vec<Place> = points.iter().map(|&(time, error)| [time.ln(), error.ln()]).collect();
        if places.is_empty() || places.iter().flatten().any(|v| !v.is_finite()) {
            return None;
        }
        places.sort_by(|a, b| a[0].total_cmp(&b[0]));
        places.dedup_by_key(|place| place[0]);
        Some(Self { places })
    }

    /// First and last time.
    pub fn times(&self) -> [f64; 2] {
        [self.places[0][0].exp(), self.places[self.places.len() - 1][0].exp()]
    }

    /// Smallest and largest error.
    pub fn errors(&self) -> [f64; 2] {
        let errors = || self.places.iter().map(|place| place[1]);
        [errors().fold(f64::INFINITY, f64::min).exp(), errors().fold(f64::NEG_INFINITY, f64::max).exp()]
    }

    /// Error at a time. Beyond the ends error is inversely proportional to time, as for any unbiased method.
    pub fn error_at(&self, time: f64) -> Reading {
        let (wanted, [first, last]) = (time.ln(), self.ends());
        if wanted < first[0] {
            return extrapolated(first[1] + first[0] - wanted);
        }
        let segment = self.places.windows(2).find(|pair| pair[1][0] >= wanted);
        match segment {
            Some(&[a, b]) => read(a[1] + (b[1] - a[1]) * (wanted - a[0]) / (b[0] - a[0])),
            _ if wanted <= last[0] => read(last[1]),
            _ => extrapolated(last[1] + last[0] - wanted),
        }
    }

    /// Error at a time between the ends; before the first image it is the first one's, and behind the last image the last one's.
    pub fn kept_at(&self, time: f64) -> f64 {
        let [first, last] = self.times();
        self.error_at(time.clamp(first, last)).value
    }

    /// The same curve without rises, which fireflies make: neighbours whose errors rise are level at their mean (isotonic regression by
    /// pooling adjacent violators).
    pub fn falling(&self) -> Self {
        // Mean logarithm of the error, and how many places share it.
        let mut levels: Vec<(f64, usize)> = Vec::new();
        for place in &self.places {
            let (mut error, mut n) = (place[1], 1);
            while let Some((before, m)) = levels.pop_if(|(before, _)| *before < error) {
                error = (before * m as f64 + error * n as f64) / (m + n) as f64;
                n += m;
            }
            levels.push((error, n));
        }
        let errors = levels.into_iter().flat_map(|(error, n)| std::iter::repeat_n(error, n));
        Self { places: self.places.iter().zip(errors).map(|(place, error)| [place[0], error]).collect() }
    }

    /// Logarithm of the first error over the last.
    pub fn fall(&self) -> f64 {
        let [first, last] = self.ends();
        first[1] - last[1]
    }

    /// The earliest time at which the error is reached; beyond the ends as in [`Curve::error_at`].
    pub fn time_of(&self, error: f64) -> Reading {
        let (wanted, [first, last]) = (error.ln(), self.ends());
        if wanted == first[1] {
            return read(first[0]);
        }
        if wanted > first[1] {
            return extrapolated(first[0] + first[1] - wanted);
        }
        let segment = self.places.windows(2).find(|pair| pair[1][1] <= wanted);
        match segment {
            Some(&[a, b]) => read(a[0] + (b[0] - a[0]) * (wanted - a[1]) / (b[1] - a[1])),
            _ => extrapolated(last[0] + last[1] - wanted),
        }
    }

    /// Factor in time that halves the error, by the line of least squares through the points; infinite or below 1 if the error does
    /// not fall. `None` for fewer than two points.
    pub fn halving(&self) -> Option<f64> {
        let n = self.places.len() as f64;
        let [time, error] = [0, 1].map(|axis| self.places.iter().map(|place| place[axis]).sum::<f64>() / n);
        let sum = |of: fn(f64, f64) -> f64| self.places.iter().map(|p| of(p[0] - time, p[1] - error)).sum::<f64>();
        let slope = sum(|t, e| t * e) / sum(|t, _| t * t);
        (self.places.len() > 1).then(|| 2.0_f64.powf(-1.0 / slope))
    }

    fn ends(&self) -> [Place; 2] {
        [self.places[0], self.places[self.places.len() - 1]]
    }
}

fn read(logarithm: f64) -> Reading {
    Reading { value: logarithm.exp(), extrapolated: false }
}

fn extrapolated(logarithm: f64) -> Reading {
    Reading { value: logarithm.exp(), extrapolated: true }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(reading: Reading, value: f64, extrapolated: bool) {
        assert!(
            (reading.value / value - 1.0).abs() < 1e-9 && reading.extrapolated == extrapolated,
            "{reading:?} {value}"
        );
    }

    #[test]
    fn a_curve_is_straight_on_logarithmic_axes() {
        // Error falls with the square root of time.
        let curve = Curve::new(&[(16.0, 0.25), (1.0, 1.0), (4.0, 0.5)]).unwrap();
        close(curve.error_at(2.0), 0.5_f64.sqrt(), false);
        close(curve.error_at(16.0), 0.25, false);
        close(curve.time_of(0.25), 16.0, false);
        close(curve.time_of(1.0), 1.0, false);
        close(curve.time_of(0.125_f64.sqrt()), 8.0, false);
        assert!((curve.halving().unwrap() - 4.0).abs() < 1e-9);
        assert_eq!((curve.times()[0], curve.errors()[1]), (1.0, 1.0));
    }

    #[test]
    fn beyond_its_ends_error_times_time_is_constant() {
        let curve = Curve::new(&[(1.0, 1.0), (4.0, 0.5)]).unwrap();
        close(curve.error_at(8.0), 0.25, true);
        close(curve.error_at(0.5), 2.0, true);
        close(curve.time_of(0.25), 8.0, true);
        close(curve.time_of(4.0), 0.25, true);
        let single = Curve::new(&[(2.0, 3.0)]).unwrap();
        close(single.time_of(3.0), 2.0, false);
        close(single.time_of(1.0), 6.0, true);
        assert_eq!(single.halving(), None);
    }

    #[test]
    fn a_rise_is_levelled_at_its_mean() {
        let rising = Curve::new(&[(1.0, 2.0), (2.0, 1.0), (3.0, 4.0), (4.0, 0.5), (5.0, 1.0)]).unwrap();
        let (falling, half) = (rising.falling(), 0.5_f64.sqrt());
        for (time, error) in [(1.0, 2.0), (2.0, 2.0), (3.0, 2.0), (4.0, half), (5.0, half), (0.1, 2.0), (9.0, half)] {
            assert!((falling.kept_at(time) / error - 1.0).abs() < 1e-9, "{time}: {}", falling.kept_at(time));
        }
        close(falling.time_of(2.0), 1.0, false);
        close(falling.time_of(half), 4.0, false);
        assert_eq!(falling.falling(), falling);
    }

    #[test]
    fn points_without_logarithm_make_no_curve() {
        assert_eq!(Curve::new(&[(1.0, 0.0)]), None);
        assert_eq!(Curve::new(&[(0.0, 1.0)]), None);
        assert_eq!(Curve::new(&[]), None);
        // An error that does not fall has no halving time.
        let flat = Curve::new(&[(1.0, 0.5), (2.0, 0.5)]).unwrap();
        assert!(flat.halving().is_some_and(|h| h == 0.0 || h.is_infinite()));
    }
}
