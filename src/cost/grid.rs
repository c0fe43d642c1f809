//! The grid of methods: every combination of allocation, filter, samples and rounds, as points to measure and as renders that
//! several points share.
use super::document::Method;
use crate::allocate::{Placing, Policy};
use crate::denoise::filter::{self, FilterSettings};
use crate::error::{Error, Result};
use crate::render::Outputs;
use crate::render::settings::Settings;

/// Most points of a grid.
const MOST: usize = 1000;

/// The lists that a grid is made of.
#[derive(Clone)]
pub struct Axes {
    /// Allocation policies.
    pub allocate: Vec<&'static Policy>,
    /// Filters; `none` renders what no filter needs.
    pub filters: Vec<filter::Method>,
    /// Samples per pixel.
    pub spp: Vec<u32>,
    /// Rounds of policies that learn; 0 is the policy's own choice.
    pub rounds: Vec<u32>,
}

/// A point to measure.
#[derive(Clone)]
pub struct Candidate {
    /// As documents name it.
    pub method: Method,
    /// What is rendered.
    pub settings: Settings,
    /// The filter behind the render.
    pub filter: Option<filter::Method>,
    /// Settings of the filter, which are scaled to the image.
    pub filter_settings: FilterSettings,
}

/// A render that one or more points share.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What is rendered.
    pub settings: Settings,
    /// What the filters of its points need.
    pub outputs: Outputs,
    /// Indices of the candidates.
    pub points: Vec<usize>,
}

/// All points of a grid, in the order of the lists. What the lists do not name is as in `base`.
///
/// # Errors
/// [`Error::Usage`] for an empty list and too many points. Settings out of range become points that fail.
pub fn grid(base: &Settings, axes: &Axes) -> Result<Vec<Candidate>> {
    let mut all: Vec<Candidate> = Vec::new();
    for &policy in &axes.allocate {
        for &filter in &axes.filters {
            for &rounds in &axes.rounds {
                for &spp in &axes.spp {
                    let candidate = candidate(base, policy, filter, [rounds, spp]);
                    if all.iter().all(|other| other.method != candidate.method) {
                        all.push(candidate);
                    }
                }
            }
        }
    }
    match all.len() {
        0 => Err(Error::Usage("the grid has no point: name at least one policy, filter and number of samples".into())),
        n if n > MOST => Err(Error::Usage(format!("the grid has {n} points: choose at most {MOST}"))),
        _ => Ok(all),
    }
}

fn candidate(base: &Settings, policy: &'static Policy, filter: filter::Method, [rounds, spp]: [u32; 2]) -> Candidate {
    let mut settings = Settings { spp, ..base.clone() };
    settings.allocate.policy = policy;
    let learns = policy.placing == Placing::Learning;
    settings.allocate.rounds = if learns { rounds } else { base.allocate.rounds };
    let method = Method {
        allocate: policy.name.to_owned(),
        filter: filter.name().to_owned(),
        rounds: Some(rounds).filter(|&rounds| learns && rounds > 0),
        options: Vec::new(),
        spp,
    };
    let filter = Some(filter).filter(|filter| filter.name() != "none");
    Candidate { method, settings, filter, filter_settings: FilterSettings::default() }
}

/// The renders that the points need. Points that differ in the filter alone share one; a render without a filter is apart,
/// because it keeps fewer layers and so takes less time.
pub fn shots(candidates: &[Candidate]) -> Vec<Shot> {
    let mut shots: Vec<Shot> = Vec::new();
    for (index, candidate) in candidates.iter().enumerate() {
        let layers = candidate.filter.is_some();
        let outputs = Outputs { split_light: layers, guides: layers, counters: false };
        match shots.iter_mut().find(|s| s.outputs == outputs && s.settings == candidate.settings) {
            Some(shot) => shot.points.push(index),
            None => shots.push(Shot { settings: candidate.settings.clone(), outputs, points: vec![index] }),
        }
    }
    shots
}

/// Options of `tallow render` that turn `from` into `to`, such as `--spp 8`.
pub fn options(from: &Settings, to: &Settings) -> Vec<String> {
    let entries = from.entries().into_iter().zip(to.entries());
    let changed = entries.filter(|(from, to)| from.value != to.value);
    let word = |name: &str| if name == "policy" { "allocate".to_owned() } else { name.to_owned() };
    changed.map(|(_, to)| format!("--{} {}", word(&to.name), to.value)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allocate::policy;
    use crate::denoise::filter;

    fn axes(allocate: &[&str], filters: &[&str]) -> Axes {
        Axes {
            allocate: allocate.iter().map(|name| policy(name).unwrap()).collect(),
            filters: filters.iter().map(|name| filter::find(name).unwrap().into()).collect(),
            spp: vec![1, 4],
            rounds: vec![0, 2],
        }
    }

    #[test]
    fn filters_share_renders_and_rounds_are_for_policies_that_learn() {
        let all = grid(&Settings::default(), &axes(&["uniform", "both"], &["none", "atrous", "auto"])).unwrap();
        assert_eq!(all.len(), 3 * 2 + 3 * 4);
        assert_eq!(all[0].method.label(), "uniform, 1 spp");
        assert_eq!(all[all.len() - 1].method.label(), "both + auto, 2 rounds, 4 spp");
        let shots = shots(&all);
        assert_eq!(shots.len(), 2 * 2 + 2 * 4);
        assert_eq!(shots[2].points, [2, 4], "atrous and auto at 1 spp");
        assert!(!shots[0].outputs.guides && shots[2].outputs.guides);
        let empty = Axes { spp: Vec::new(), ..axes(&["both"], &["none"]) };
        assert_eq!(grid(&Settings::default(), &empty).err().map(|e| e.exit_code()), Some(2));
    }

    #[test]
    fn options_are_those_that_differ() {
        let all = grid(&Settings::default(), &axes(&["both"], &["none"])).unwrap();
        assert_eq!(options(&Settings::default(), &all[3].settings), ["--spp 4", "--allocate both", "--rounds 2"]);
    }
}
