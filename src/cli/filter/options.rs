//! Options of `tallow filter` for layers and filter settings.
use crate::cli::common::with_ranges;
use crate::denoise::filter::{FilterOverrides, FilterSettings, Method, readers};
use crate::error::Checked;
use crate::image::aov::{Aov, Names};
use clap::builder::PossibleValue;
use clap::{Arg, ValueEnum};
use std::sync::LazyLock;

/// Names of layers, for those that are not found or are not the right ones.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Layers (found by their usual names when not given)")]
pub struct Layers {
    /// Radiance; the filtered image takes its place. RGB are the channels R, G, B where no layer is called so
    #[arg(long, value_name = "NAME")]
    pub colour: Option<String>,
    /// Reflectance of the first hit
    #[arg(long, value_name = "NAME")]
    pub albedo: Option<String>,
    /// Normals, in any fixed space
    #[arg(long, value_name = "NAME")]
    pub normal: Option<String>,
    /// First hits, in any fixed space
    #[arg(long, value_name = "NAME")]
    pub position: Option<String>,
    /// Distances of first hits
    #[arg(long, value_name = "NAME")]
    pub depth: Option<String>,
    /// Variance of each pixel's mean
    #[arg(long, value_name = "NAME")]
    pub variance: Option<String>,
    /// Samples per pixel, or a number, which all pixels have
    #[arg(long, value_name = "NAME or N", value_parser = samples)]
    pub samples: Option<String>,
}

/// A number that counts no samples is not taken for a name.
fn samples(text: &str) -> Checked<String> {
    match text.parse::<f32>() {
        Ok(number) if !(number >= 1.0 && number.is_finite()) => {
            Err("expected a number of at least 1, or the name of a layer".to_owned())
        }
        _ => Ok(text.to_owned()),
    }
}

impl Layers {
    /// The names that were given.
    pub fn names(&self) -> Names {
        let Self { colour, albedo, normal, position, depth, variance, samples } = self;
        let all = [
            (Aov::Colour, colour),
            (Aov::Albedo, albedo),
            (Aov::Normal, normal),
            (Aov::Position, position),
            (Aov::Depth, depth),
            (Aov::Variance, variance),
            (Aov::Samples, samples),
        ];
        all.into_iter().filter_map(|(aov, name)| Some((aov, name.clone()?))).collect()
    }
}

/// Settings given on the command line.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(
    next_help_heading = "Filter settings",
    mut_args(with_readers),
    mut_args(with_ranges(FilterSettings::default().entries()))
)]
pub struct Overrides {
    /// Settings of all filters.
    #[command(flatten)]
    pub given: FilterOverrides,
}

impl Overrides {
    /// Returns `own`, the settings that suit the image, with those replaced that were given.
    pub fn settings(&self, own: FilterSettings) -> FilterSettings {
        let mut settings = own;
        self.given.apply(&mut settings);
        settings
    }
}

/// Adds the filters that read an option to its help.
fn with_readers(arg: Arg) -> Arg {
    match (arg.get_long().map(readers), arg.get_help()) {
        (Some(filters @ [_, ..]), Some(help)) => {
            let help = format!("{help} [read by: {}]", filters.join(", "));
            arg.help(help)
        }
        _ => arg,
    }
}

impl ValueEnum for Method {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<Method>> = LazyLock::new(|| Method::all().collect());
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name()).help(self.about()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::denoise::filter::{AtrousForm, GuidedSums, OidnQuality, WaveletBasis};
    use crate::render::settings::{PixelFilter, Sampler};
    use crate::settings::entry::Value;
    use clap::{Args, Command};

    #[test]
    fn help_gives_the_default_of_every_option_that_takes_a_value() {
        let command = Overrides::augment_args(Command::new("filter"));
        let all = command.get_arguments().filter(|a| a.get_action().takes_values());
        let texts: Vec<_> = all.map(|a| a.get_help().unwrap().to_string()).collect();
        assert!(texts.iter().all(|t| t.matches("[default: ").count() == 1), "{texts:#?}");
        let radius = "Pixels from the centre of a window to its border [read by: bilateral, guided, auto] [0 to 4096]";
        assert!(texts.iter().any(|t| t.starts_with(radius)), "{texts:#?}");
        let white = "[default: what 99.7 % of the image's lit pixels do not exceed] [a finite number above 0]";
        assert!(texts[0].ends_with(white), "{}", texts[0]);
    }

    #[test]
    fn every_layer_goes_by_its_own_option() {
        let option = |aov: &str| format!("--{aov}=of {aov}");
        let words = ["colour", "albedo", "normal", "position", "depth", "variance", "samples"];
        let matches = Layers::augment_args(Command::new("filter"))
            .try_get_matches_from([vec!["filter".to_owned()], words.map(option).to_vec()].concat())
            .unwrap();
        let names = <Layers as clap::FromArgMatches>::from_arg_matches(&matches).unwrap().names();
        let aovs = [Aov::Colour, Aov::Albedo, Aov::Normal, Aov::Position, Aov::Depth, Aov::Variance, Aov::Samples];
        assert_eq!(names, aovs.into_iter().zip(words.map(|word| format!("of {word}"))).collect());
    }

    fn named_alike<T: ValueEnum + Value>() -> bool {
        let option = |v: &T| v.to_possible_value().map(|word| word.get_name().to_owned());
        T::value_variants().iter().all(|v| option(v) == Some(v.text()))
    }

    #[test]
    fn messages_name_choices_as_options_do() {
        assert!(named_alike::<PixelFilter>() && named_alike::<Sampler>());
        assert!(named_alike::<AtrousForm>() && named_alike::<GuidedSums>() && named_alike::<WaveletBasis>());
        assert!(named_alike::<OidnQuality>());
    }
}
