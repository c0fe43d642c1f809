//! Methods that are compared, each with its curves of error against time.
use super::curve::Curve;
use super::document::{Method, Point};
use super::interval;
use super::summary::curves;
use std::collections::BTreeMap;

/// A method with a curve for every seed.
pub(super) struct Candidate {
    pub(super) name: String,
    /// Whether it is uniform unfiltered rendering.
    pub(super) is_baseline: bool,
    pub(super) curves: BTreeMap<u32, Curve>,
}

impl Candidate {
    /// When the first and the last image are ready: medians over the seeds, because one slow run says nothing of a method.
    pub(super) fn times(&self) -> [f64; 2] {
        [0, 1].map(|end| {
            interval::median(&self.curves.values().map(|curve| curve.times()[end]).collect::<Vec<_>>(), 0.0).value
        })
    }

    pub(super) fn begins_by(&self, time: f64) -> bool {
        self.times()[0] <= time
    }

    /// Mean logarithm of what `read` finds on every curve.
    pub(super) fn mean(&self, read: &dyn Fn(&Curve) -> f64) -> f64 {
        self.curves.values().map(|curve| read(curve).ln()).sum::<f64>() / self.curves.len() as f64
    }

    /// Logarithms of the quotient of what `read` finds for this method and for another one, seed by seed. Runs of another renderer may
    /// have seeds of their own: they are independent of ours, so that each may stand beside any, and the first stands beside the first.
    pub(super) fn against(&self, other: &Self, read: &dyn Fn(&Curve) -> f64) -> Vec<f64> {
        let both = |(one, other): (&Curve, &Curve)| (read(one) / read(other)).ln();
        let shared = self.curves.iter().filter_map(|(seed, curve)| Some((curve, other.curves.get(seed)?)));
        let shared: Vec<f64> = shared.map(both).collect();
        // One pair tells nothing of the noise.
        let is_enough = shared.len() > 1;
        if is_enough { shared } else { self.curves.values().zip(other.curves.values()).map(both).collect() }
    }
}

/// Methods with runs, in the order of the points. What has options and a single point is no method of its own: it is compared with the
/// same point without them.
pub(super) fn candidates(points: &[Point]) -> Vec<Candidate> {
    let mut groups: Vec<(Method, Vec<&Point>)> = Vec::new();
    for point in points.iter().filter(|point| point.is_compared() && !point.ends_at_0()) {
        let method = Method { spp: 0, ..point.method.clone() };
        match groups.iter_mut().find(|(found, _)| *found == method) {
            Some((_, points)) => points.push(point),
            None => groups.push((method, vec![point])),
        }
    }
    let candidate = |(method, points): (Method, Vec<&Point>)| Candidate {
        name: method.name(),
        is_baseline: method.is_baseline(),
        curves: curves(&points),
    };
    groups.retain(|(method, points)| method.options.is_empty() || points.len() > 1);
    groups.into_iter().map(candidate).filter(|candidate| !candidate.curves.is_empty()).collect()
}
