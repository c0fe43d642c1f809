//! `tallow cost --filter-only`: filters on a given image.
use super::{Args, Folder, finish, name, open, watched};
use crate::cli::filter::options::Overrides;
use crate::cli::{Exit, fail_on_messages, quoted};
use crate::cost::document::SceneInfo;
use crate::cost::filter_only::{FilterCandidate, FilterPlan, measure_filters};
use crate::cost::reference;
use crate::denoise::filter::{FilterSettings, Method};
use crate::error::{Error, Result};
use crate::image;
use clap::Parser;
use std::path::Path;

/// Measures filters on an image.
///
/// # Errors
/// What keeps every filter from being measured, and errors of writing.
pub fn run(args: &Args, image: &Path) -> Result<Exit> {
    let film = image::read(image)?;
    let file = args.reference.as_deref().ok_or_else(|| Error::Usage("--filter-only needs --reference".to_owned()))?;
    let size = [film.width, film.height];
    let plan = FilterPlan {
        path: image,
        film: &film,
        scene: SceneInfo {
            path: image.display().to_string(),
            name: name(image),
            width: size[0],
            height: size[1],
            judged: None,
        },
        candidates: candidates(args, image)?,
        repeats: args.repeats,
        order_seed: args.order_seed,
        budget: args.budget(),
        reference: reference::read(file, size, None)?,
    };
    let gpu = open(args)?;
    let folder = Folder::open(&args.output)?;
    let found = watched(args, &folder, |watch| measure_filters(&gpu, &plan, watch))?;
    fail_on_messages(&gpu)?;
    finish(args, &folder, found, 0)
}

/// Every filter, with its defaults and with the options of each variant.
fn candidates(args: &Args, image: &Path) -> Result<Vec<FilterCandidate>> {
    let mut all = Vec::new();
    let own = (!args.with.trim().is_empty()).then_some(args.with.as_str());
    for variant in std::iter::once(None).chain(args.variants.iter().map(Some)) {
        for &filter in &args.denoise {
            let words = [own.unwrap_or_default(), variant.map_or("", String::as_str)].map(str::trim);
            all.push(candidate(image, filter, words)?);
        }
    }
    Ok(all)
}

fn candidate(image: &Path, filter: Method, [shared, variant]: [&str; 2]) -> Result<FilterCandidate> {
    let words = format!("{shared} {variant}");
    let settings = overrides(&words)?.settings(FilterSettings::default());
    settings.validate()?;
    let options = Some(variant.to_owned()).filter(|variant| !variant.is_empty());
    let path = quoted(&image.display().to_string());
    let words = words.split_whitespace().map(|word| format!(" {word}")).collect::<String>();
    let command = format!("tallow filter {path} --filter {}{words} -o point.exr", filter.name());
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
