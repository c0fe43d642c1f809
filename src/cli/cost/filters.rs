//! `tallow cost --filter-only`: filters on a given image.
use super::{Args, measured, scene_info};
use crate::cli::filter::options::Overrides;
use crate::cli::{Exit, quoted};
use crate::cost::filter_only::{FilterCandidate, FilterPlan, key, measure_filters};
use crate::cost::reference;
use crate::denoise::filter::{FilterSettings, Method};
use crate::error::{Error, Result};
use crate::image;
use crate::settings::entry;
use clap::Parser;
use std::collections::BTreeSet;
use std::path::Path;

/// Measures filters on an image.
///
/// # Errors
/// What keeps every filter from being measured, and errors of writing.
pub fn run(args: &Args, image: &Path) -> Result<Exit> {
    let film = image::read(image)?;
    let file = args.reference.as_deref().ok_or_else(|| Error::Usage("--filter-only needs --reference".to_owned()))?;
    let size = film.size();
    let plan = FilterPlan {
        path: image,
        film: &film,
        scene: scene_info(image, size, None),
        candidates: candidates(args, image)?,
        repeats: args.repeats,
        order_seed: args.order_seed,
        budget: args.budget(),
        reference: reference::read(file, size, None)?,
    };
    let gpu = args.common.open(args.tracing)?;
    measured(args, &gpu, &key(&gpu, &plan), &[], |earlier, watch| measure_filters(&gpu, &plan, earlier, watch))
}

/// Every filter, with its defaults and with the options of each variant that changes it.
fn candidates(args: &Args, image: &Path) -> Result<Vec<FilterCandidate>> {
    let device = args.common.device_words();
    let of = |filter: &Method, variant: &str| candidate(image, *filter, [args.with.trim(), variant.trim()], &device);
    let plain: Vec<_> = args.denoise.iter().map(|filter| of(filter, "")).collect::<Result<_>>()?;
    let mut varied = Vec::new();
    for variant in &args.variants {
        let (before, given) = (varied.len(), overrides(variant)?.given.given());
        let reads = |filter: &Method| !filter.is_none() && given.iter().any(|option| filter.reads(option));
        for (filter, plain) in args.denoise.iter().zip(&plain).filter(|(filter, _)| reads(filter)) {
            let candidate = of(filter, variant)?;
            varied.extend((candidate.settings != plain.settings).then_some(candidate));
        }
        if varied.len() == before {
            return Err(Error::Usage(format!("\"{}\" changes no filter of the list", variant.trim())));
        }
    }
    let mut known = BTreeSet::new();
    let all = plain.into_iter().chain(varied);
    Ok(all.filter(|candidate| known.insert((candidate.filter.name(), candidate.options.clone()))).collect())
}

fn candidate(image: &Path, filter: Method, [shared, variant]: [&str; 2], device: &str) -> Result<FilterCandidate> {
    let settings = overrides(variant)?.settings(overrides(shared)?.settings(FilterSettings::default()));
    settings.validate()?;
    let options = Some(variant.to_owned()).filter(|variant| !variant.is_empty());
    let path = quoted(&image.display().to_string());
    let words = entry::options(&FilterSettings::default().entries(), &settings.entries());
    let command = format!("tallow filter {path} --filter {}{words}{device} -o point.exr", filter.name());
    Ok(FilterCandidate { filter, settings, options: options.into_iter().collect(), command })
}

/// Parses settings of `tallow filter` in one text.
fn overrides(text: &str) -> Result<Overrides> {
    #[derive(Parser)]
    #[command(no_binary_name = true, disable_help_flag = true)]
    struct Words {
        #[command(flatten)]
        overrides: Overrides,
    }
    let parsed = Words::try_parse_from(text.split_whitespace());
    Ok(parsed.map_err(|e| super::options::refused(text, "filter", &e))?.overrides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn made(words: &[&str]) -> Result<Vec<String>> {
        let fixed = ["cost", "--filter-only", "a.exr", "--reference", "b.exr"];
        let line = Line::try_parse_from(fixed.iter().chain(words)).unwrap();
        let all = candidates(&line.args, Path::new("a.exr"))?;
        let name = |candidate: &FilterCandidate| {
            [&[candidate.filter.name().to_owned()], &candidate.options[..]].concat().join(" ")
        };
        Ok(all.iter().map(name).collect())
    }

    #[test]
    fn what_changes_nothing_is_no_other_point() {
        let all = made(&["--denoise", "none,atrous", "--variant", "--levels 3"]).unwrap();
        assert_eq!(all, ["none", "atrous", "atrous --levels 3"], "nothing is filtered by none");
        let doubled = ["--denoise", "none,atrous,atrous", "--variant", "--levels 3", "--variant", "--levels 3"];
        assert_eq!(made(&doubled).unwrap(), all);
        let read = made(&["--denoise", "atrous,guided", "--variant", "--radius 9"]).unwrap();
        assert_eq!(read, ["atrous", "guided", "guided --radius 9"], "atrous reads no radius");
        for words in [
            ["--denoise", "none", "--with", "", "--variant", "--levels 3"],
            ["--denoise", "none,atrous", "--with", "--levels 3", "--variant", "--levels 3 "],
        ] {
            let line = made(&words).unwrap_err().to_string();
            assert!(line.contains("\"--levels 3\" changes no filter of the list"), "{line}");
        }
        let line = made(&["--denoise", "none", "--variant", "--levles 3"]).unwrap_err().to_string();
        assert!(line.contains("--levles"), "{line}");
    }
}
