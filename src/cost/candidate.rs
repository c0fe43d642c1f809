//! Methods that are compared, each with its curves of error against time.
use super::curve::Curve;
use super::document::{Method, Point};
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
    /// Times that the curves of all seeds cover.
    pub(super) fn times(&self) -> [f64; 2] {
        let covered = |[low, high]: [f64; 2], [first, last]: [f64; 2]| [low.max(first), high.min(last)];
        self.curves.values().map(Curve::times).fold([0.0, f64::INFINITY], covered)
    }

    pub(super) fn covers(&self, time: f64) -> bool {
        let [first, last] = self.times();
        (first..=last).contains(&time)
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
    let is_measured = |point: &&Point| point.failed.is_none() && point.method.spp > 0 && !point.runs.is_empty();
    for point in points.iter().filter(is_measured) {
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
