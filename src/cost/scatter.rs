//! Points whose runs scatter so much that a mean over them says little, or that have no error to compare.
use super::document::{Finding, Point, Verdict};
use super::words::list;

/// Fewest runs that tell which of them carry the mean.
const FEWEST: usize = 3;
/// Share of the runs that may carry half of the mean where nothing is unusual.
const FEW: f64 = 0.1;

/// Points whose mean error few runs decide, and points that no comparison includes.
pub(super) fn findings(points: &[Point]) -> Vec<Finding> {
    let measured = || points.iter().filter(|point| point.is_compared());
    let heavy = measured().filter_map(|point| {
        let runs = point.runs.len();
        heavy(point).map(|few| format!("{} ({few} of {runs} runs)", point.method.label()))
    });
    let without_error = measured().filter(|point| point.ends_at_0()).map(|point| point.method.label());
    let heavy = about(heavy, |names| {
        format!(
            "Few runs, such as those with fireflies, have half of all relMSE of {names}: the errors shown are of a typical run, and the \
             expected ones, which such runs decide, take many more."
        )
    });
    let left_out = about(without_error, |names| {
        format!("A run has no relMSE above the noise of the reference, so that no comparison includes {names}.")
    });
    heavy.into_iter().chain(left_out).collect()
}

fn about(names: impl Iterator<Item = String>, text: impl Fn(&str) -> String) -> Option<Finding> {
    let names: Vec<String> = names.collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    (!names.is_empty()).then(|| Finding { verdict: Verdict::TooNoisy, text: text(&list(&names)) })
}

/// How many runs carry half of the mean relMSE, if that is a tenth of them or less, or a single one.
fn heavy(point: &Point) -> Option<usize> {
    let mut errors: Vec<f64> = point.runs.iter().filter_map(|run| run.errors.relmse).collect();
    errors.sort_by(|a, b| b.total_cmp(a));
    let few = (FEW * errors.len() as f64).ceil() as usize;
    let half = 0.5 * errors.iter().sum::<f64>();
    let carry = (1..=few).find(|&n| errors[..n].iter().sum::<f64>() > half);
    carry.filter(|_| errors.len() >= FEWEST)
}
