//! The verdict of a statistical test as JUnit XML, which CI services show.
use super::report::Report;
use super::words;
use crate::error::{Error, Result};
use crate::image::FILTERED;
use crate::image::significance::{Level, Verdict};
use quick_junit::{NonSuccessKind, Report as Document, TestCase, TestCaseStatus, TestSuite};

/// A suite for the pair of images, with a test case for each scale: a scale at which regions differ is a failure, and one at
/// which the images are too noisy an error.
///
/// # Errors
/// When XML cannot be made of it.
pub fn text(report: &Report) -> Result<String> {
    let [a, b] = report.sides.each_ref().map(|side| side.path.display().to_string());
    let mut suite = TestSuite::new(format!("{a} and {b}"));
    for (name, side) in ["a", "b"].into_iter().zip(report.sides) {
        for key in ["device", "driver", "cpu", FILTERED] {
            if let Some(value) = side.film.metadata.get(key) {
                suite.add_property((format!("{name}.{key}").as_str(), value.as_str()));
            }
        }
    }
    suite.add_test_cases(report.outcome.levels.iter().map(|level| case(report, level)));
    let mut document = Document::new("tallow compare --statistical");
    document.add_test_suite(suite);
    document.to_string().map_err(|e| Error::output("JUnit", e))
}

fn case(report: &Report, level: &Level) -> TestCase {
    let mut case = TestCase::new(words::plural(level.scale), status(report, level));
    case.set_classname("tallow.compare");
    case.set_assertions(level.regions);
    case
}

fn status(report: &Report, level: &Level) -> TestCaseStatus {
    let asked = level.scale == report.options.at;
    let (kind, message) = match report.outcome.verdict {
        _ if level.different > 0 => (NonSuccessKind::Failure, format!("different: {}", words::count(level))),
        Verdict::TooNoisy { .. } if asked => (NonSuccessKind::Error, words::verdict(report)),
        _ => return TestCaseStatus::success(),
    };
    let mut status = TestCaseStatus::non_success(kind);
    status.set_message(message);
    status.set_description(level.worst.iter().map(words::region).collect::<Vec<_>>().join("\n"));
    status
}
