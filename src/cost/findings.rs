//! What the data of a measurement say, in words. A statement is made only where the data tell; a tie is said to be one.
use super::candidate::{Candidate, candidates};
use super::changes;
use super::curve::Curve;
use super::document::{Estimate, Finding, Point, Verdict};
use super::gain;
use super::interval::{self, CONFIDENCE};
use super::scatter;
use super::words::{factor, list, milliseconds, number, percent};

/// Number of times at which methods are compared.
const LEVELS: usize = 8;
/// Largest number of errors for which the time to reach them is told.
const GOALS: usize = 4;

/// Which candidate has the lowest value of those that were measured at the place in question.
#[derive(Debug, Default)]
struct Ranking {
    /// The lowest one, and then those that cannot be told from it.
    best: Vec<usize>,
    /// Those that were not measured that far, and that might be as good if all went on as unbiased methods do.
    open: Vec<usize>,
}

/// Says what the points show. Comparisons between methods use the runs of the same seed, and all of them together keep the
/// probability of naming a wrong winner below 1 - [`CONFIDENCE`].
pub fn findings(points: &[Point]) -> Vec<Finding> {
    let candidates = candidates(points);
    let mut all: Vec<Finding> = candidates.iter().filter_map(halving).collect();
    all.extend(gain::finding(&candidates));
    all.extend(best_by_time(&candidates));
    all.extend(goals(&candidates));
    all.extend(singles(points));
    all.extend(changes::findings(points));
    all.extend(scatter::findings(points));
    all
}

/// What it costs to halve the error.
fn halving(candidate: &Candidate) -> Option<Finding> {
    let factors: Vec<f64> = candidate.curves.values().filter_map(Curve::halving).collect();
    let name = &candidate.name;
    if factors.is_empty() {
        return None;
    }
    let [low, high] = range(candidate);
    let falls = factors.iter().all(|f| f.is_finite() && *f > 1.0);
    let estimate = falls.then(|| interval::geometric_mean(&factors, CONFIDENCE));
    let told = |e: &Estimate| e.low.is_some_and(|low| low > 1.0) && e.high.is_some_and(|high| high < 100.0);
    Some(match estimate.filter(told) {
        Some(estimate) => clear(format!(
            "To halve relMSE costs {} times the time with {name} (between {} and {}).",
            factor(&estimate),
            number(low),
            number(high)
        )),
        None => noisy(format!("What it costs to halve relMSE with {name} cannot be told from these runs.")),
    })
}

/// Smallest and largest error of a method, by the geometric mean over seeds.
fn range(candidate: &Candidate) -> [f64; 2] {
    [0, 1].map(|end| candidate.mean(&|curve| curve.errors()[end]).exp())
}

/// Which method is best at which time.
fn best_by_time(candidates: &[Candidate]) -> Vec<Finding> {
    let times = levels(candidates);
    let alpha = level(times.len(), candidates.len());
    let rank = |&time: &f64| {
        // What begins later is no choice at this time, and what has ended keeps its last image.
        let begins = |c: &Candidate| c.begins_by(time);
        let has_ended = |c: &Candidate| c.times()[1] < time;
        let continued = |curve: &Curve| curve.error_at(time).value;
        ranking(candidates, [&begins, &has_ended], [&|curve| curve.kept_at(time), &continued], alpha)
    };
    let rankings: Vec<Ranking> = times.iter().map(rank).collect();
    let mut found = Vec::new();
    let mut first = 0;
    for end in 1..=times.len() {
        if end == times.len() || !same(&rankings[end], &rankings[first]) {
            found.push(best_between(candidates, &rankings[first], &times[first..end]));
            first = end;
        }
    }
    found
}

/// Level of each of the tests in one of two families, so that all together are right with the wanted confidence.
fn level(places: usize, candidates: usize) -> f64 {
    (1.0 - CONFIDENCE) / (2 * places * candidates.saturating_sub(1)).max(1) as f64
}

fn same(a: &Ranking, b: &Ranking) -> bool {
    let sorted = |indices: &[usize]| {
        let mut indices = indices.to_vec();
        indices.sort_unstable();
        indices
    };
    sorted(&a.best) == sorted(&b.best) && sorted(&a.open) == sorted(&b.open)
}

fn best_between(candidates: &[Candidate], ranking: &Ranking, times: &[f64]) -> Finding {
    let (first, last) = (times[0], times[times.len() - 1]);
    let when = match first == last {
        true => format!("At {}", milliseconds(first)),
        false => format!("From {} to {}", milliseconds(first), milliseconds(last)),
    };
    let middle = (first * last).sqrt();
    let best = &candidates[ranking.best[0]];
    let error = number(best.mean(&|curve| curve.kept_at(middle)).exp());
    let at = if first == last { String::new() } else { format!(" at {}", milliseconds(middle)) };
    match ranking.best[..] {
        [_] => {
            with_open(candidates, ranking, format!("{when}, {} has the lowest relMSE ({error}{at})", best.name), clear)
        }
        _ => {
            let tied = names(candidates, &ranking.best);
            let text = format!("{when}, the data cannot tell between {tied}: the lowest relMSE is about {error}{at}");
            with_open(candidates, ranking, text, noisy)
        }
    }
}

/// A statement, with the methods that were not measured far enough to contest it. Those leave it open.
fn with_open(candidates: &[Candidate], ranking: &Ranking, text: String, finding: fn(String) -> Finding) -> Finding {
    match ranking.open[..] {
        [] => finding(text + "."),
        _ => noisy(format!("{text}, but {} might do as well if measured that far.", names(candidates, &ranking.open))),
    }
}

fn names(candidates: &[Candidate], indices: &[usize]) -> String {
    list(&indices.iter().map(|&i| candidates[i].name.as_str()).collect::<Vec<_>>())
}

/// Times at which at least two methods have begun and, if possible, have not ended, evenly spaced on a logarithmic axis.
fn levels(candidates: &[Candidate]) -> Vec<f64> {
    let [mut firsts, mut lasts] = [0, 1].map(|end| candidates.iter().map(|c| c.times()[end]).collect::<Vec<_>>());
    firsts.sort_by(f64::total_cmp);
    lasts.sort_by(|a, b| b.total_cmp(a));
    let (Some(&low), Some(&high)) = (firsts.get(1), lasts.get(1)) else { return Vec::new() };
    let at = |i: usize| (low * (high / low).powf(i as f64 / (LEVELS - 1) as f64)).clamp(low, high);
    if low < high { (0..LEVELS).map(at).collect() } else { vec![low] }
}

/// The lowest of what the first of `reads` finds among those that are `there`, and all that a test at the level `alpha` cannot tell
/// from it. Candidates for which `goes_on` holds are open where the second of `reads`, which continues curves, does not tell them from
/// it.
fn ranking(
    candidates: &[Candidate],
    [there, goes_on]: [&dyn Fn(&Candidate) -> bool; 2],
    [read, continued]: [&dyn Fn(&Curve) -> f64; 2],
    alpha: f64,
) -> Ranking {
    let all = || 0..candidates.len();
    let value = |i: usize| candidates[i].mean(read);
    let is_there = |i: &usize| there(&candidates[*i]);
    let Some(first) = all().filter(is_there).min_by(|&a, &b| value(a).total_cmp(&value(b))) else {
        return Ranking::default();
    };
    let is_worse = |i: usize, read: &dyn Fn(&Curve) -> f64| {
        candidates[i].mean(read) > candidates[first].mean(read)
            && interval::differs_from_0(&candidates[i].against(&candidates[first], read), alpha)
    };
    let ties = all().filter(|&i| i != first && is_there(&i) && !is_worse(i, read));
    let best: Vec<usize> = std::iter::once(first).chain(ties).collect();
    let open = all().filter(|i| !best.contains(i) && goes_on(&candidates[*i]) && !is_worse(*i, continued)).collect();
    Ranking { best, open }
}

/// The time to reach some errors, and by which method.
fn goals(candidates: &[Candidate]) -> Vec<Finding> {
    let goals = round_errors(candidates);
    let alpha = level(goals.len(), candidates.len());
    goals.into_iter().filter_map(|error| goal(candidates, error, alpha)).collect()
}

fn goal(candidates: &[Candidate], error: f64, alpha: f64) -> Option<Finding> {
    // A method whose first point is better than the goal reaches it there.
    let read = |curve: &Curve| curve.time_of(error).value.max(curve.times()[0]);
    let reaches = |c: &Candidate| range(c)[0] <= error;
    let ranking = ranking(candidates, [&reaches, &|c| !reaches(c)], [&read, &read], alpha);
    let fastest = &candidates[*ranking.best.first()?];
    let times: Vec<f64> = fastest.curves.values().map(read).collect();
    let time = interval::geometric_mean(&times, CONFIDENCE);
    let between = time.interval(milliseconds).map(|between| format!(" ({between})"));
    let text = format!("relMSE {} takes {}{}", number(error), milliseconds(time.value), between.unwrap_or_default());
    let clear: fn(String) -> Finding = if time.is_vague() { noisy } else { clear };
    let mut finding = match ranking.best[..] {
        [_] if candidates.len() == 1 => clear(format!("{text} with {}.", fastest.name)),
        [_] => with_open(candidates, &ranking, format!("{text} with {}, the fastest", fastest.name), clear),
        _ => {
            let tied = names(candidates, &ranking.best);
            with_open(candidates, &ranking, format!("{text} at least; the data cannot tell between {tied}"), noisy)
        }
    };
    finding.text.extend(ranking.best.iter().filter_map(|&i| missed(&candidates[i], error)));
    Some(finding)
}

/// In how many of its seeds a method reaches an error; `None` for all.
fn missed(candidate: &Candidate, error: f64) -> Option<String> {
    let Candidate { name, curves, .. } = candidate;
    let reached = curves.values().filter(|curve| curve.errors()[0] <= error).count();
    (reached < curves.len()).then(|| format!(" {name} reaches it in {reached} of its {} seeds.", curves.len()))
}

/// Errors of the series 1, 2, 5 that some method reaches and does not begin with.
fn round_errors(candidates: &[Candidate]) -> Vec<f64> {
    let ranges: Vec<[f64; 2]> = candidates.iter().map(range).collect();
    let series = (-9..3).flat_map(|power| [1.0, 2.0, 5.0].map(|digit: f64| digit * 10.0_f64.powi(power)));
    let inside = |e: &f64| ranges.iter().any(|[low, high]| (low..high).contains(&e));
    let all: Vec<f64> = series.filter(inside).collect();
    let step = all.len().div_ceil(GOALS).max(1);
    all.into_iter().step_by(step).collect()
}

/// Comparison of points that do not depend on samples: filters of a given image, whose errors have no noise.
fn singles(all: &[Point]) -> Vec<Finding> {
    let usable = |point: &&Point| point.failed.is_none() && point.method.spp == 0 && !point.runs.is_empty();
    let points: Vec<&Point> = all.iter().filter(usable).collect();
    let error = |point: &Point| point.runs[0].errors.relmse.unwrap_or(f64::INFINITY);
    let Some(best) = points.iter().copied().min_by(|a, b| error(a).total_cmp(&error(b))) else { return Vec::new() };
    let lowest = error(best);
    let ties: Vec<String> = points.iter().filter(|p| error(p) == lowest).map(|p| p.method.name()).collect();
    let names: Vec<&str> = ties.iter().map(String::as_str).collect();
    let mut found = vec![match names[..] {
        [name] => clear(format!("{name} has the lowest relMSE, {}.", number(lowest))),
        _ => noisy(format!("{} have the same relMSE, {}.", list(&names), number(lowest))),
    }];
    let is_other = |point: &&&Point| point.method != best.method && point.method.filter != "none";
    let others = points.iter().filter(is_other).filter(|point| changes::plain(all, point).is_none());
    found.extend(others.map(|point| beside(point, best)));
    found
}

/// Below this, the relMSE of an image is rounding, of which no other is a multiple.
const ROUNDING: f64 = 1e-12;

/// Time and error of one filter beside the most accurate one.
fn beside(point: &Point, best: &Point) -> Finding {
    let ratio = |(a, b): (&super::document::Run, &super::document::Run)| a.gpu_ms / b.gpu_ms;
    let ratios: Vec<f64> = point.runs.iter().zip(&best.runs).map(ratio).collect();
    let times = interval::geometric_mean(&ratios, CONFIDENCE);
    let logarithms: Vec<f64> = ratios.iter().map(|r| r.ln()).collect();
    let (name, other) = (point.method.name(), best.method.name());
    let [error, least] = [point, best].map(|point| point.runs[0].errors.relmse);
    let more = match (error, least) {
        (Some(error), Some(least)) if least > ROUNDING => format!("is {} higher", percent(error / least - 1.0)),
        (Some(error), _) => format!("is {}", number(error)),
        (None, _) => "is not known".to_owned(),
    };
    match interval::differs_from_0(&logarithms, 1.0 - CONFIDENCE) {
        true => clear(format!("{name} takes {} times the time of {other}, and its relMSE {more}.", factor(&times))),
        false => noisy(format!("Whether {name} or {other} is faster the data cannot tell; its relMSE {more}.")),
    }
}

fn clear(text: String) -> Finding {
    Finding { verdict: Verdict::Clear, text }
}

fn noisy(text: String) -> Finding {
    Finding { verdict: Verdict::TooNoisy, text }
}
