//! Settings on the command line, which replace those of the scene file.
use super::common::with_ranges;
use crate::allocate::{POLICIES, Placing, Policy};
use crate::render::settings::{AllocateOverrides, Film, Render, Sequence, Settings};
use clap::ValueEnum;
use clap::builder::PossibleValue;

/// Settings given on the command line.
#[derive(clap::Args, Clone, Debug, Default, PartialEq)]
#[command(next_help_heading = "Settings", mut_args(with_ranges(Settings::default().entries())))]
pub struct Overrides {
    /// Settings of the film.
    #[command(flatten)]
    pub film: Film,
    /// Settings of the paths.
    #[command(flatten)]
    pub render: Render,
    /// Settings of the random numbers.
    #[command(flatten)]
    pub sequence: Sequence,
    /// Settings of sample allocation.
    #[command(flatten, next_help_heading = "Where samples go")]
    pub allocate: AllocateOverrides,
}

impl ValueEnum for &'static Policy {
    fn value_variants<'a>() -> &'a [Self] {
        POLICIES
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        Some(PossibleValue::new(self.name).help(self.about))
    }
}

impl Overrides {
    /// Replaces the settings that were given. A noise threshold without a learning policy selects the first such policy,
    /// `variance`.
    pub fn apply(&self, settings: &mut Settings) {
        let learns = |row: &Policy| row.placing == Placing::Learning;
        let threshold = self.allocate.noise_threshold.is_some_and(|e| e > 0.0);
        if threshold && !learns(settings.allocate.policy) {
            settings.allocate.policy = POLICIES.iter().find(|row| learns(row)).expect("the policy variance learns");
        }
        self.film.apply(settings);
        self.render.apply(settings);
        self.sequence.apply(settings);
        self.allocate.apply(&mut settings.allocate);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allocate::both::{self, BothSettings};
    use crate::allocate::geometry::GeometrySettings;
    use crate::allocate::variance::VarianceSettings;
    use crate::render::settings::{Allocate, PixelFilter, Sampler, Split};
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
            --clamp-indirect 6 --indirect-stride 2 --seed 8 --filter tent --sampler independent --split soft --allocate both --min-spp 11 --max-spp 12 \
            --rounds 13 --window 9 --sigma-normal 0.1 --sigma-position 0.2 --luminance-floor=-1 \
            --noise-threshold 0.3 --filtered 0.4";
        apply(words, &mut settings);
        let allocate = Allocate {
            policy: &both::ROW,
            min_spp: 11,
            max_spp: 12,
            rounds: 13,
            noise_threshold: 0.3,
            geometry: GeometrySettings { window: 9, sigma_normal: 0.1, sigma_position: 0.2 },
            variance: VarianceSettings { luminance_floor: -1.0 },
            both: BothSettings { filtered: 0.4 },
        };
        let expected = Settings {
            width: 1,
            height: 2,
            spp: 3,
            first_sample: 10,
            max_depth: 4,
            roulette_depth: 5,
            clamp_indirect: 6.0,
            indirect_stride: 2,
            seed: 8,
            split: Split::Soft,
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
        assert!(help("sigma-normal").unwrap().to_string().ends_with(" [a finite number above 0] [default: 0.35]"));
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
            settings.validate().map(|()| settings.allocate.policy.name)
        };
        assert_eq!(policy("--noise-threshold 0.1").unwrap(), "variance");
        assert_eq!(policy("--noise-threshold 0.1 --allocate both").unwrap(), "both");
        assert!(policy("--noise-threshold 0.1 --allocate geometry").is_err());
    }
}
