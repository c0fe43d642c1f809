//! The verdict of a statistical test in words and tables.
use crate::image::significance::{Finding, Level, Options, Outcome, Scale, Verdict};
use crate::report::table;

/// Names of the channels.
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Most rows of the table of regions.
const ROWS: usize = 8;

/// A share in percent, with two significant digits.
pub fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let digits = (1.0 - percent.abs().max(1e-4).log10().floor()).clamp(0.0, 4.0) as usize;
    format!("{percent:.digits$} %")
}

/// The verdict in one line.
pub fn verdict(outcome: &Outcome, options: &Options) -> String {
    let places = match options.at {
        Scale::Image => "of the whole image".to_owned(),
        Scale::Object => "of an object".to_owned(),
        Scale::Pixel => "of a pixel".to_owned(),
        block => format!("of a block of {block} pixels"),
    };
    match outcome.verdict {
        Verdict::Same { visible } => {
            format!("same: a difference {places} would have been seen from {} on, nine times in ten", percent(visible))
        }
        Verdict::Different => format!("different: {}", different(outcome)),
        Verdict::TooNoisy { visible, samples } => format!(
            "too noisy to say: no difference is found, but {places} one would be seen only from {} on; {} takes about {} times \
             the samples of both",
            percent(visible),
            percent(options.resolve),
            rounded_up(samples)
        ),
    }
}

/// How many regions differ, the coarsest scale first, and the surest of them.
fn different(outcome: &Outcome) -> String {
    let found: Vec<_> = outcome.levels.iter().rev().filter(|level| level.different > 0).collect();
    let count = |level: &&Level| match level.scale {
        Scale::Image => "the whole image".to_owned(),
        _ => format!("{} of {} {}", level.different, level.regions, plural(level.scale)),
    };
    let counts = found.iter().map(count).collect::<Vec<_>>().join(", ");
    let surest = found.first().and_then(|level| level.worst.first()).map(region);
    format!("{counts}; {}", surest.unwrap_or_default())
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
        Scale::Image => "images".to_owned(),
        block => format!("blocks of {block}"),
    }
}

/// Two significant digits, rounded up: fewer samples would not do.
fn rounded_up(samples: f64) -> String {
    let unit = 10f64.powf(samples.log10().floor() - 1.0);
    let rounded = (samples / unit).ceil() * unit;
    if rounded < 9.95 { format!("{rounded:.1}") } else { format!("{rounded:.0}") }
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
            format!("{scales}\n{}", table::text(&header, &worst))
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
        let shown = [1.234, 0.3456, 0.0123, -0.00256, 1e-5, 0.0].map(percent);
        assert_eq!(shown, ["123 %", "35 %", "1.2 %", "-0.26 %", "0.0010 %", "0.0000 %"]);
        assert_eq!([1.01, 5.31, 9.99, 123.0].map(rounded_up), ["1.1", "5.4", "10", "130"]);
    }
}
