//! The grid of methods: every combination of allocation, filter, samples and rounds, as points to measure and as renders that
//! several points share.
use super::document::Method;
use crate::allocate::{Placing, Policy};
use crate::denoise::filter::{self, FilterSettings};
use crate::error::{Error, Result};
use crate::render::settings::Settings;
use crate::render::{Outputs, Reproject};
use crate::settings::entry::Value;

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
    /// How frames begin with samples of the last, if they do.
    pub carries: Vec<Option<Reproject>>,
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
    /// Settings of the filter; those at their defaults are scaled to the image.
    pub filter_settings: FilterSettings,
    /// How samples of earlier frames are carried, if they are.
    pub carries: Option<Reproject>,
}

/// A render that one or more points share.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What is rendered.
    pub settings: Settings,
    /// What the filters of its points need.
    pub outputs: Outputs,
    /// How samples of earlier frames are carried, if they are.
    pub carries: Option<Reproject>,
    /// Indices of the candidates.
    pub points: Vec<usize>,
}

/// All points of a grid, in the order of the lists. What the lists do not name is as in `base`, and filters have the settings
/// `filters`. Settings out of range become points that fail.
pub fn grid(base: &Settings, filters: &FilterSettings, axes: &Axes) -> Vec<Candidate> {
    let mut all: Vec<Candidate> = Vec::new();
    for &carries in &axes.carries {
        for &policy in &axes.allocate {
            for &filter in &axes.filters {
                for &rounds in &axes.rounds {
                    for &spp in &axes.spp {
                        let plain = candidate(base, policy, filter, [rounds, spp]);
                        let candidate = Candidate { filter_settings: *filters, ..plain }.carrying(carries);
                        if all.iter().all(|other| other.method != candidate.method) {
                            all.push(candidate);
                        }
                    }
                }
            }
        }
    }
    all
}

impl Candidate {
    /// Whether it makes an image of the whole light.
    ///
    /// # Errors
    /// [`Error::Usage`] where no filter fills in light that is not traced.
    pub fn check_stride(&self) -> Result<()> {
        let stride = self.settings.indirect_stride;
        match self.filter {
            Some(filter) => filter.check_stride(stride),
            None if stride > 1 => {
                Err(Error::Usage(format!("{}: leave out the filter none", filter::missing_light(stride))))
            }
            None => Ok(()),
        }
    }

    /// The same with other settings, as `change` makes them, and named by `option`. `None` if they are no others.
    pub fn varied(
        &self,
        option: &str,
        change: impl FnOnce(&mut Settings, &mut FilterSettings, &mut Reproject),
    ) -> Option<Self> {
        let (mut varied, mut carries) = (self.clone(), self.carries.unwrap_or_default());
        change(&mut varied.settings, &mut varied.filter_settings, &mut carries);
        varied.carries = self.carries.map(|_| carries);
        varied.method.options = vec![option.to_owned()];
        let filters_alike = self.filter.is_none() || self.filter_settings == varied.filter_settings;
        let alike = varied.settings == self.settings && varied.carries == self.carries && filters_alike;
        (!alike).then_some(varied)
    }

    fn carrying(mut self, carries: Option<Reproject>) -> Self {
        self.method.reproject = carries.map(|how| how.reproject.text());
        Self { carries, ..self }
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
        spp,
        ..Method::default()
    };
    let filter = Some(filter).filter(|filter| !filter.is_none());
    Candidate { method, settings, filter, filter_settings: FilterSettings::default(), carries: None }
}

/// The renders that the points need. Points that differ in the filter alone share one; a render without a filter is apart,
/// because it keeps fewer layers and so takes less time.
pub fn shots(candidates: &[Candidate]) -> Vec<Shot> {
    let mut shots: Vec<Shot> = Vec::new();
    for (index, candidate) in candidates.iter().enumerate() {
        let (layers, carries) = (candidate.filter.is_some(), candidate.carries);
        let outputs = Outputs { split_light: layers, guides: layers || carries.is_some(), counters: false };
        let shares = |s: &&mut Shot| s.outputs == outputs && s.settings == candidate.settings && s.carries == carries;
        match shots.iter_mut().find(shares) {
            Some(shot) => shot.points.push(index),
            None => shots.push(Shot { settings: candidate.settings.clone(), outputs, carries, points: vec![index] }),
        }
    }
    shots
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
            carries: vec![None],
        }
    }

    fn made(allocate: &[&str], filters: &[&str]) -> Vec<Candidate> {
        grid(&Settings::default(), &FilterSettings::default(), &axes(allocate, filters))
    }

    #[test]
    fn filters_share_renders_and_rounds_are_for_policies_that_learn() {
        let all = made(&["uniform", "both"], &["none", "atrous", "auto"]);
        assert_eq!(all.len(), 3 * 2 + 3 * 4);
        assert_eq!(all[0].method.label(), "uniform, 1 spp");
        assert_eq!(all[all.len() - 1].method.label(), "both + auto, 2 rounds, 4 spp");
        let shots = shots(&all);
        assert_eq!(shots.len(), 2 * 2 + 2 * 4);
        assert_eq!(shots[2].points, [2, 4], "atrous and auto at 1 spp");
        assert!(!shots[0].outputs.guides && shots[2].outputs.guides);
    }

    #[test]
    fn what_changes_nothing_is_no_other_point() {
        let all = made(&["uniform"], &["none", "atrous"]);
        let fewer_levels =
            |_: &mut Settings, filters: &mut FilterSettings, _: &mut Reproject| filters.footprint.levels = 3;
        assert!(all[0].varied("--levels 3", fewer_levels).is_none(), "nothing is filtered");
        let varied = all[2].varied("--levels 3", fewer_levels).unwrap();
        assert_eq!(varied.method.label(), "uniform + atrous, levels 3, 1 spp");
        assert!(all[2].varied("--max-depth 8", |s, _, _| s.max_depth = 8).is_none(), "it is 8");
    }
}
