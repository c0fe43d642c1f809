//! The knobs that `tallow cost --ablate` turns, one at a time.
use crate::allocate::Placing;
use crate::cost::grid::Candidate;
use crate::settings::entry::Entry;

/// A knob, and the values that are tried of it: what a user would write behind `--`.
struct Knob {
    name: &'static str,
    /// A switch has none, and is switched on.
    values: &'static [&'static str],
    read_by: Reader,
}

/// Which points a knob changes.
enum Reader {
    /// All.
    Paths,
    /// What is filtered, because the filter gets another part of the light, and what is placed by a policy that weighs the parts.
    Split,
    /// What is placed by a policy that reads the setting of this name.
    Placed,
    /// What is filtered by one of the filters that read the setting of this name.
    Filters,
    /// What begins with samples of earlier frames.
    Carried,
}
use Reader::{Carried, Filters, Paths, Placed, Split};

const fn knob(name: &'static str, values: &'static [&'static str], read_by: Reader) -> Knob {
    Knob { name, values, read_by }
}

/// All knobs. Values are an octave or so to each side of the defaults, and what switches the knob off.
const KNOBS: &[Knob] = &[
    knob("max-depth", &["2", "3", "4", "5", "6", "7", "8"], Paths),
    knob("roulette-depth", &["0", "3", "5"], Paths),
    knob("sampler", &["sobol", "independent"], Paths),
    knob("split", &["soft", "indirect"], Split),
    knob("min-spp", &["0", "1", "2", "4"], Placed),
    knob("max-spp", &["0", "8", "16", "32", "64"], Placed),
    knob("window", &["2", "4", "8"], Placed),
    knob("sigma-normal", &["0.1", "0.35", "1"], Placed),
    knob("sigma-position", &["0.01", "0.03", "0.1"], Placed),
    knob("luminance-floor", &["0.01", "0.05", "0.2"], Placed),
    knob("filtered", &["0", "0.5", "0.9"], Placed),
    knob("levels", &["2", "3", "4", "5", "6"], Filters),
    knob("radius", &["6", "12", "24", "48"], Filters),
    knob("sigma-rt", &["0.3", "1", "3", "inf"], Filters),
    knob("sigma-n", &["0.1", "0.3", "1", "inf"], Filters),
    knob("sigma-x", &["0.02", "0.05", "0.15", "inf"], Filters),
    knob("form", &["listing", "squared", "printed"], Filters),
    knob("conserve-energy", &[], Filters),
    knob("channels", &["1", "3", "4"], Filters),
    knob("eps", &["0.001", "0.003", "0.03", "0.1"], Filters),
    knob("sums", &["blocks", "table"], Filters),
    knob("sigma-l", &["2", "4", "8"], Filters),
    knob("basis", &["cdf22", "red-black"], Filters),
    knob("oidn-quality", &["fast", "balanced", "high"], Filters),
    knob("reproject-error", &["0", "0.1", "0.25", "0.5"], Carried),
    knob("reproject-light", &["0.02", "0.05", "0.1", "0.2"], Carried),
    // Of eight frames: what a longer history is worth they do not tell.
    knob("reproject-samples", &["2", "4", "8", "256"], Carried),
    knob("reproject-age", &["1", "2", "64"], Carried),
];

/// The options that change one knob of a point to another value, such as `--levels 4`.
pub fn steps(candidate: &Candidate) -> Vec<String> {
    KNOBS.iter().filter(|knob| knob.is_read_by(candidate)).flat_map(|knob| knob.steps(candidate)).collect()
}

/// Whether a point reads a setting that another one changes. What no knob names is read by all. One of another policy, which a noise
/// threshold chooses in place of one that does not learn, is no variant of this point.
pub fn reads_change(point: &Candidate, other: &Candidate) -> bool {
    if point.settings.allocate.policy != other.settings.allocate.policy {
        return false;
    }
    let changed = |(own, others): (Entry, Entry)| (own.value != others.value).then_some(own.name);
    let mut changed = entries(point).into_iter().zip(entries(other)).filter_map(changed);
    changed.any(|name| KNOBS.iter().filter(|knob| knob.name == name).all(|knob| knob.is_read_by(point)))
}

fn entries(candidate: &Candidate) -> Vec<Entry> {
    let carries = candidate.carries.unwrap_or_default().entries();
    [candidate.settings.entries(), candidate.filter_settings.entries(), carries].concat()
}

impl Knob {
    fn steps(&self, candidate: &Candidate) -> Vec<String> {
        let own = entries(candidate).into_iter().find(|entry| entry.name == self.name).map(|entry| entry.value);
        let allowed = |value: &str| {
            // Fewer at most than there are on average would leave samples over.
            let limits = self.name == "max-spp" && candidate.settings.allocate.policy.placing != Placing::Chosen;
            !limits || value.parse().is_ok_and(|most: u32| most == 0 || most > candidate.settings.spp)
        };
        let others = self.values.iter().filter(|&&value| own.as_deref() != Some(value) && allowed(value));
        let switch = self.values.is_empty().then(|| format!("--{}", self.name));
        others.map(|value| format!("--{} {value}", self.name)).chain(switch).collect()
    }

    fn is_read_by(&self, candidate: &Candidate) -> bool {
        match self.read_by {
            Paths => true,
            Split => candidate.filter.is_some() || candidate.settings.allocate.policy.split_light,
            Placed => candidate.settings.allocate.policy.reads(self.name),
            Filters => candidate.filter.is_some_and(|filter| filter.reads(self.name)),
            Carried => candidate.carries.is_some(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::options::Words;
    use super::*;
    use crate::allocate::{POLICIES, policy};
    use crate::cost::grid::{Axes, grid};
    use crate::denoise::filter::{FILTERS, FilterInput, FilterSettings, Method};
    use crate::layout::{Guide, vec4};
    use crate::render::Reproject;
    use crate::render::settings::Settings;

    /// Far pixels count, so that every level of a filter changes something.
    fn candidate(policy_name: &str, filter: Method, spp: u32) -> Candidate {
        let axes = Axes {
            allocate: vec![policy(policy_name).unwrap()],
            filters: vec![filter],
            spp: vec![spp],
            rounds: vec![0],
            carries: vec![Some(Reproject::default())],
        };
        let filters = FilterSettings::default().with(|s| s.edge.sigma_x = 2.0);
        grid(&Settings::default(), &filters, &axes).remove(0)
    }

    /// The settings with one option.
    fn with(candidate: &Candidate, option: &str) -> Option<Candidate> {
        let words = Words::parse(option).unwrap();
        candidate.varied(option, |settings, filters, carries| words.apply(settings, filters, carries))
    }

    #[test]
    fn every_step_is_an_option_in_its_range_that_changes_something() {
        for policy in POLICIES {
            for filter in Method::all() {
                let candidate = candidate(policy.name, filter, 4);
                for step in steps(&candidate) {
                    let varied = with(&candidate, &step).unwrap_or_else(|| panic!("{step} changes nothing"));
                    varied.settings.validate().unwrap();
                    varied.filter_settings.validate().unwrap();
                }
            }
        }
        let unfiltered = |policy| Candidate { filter: None, ..candidate(policy, Method::all().next().unwrap(), 16) };
        let has = |policy, step: &str| steps(&unfiltered(policy)).contains(&step.to_owned());
        assert_eq!(["both", "geometry"].map(|policy| has(policy, "--split indirect")), [true, false]);
        assert_eq!(
            ["both", "threshold"].map(|policy| has(policy, "--max-spp 8")),
            [false, true],
            "no limit of samples there"
        );
        let of_16 = steps(&candidate("both", Method::all().next().unwrap(), 16));
        assert!(of_16.contains(&"--max-spp 32".to_owned()) && !of_16.contains(&"--max-spp 16".to_owned()));
    }

    #[test]
    fn what_a_point_does_not_read_changes_nothing() {
        let atrous = Method::all().find(|filter| filter.name() == "atrous").unwrap();
        let reads = |policy: &str, option: &str| {
            let point = candidate(policy, atrous, 4);
            reads_change(&point, &with(&point, option).unwrap())
        };
        assert!(!reads("uniform", "--min-spp 1 --luminance-floor 0.2") && !reads("uniform", "--radius 9"));
        assert!(reads("geometry", "--min-spp 1 --luminance-floor 0.2") && reads("uniform", "--min-spp 1 --levels 3"));
        assert!(reads("threshold", "--luminance-floor 0.2") && !reads("geometry", "--luminance-floor 0.2"));
        assert!(!reads("uniform", "--noise-threshold 0.1") && reads("both", "--noise-threshold 0.1"));
        assert!(reads("uniform", "--indirect-stride 2"), "no knob, so that all may read it");
    }

    /// Noise on two walls that meet at an edge.
    fn input() -> FilterInput {
        let (width, height) = (20, 16);
        let mut random = fastrand::Rng::with_seed(3);
        let guide = |i: u32| {
            let (x, y) = ((i % width) as f32, (i / width) as f32);
            let normal = if x < 9.0 { [1.0, 0.0, 0.0] } else { [0.0, 0.6, 0.8] };
            Guide { normal, depth: 2.0 + 0.1 * x, position: [0.1 * x, 0.1 * y, 2.0 + 0.1 * x], ..Guide::default() }
        };
        let radiance =
            (0..width * height).map(|_| vec4::from([random.f32(), random.f32(), random.f32(), 4.0])).collect();
        FilterInput { width, height, radiance, guide: (0..width * height).map(guide).collect(), variance: None }
    }

    #[test]
    fn filters_read_the_knobs_that_name_them_and_no_others() {
        let input = input();
        let of_filters =
            |knob: &&Knob| matches!(knob.read_by, Filters) && !["oidn-quality", "sums"].contains(&knob.name);
        for filter in FILTERS {
            let candidate = candidate("uniform", Method::Kernels(filter), 4);
            let filtered = |settings: &FilterSettings| (filter.reference)(&input, &settings.scaled_to(&input));
            let plain = filtered(&candidate.filter_settings);
            for knob in KNOBS.iter().filter(of_filters) {
                let differs = |step: &String| {
                    with(&candidate, step).is_some_and(|varied| filtered(&varied.filter_settings) != plain)
                };
                let reads = knob.steps(&candidate).iter().any(differs);
                assert_eq!(reads, knob.is_read_by(&candidate), "{} of {}", knob.name, filter.name);
            }
        }
    }
}
