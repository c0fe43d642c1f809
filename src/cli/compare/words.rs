//! The verdict of a statistical test in words and tables.
use super::report::{Report, Side};
use crate::image::NOISY;
use crate::image::significance::{Finding, Level, Noise, Outcome, Scale, Verdict};
use crate::report::table;

/// Names of the channels.
pub const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// What differences in the tables are relative to.
pub const RELATIVE: &str =
    "Differences are relative to B or, where B is darker than the mean of all of it, to that mean.";

/// Most rows of the table of regions.
const ROWS: usize = 8;

/// A share in percent, with two significant digits.
pub fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    // Rounded before its digits are counted: 9.96 becomes 10.
    let rounded = format!("{percent:.1e}");
    match rounded.split_once('e').map_or(Ok(0), |(_, power)| power.parse::<i32>()) {
        _ if percent == 0.0 => "0 %".to_owned(),
        Ok(9..) => format!("{rounded} %"),
        Ok(2..) => format!("{:.0} %", rounded.parse().unwrap_or(percent)),
        power => format!("{percent:.*} %", (1 - power.unwrap_or(0)).clamp(0, 4) as usize),
    }
}

/// What was tested of images that were filtered, a sentence for each.
pub fn filtered(report: &Report) -> Vec<String> {
    let of = |side: &Side| {
        let (path, filter) = (side.path.display(), side.filter()?);
        Some(format!("{path} was filtered ({filter}): what was tested are its samples, the layer \"{NOISY}\"."))
    };
    report.sides.iter().filter_map(of).collect()
}

/// The verdict in one line.
pub fn verdict(report: &Report) -> String {
    let place = match report.options.at {
        Scale::Image => "the whole image".to_owned(),
        Scale::Object => "an object".to_owned(),
        Scale::Pixel => "a pixel".to_owned(),
        block => format!("a block of {block} pixels"),
    };
    match report.outcome.verdict {
        Verdict::Same { visible } => {
            format!(
                "same: a difference of {place} would have been seen from {} on, even in one channel alone, nine times in ten",
                percent(visible)
            )
        }
        Verdict::Different => format!("different: {}", different(&report.outcome)),
        Verdict::TooNoisy { samples, .. } if !samples.is_finite() => {
            format!("too noisy to say: no difference is found, but in {place} B is black, to which nothing is relative")
        }
        Verdict::TooNoisy { visible, samples } => format!(
            "too noisy to say: no difference is found, but one of {place}, if in one channel alone, is seen only from {} on; {} takes \
             about {} times the samples{}",
            percent(visible),
            percent(report.options.resolve),
            rounded_up(samples),
            numbers(report, samples)
        ),
    }
}

/// How many samples a pixel that many times the samples are.
fn numbers(report: &Report, times: f64) -> String {
    let [a, b] = report.sides.each_ref().map(|side| match &side.estimate.noise {
        Noise::Samples { count, .. } => Some(count.iter().map(|n| f64::from(*n)).sum::<f64>() / count.len() as f64),
        Noise::SquaredErrors(_) => None,
    });
    let Some((a, b)) = a.zip(b) else { return String::new() };
    let needed = |n: f64| whole(two_digits_up(n * times).ceil());
    match (a.max(b) - a.min(b)) / a.max(b) < UNEQUAL {
        true => format!(", {} a pixel", needed(a)),
        false => format!(", {} and {} a pixel (fewer if both have equally many)", needed(a), needed(b)),
    }
}

/// Numbers of samples that are further apart than this share count as unequal.
const UNEQUAL: f64 = 0.1;

/// How many regions differ, the coarsest scale first, and the surest of them.
fn different(outcome: &Outcome) -> String {
    let found: Vec<_> = outcome.levels.iter().rev().filter(|level| level.different > 0).collect();
    let counts = found.iter().map(|level| count(level)).collect::<Vec<_>>().join(", ");
    let surest = found.first().and_then(|level| level.worst.first()).map(region);
    format!("{counts}; {}", surest.unwrap_or_default())
}

/// How many regions of a scale differ.
pub fn count(level: &Level) -> String {
    match level.scale {
        Scale::Image => "the whole image".to_owned(),
        _ => format!("{} of {} {}", level.different, level.regions, plural(level.scale)),
    }
}

/// A region and by how much it differs.
pub fn region(finding: &Finding) -> String {
    let Finding { place, channel, difference, error, .. } = finding;
    let sign = if *difference > 0.0 { "+" } else { "" };
    format!("{place} by {sign}{} ± {} in {}", percent(*difference), percent(*error), CHANNELS[*channel])
}

/// What regions of a scale are called.
pub fn plural(scale: Scale) -> String {
    match scale {
        Scale::Pixel => "pixels".to_owned(),
        Scale::Object => "objects".to_owned(),
        Scale::Image => "whole image".to_owned(),
        block => format!("blocks of {block}"),
    }
}

/// As text with two significant digits, rounded up: fewer samples would not do.
fn rounded_up(samples: f64) -> String {
    let rounded = two_digits_up(samples);
    if rounded < 9.95 { format!("{rounded:.1}") } else { whole(rounded) }
}

fn two_digits_up(number: f64) -> f64 {
    if number <= 0.0 {
        return 0.0;
    }
    let unit = 10f64.powf(number.log10().floor() - 1.0);
    (number / unit).ceil() * unit
}

/// A whole number, by its power of ten where nobody counts the digits.
fn whole(number: f64) -> String {
    if number < 1e9 { format!("{number:.0}") } else { format!("{number:.1e}") }
}

/// What was found at every scale, and the regions that differ most surely.
pub fn tables(outcome: &Outcome) -> String {
    let row = |level: &Level| {
        let Level { scale, regions, different, visible, .. } = level;
        vec![scale.to_string(), regions.to_string(), different.to_string(), percent(*visible)]
    };
    let rows: Vec<_> = outcome.levels.iter().map(row).collect();
    let scales = table::text(&["scale", "regions", "different", "seen from"], &rows);
    let mut worst = Vec::new();
    for level in outcome.levels.iter().rev() {
        worst.extend(level.worst.iter().take(ROWS - worst.len().min(ROWS)).map(worst_row));
    }
    match worst.is_empty() {
        true => scales,
        false => {
            let header = ["differs", "channel", "A", "B", "difference", "standard error", "p"];
            format!("{scales}\n{}{RELATIVE}\n", table::text(&header, &worst))
        }
    }
}

fn worst_row(finding: &Finding) -> Vec<String> {
    let Finding { place, channel, means: [a, b], difference, error, p } = finding;
    let mean = |v: &f64| format!("{v:.6}");
    let name = CHANNELS[*channel].to_owned();
    vec![place.to_string(), name, mean(a), mean(b), percent(*difference), percent(*error), format!("{p:.1e}")]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_two_digits_that_mean_something() {
        let shown = [1.234, -456.7, 0.3456, 0.0123, -0.00256, 1e-5, 0.0].map(percent);
        assert_eq!(shown, ["120 %", "-46000 %", "35 %", "1.2 %", "-0.26 %", "0.0010 %", "0 %"]);
        let shown = [0.0996, 0.00996, -0.0996, 0.0994, 0.996, 9.96, 1e7, 9.96e6, f64::INFINITY].map(percent);
        assert_eq!(shown, ["10 %", "1.0 %", "-10 %", "9.9 %", "100 %", "1000 %", "1.0e9 %", "1.0e9 %", "inf %"]);
        assert_eq!([0.0, -1.0].map(two_digits_up), [0.0; 2]);
        assert_eq!([1.01, 5.31, 9.99, 123.0].map(rounded_up), ["1.1", "5.4", "10", "130"]);
    }
}
