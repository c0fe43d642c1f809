//! Settings that the command line gives over those of the scene file.
use super::common::with_ranges;
use crate::allocate::{POLICIES, Placing};
use crate::render::settings::{Allocate, PixelFilter, Sampler, Settings};
use clap::builder::{PossibleValue, PossibleValuesParser};

/// Settings given on the command line.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Settings", mut_args(with_ranges(Settings::default().entries())))]
pub struct Overrides {
    /// Film width in pixels
    #[arg(long, value_name = "N")]
    pub width: Option<u32>,
    /// Film height in pixels
    #[arg(long, value_name = "N")]
    pub height: Option<u32>,
    /// Samples per pixel; where samples are placed, their mean
    #[arg(long, visible_alias = "budget-spp", value_name = "N")]
    pub spp: Option<u32>,
    /// Index of every pixel's first sample: renders of disjoint ranges can be merged
    #[arg(long, value_name = "N")]
    pub first_sample: Option<u32>,
    /// Path edges: 2 is direct light, 3 one bounce of indirect light
    #[arg(long, value_name = "N")]
    pub max_depth: Option<u32>,
    /// Edges after which Russian roulette starts; 0 is off
    #[arg(long, value_name = "N")]
    pub roulette_depth: Option<u32>,
    /// Limit of a sample's indirect light, largest channel; 0 is off, others bias the image
    #[arg(long, value_name = "N")]
    pub clamp_indirect: Option<f32>,
    /// Chooses the random sequence
    #[arg(long, value_name = "N")]
    pub seed: Option<u32>,
    /// Pixel filter
    #[arg(long, value_enum)]
    pub filter: Option<PixelFilter>,
    /// Random numbers
    #[arg(long, value_enum)]
    pub sampler: Option<Sampler>,
    /// Where samples go.
    #[command(flatten)]
    pub allocate: AllocateOverrides,
}

/// The `[allocate]` table given on the command line.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Where samples go")]
pub struct AllocateOverrides {
    /// Policy [default: uniform; variance with --noise-threshold]
    #[arg(long, value_name = "POLICY", value_parser = policies())]
    pub allocate: Option<String>,
    /// Samples that every pixel gets before any is placed
    #[arg(long, value_name = "N")]
    pub min_spp: Option<u32>,
    /// Samples that no pixel exceeds; 0 is off. Of threshold: the rounds until chance decides; 0 is --spp
    #[arg(long, value_name = "N")]
    pub max_spp: Option<u32>,
    /// Rounds that the budget is spread over; 0: one, of policies that learn one for every 2 samples a pixel, up to 4
    #[arg(long, value_name = "N")]
    pub rounds: Option<u32>,
    /// Edge of the square of pixels whose geometry is compared
    #[arg(long, value_name = "N")]
    pub window: Option<u32>,
    /// Difference of unit normals that counts as e^-1 alike
    #[arg(long, value_name = "X")]
    pub sigma_normal: Option<f32>,
    /// Distance of hits that counts as e^-1 alike, in diagonals of the scene
    #[arg(long, value_name = "X")]
    pub sigma_position: Option<f32>,
    /// Luminance added before noise is compared with it; negative: noise counts by itself
    #[arg(long, value_name = "X")]
    pub luminance_floor: Option<f32>,
    /// Stop when every pixel's relative error is estimated below this, or at --max-spp (else --spp); 0 is off
    #[arg(long, value_name = "E")]
    pub noise_threshold: Option<f32>,
    /// Share of the variance that a filter will remove where neighbours are alike; 0 is none
    #[arg(long, value_name = "X")]
    pub filtered: Option<f32>,
}

fn policies() -> PossibleValuesParser {
    POLICIES.iter().map(|row| PossibleValue::new(row.name).help(row.about)).collect::<Vec<_>>().into()
}

impl AllocateOverrides {
    fn apply(&self, settings: &mut Allocate) {
        let learns = settings.placing() == Placing::Learning;
        if self.allocate.is_none() && self.noise_threshold.is_some_and(|e| e > 0.0) && !learns {
            settings.policy = "variance".into();
        }
        set(&mut settings.policy, self.allocate.clone());
        set(&mut settings.min_spp, self.min_spp);
        set(&mut settings.max_spp, self.max_spp);
        set(&mut settings.rounds, self.rounds);
        set(&mut settings.window, self.window);
        set(&mut settings.sigma_normal, self.sigma_normal);
        set(&mut settings.sigma_position, self.sigma_position);
        set(&mut settings.luminance_floor, self.luminance_floor);
        set(&mut settings.noise_threshold, self.noise_threshold);
        set(&mut settings.filtered, self.filtered);
    }
}

impl Overrides {
    /// Replaces those settings that were given.
    pub fn apply(&self, settings: &mut Settings) {
        set(&mut settings.width, self.width);
        set(&mut settings.height, self.height);
        set(&mut settings.spp, self.spp);
        set(&mut settings.first_sample, self.first_sample);
        set(&mut settings.max_depth, self.max_depth);
        set(&mut settings.roulette_depth, self.roulette_depth);
        set(&mut settings.clamp_indirect, self.clamp_indirect);
        set(&mut settings.seed, self.seed);
        set(&mut settings.filter, self.filter);
        set(&mut settings.sampler, self.sampler);
        self.allocate.apply(&mut settings.allocate);
    }
}

fn set<T>(setting: &mut T, given: Option<T>) {
    if let Some(value) = given {
        *setting = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        overrides: Overrides,
    }

    fn apply(words: &str, settings: &mut Settings) {
        let words = std::iter::once("render").chain(words.split_whitespace());
        Command::parse_from(words).overrides.apply(settings);
    }

    #[test]
    fn every_setting_given_replaces_that_of_the_scene_and_no_other() {
        let mut settings = Settings { spp: 7, ..Settings::default() };
        apply("", &mut settings);
        assert_eq!(settings, Settings { spp: 7, ..Settings::default() });
        let words = "--width 1 --height 2 --budget-spp 3 --first-sample 10 --max-depth 4 --roulette-depth 5 \
            --clamp-indirect 6 --seed 8 --filter tent --sampler independent --allocate both --min-spp 11 --max-spp 12 \
            --rounds 13 --window 9 --sigma-normal 0.1 --sigma-position 0.2 --luminance-floor=-1 \
            --noise-threshold 0.3 --filtered 0.4";
        apply(words, &mut settings);
        let allocate = Allocate {
            policy: "both".into(),
            min_spp: 11,
            max_spp: 12,
            rounds: 13,
            window: 9,
            sigma_normal: 0.1,
            sigma_position: 0.2,
            luminance_floor: -1.0,
            noise_threshold: 0.3,
            filtered: 0.4,
        };
        let expected = Settings {
            width: 1,
            height: 2,
            spp: 3,
            first_sample: 10,
            max_depth: 4,
            roulette_depth: 5,
            clamp_indirect: 6.0,
            seed: 8,
            filter: PixelFilter::Tent,
            sampler: Sampler::Independent,
            allocate,
        };
        assert_eq!(settings, expected);
        assert!(settings.validate().is_ok());
    }

    #[test]
    fn help_gives_range_and_default_of_every_option() {
        let command = Command::command();
        let help = |name: &str| command.get_arguments().find(|a| a.get_long() == Some(name)).unwrap().get_help();
        assert_eq!(help("width").unwrap().to_string(), "Film width in pixels [1 to 16384] [default: 512]");
        assert!(help("sigma-normal").unwrap().to_string().ends_with(" [a number above 0] [default: 0.35]"));
        assert!(help("filter").unwrap().to_string().ends_with(" [default: box]"));
        for name in command.get_arguments().filter_map(|a| a.get_long()).filter(|&name| name != "help") {
            let text = help(name).unwrap().to_string();
            assert_eq!(text.matches("[default: ").count(), 1, "{name}: {text}");
        }
    }

    #[test]
    fn a_threshold_needs_a_policy_that_learns() {
        let policy = |words| {
            let mut settings = Settings::default();
            apply(words, &mut settings);
            settings.validate().map(|()| settings.allocate.policy)
        };
        assert_eq!(policy("--noise-threshold 0.1").unwrap(), "variance");
        assert_eq!(policy("--noise-threshold 0.1 --allocate both").unwrap(), "both");
        assert!(policy("--noise-threshold 0.1 --allocate geometry").is_err());
    }
}
