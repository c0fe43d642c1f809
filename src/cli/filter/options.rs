//! What can be set about layers and filters.
use crate::cli::common::with_ranges;
use crate::denoise::filter::{AtrousForm, FilterSettings, GuidedSums, WaveletBasis};
use crate::image::aov::{Aov, Names};

/// Names of layers, for those that are not found, or not the right ones.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Layers (found by their usual names when not given)")]
pub struct Layers {
    /// Radiance; the filtered image takes its place
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
    /// Samples per pixel
    #[arg(long, value_name = "NAME")]
    pub samples: Option<String>,
}

impl Layers {
    /// Those that were given.
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

/// Settings given on the command line; see [`FilterSettings`] for ranges and defaults.
#[derive(clap::Args, Clone, Debug, Default)]
#[command(next_help_heading = "Filter settings", mut_args(with_ranges(FilterSettings::default().entries().into())))]
pub struct Overrides {
    /// Scale of radiance [default: the image's largest]
    #[arg(long, value_name = "N")]
    pub intensity: Option<f32>,
    /// Scale of distances in world units [default: the diagonal of what is seen]
    #[arg(long, value_name = "N")]
    pub extent: Option<f32>,
    /// Levels of the wavelet filters
    #[arg(long, value_name = "N")]
    pub levels: Option<u32>,
    /// Radiance difference that counts as an edge, in units of --intensity; inf switches it off
    #[arg(long, value_name = "N")]
    pub sigma_rt: Option<f32>,
    /// Difference of normals that counts as an edge; inf switches it off
    #[arg(long, value_name = "N")]
    pub sigma_n: Option<f32>,
    /// Distance that counts as an edge, in units of --extent; inf switches it off
    #[arg(long, value_name = "N")]
    pub sigma_x: Option<f32>,
    /// Which form of the weights atrous uses
    #[arg(long, value_enum)]
    pub form: Option<AtrousForm>,
    /// First level on which atrous looks at radiance
    #[arg(long, value_name = "N")]
    pub rt_from_level: Option<u32>,
    /// Leave rejected weight with the centre pixel
    #[arg(long)]
    pub conserve_energy: bool,
    /// Pixels from the centre of a window of guided or bilateral to its border
    #[arg(long, value_name = "N")]
    pub radius: Option<u32>,
    /// Channels of guided's guide: 1 (grey normal), 3 (normal) or 4 (normal and depth)
    #[arg(long, value_name = "N")]
    pub channels: Option<u32>,
    /// Variance of the guide below which guided sees no edge: one number, or one per channel
    #[arg(long, value_name = "N[,N,N,N]", value_parser = per_channel)]
    pub eps: Option<[f32; 4]>,
    /// How guided sums over windows
    #[arg(long, value_enum)]
    pub sums: Option<GuidedSums>,
    /// Standard deviations of a pixel's luminance that count as an edge for svgf
    #[arg(long, value_name = "N")]
    pub sigma_l: Option<f32>,
    /// Wavelets of wavelet
    #[arg(long, value_enum)]
    pub basis: Option<WaveletBasis>,
}

/// One number for all channels, or four.
fn per_channel(text: &str) -> Result<[f32; 4], String> {
    let numbers: Result<Vec<f32>, _> = text.split(',').map(str::parse).collect();
    match numbers.as_deref() {
        Ok([n]) => Ok([*n; 4]),
        Ok(&[a, b, c, d]) => Ok([a, b, c, d]),
        _ => Err("expected one number, or four with commas between them".to_owned()),
    }
}

impl Overrides {
    /// The settings of an image's own, replaced where others were given.
    pub fn settings(&self, own: FilterSettings) -> FilterSettings {
        FilterSettings {
            intensity: self.intensity.unwrap_or(own.intensity),
            extent: self.extent.unwrap_or(own.extent),
            levels: self.levels.unwrap_or(own.levels),
            sigma_rt: self.sigma_rt.unwrap_or(own.sigma_rt),
            sigma_n: self.sigma_n.unwrap_or(own.sigma_n),
            sigma_x: self.sigma_x.unwrap_or(own.sigma_x),
            form: self.form.unwrap_or(own.form),
            rt_from_level: self.rt_from_level.unwrap_or(own.rt_from_level),
            conserve_energy: self.conserve_energy || own.conserve_energy,
            radius: self.radius.unwrap_or(own.radius),
            channels: self.channels.unwrap_or(own.channels),
            eps: self.eps.unwrap_or(own.eps),
            sums: self.sums.unwrap_or(own.sums),
            sigma_l: self.sigma_l.unwrap_or(own.sigma_l),
            basis: self.basis.unwrap_or(own.basis),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::settings::entry::Entry;
    use crate::render::settings::{PixelFilter, Sampler};
    use clap::{Args, Command};

    #[test]
    fn help_gives_the_default_of_every_option_that_takes_a_value() {
        let command = Overrides::augment_args(Command::new("filter"));
        let all = command.get_arguments().filter(|a| a.get_action().takes_values());
        let texts: Vec<_> = all.map(|a| a.get_help().unwrap().to_string()).collect();
        assert_eq!(texts.iter().filter(|t| t.matches("[default: ").count() == 1).count(), 14, "{texts:#?}");
        assert_eq!(texts[2], "Levels of the wavelet filters [1 to 10] [default: 5]");
        assert!(texts[0].ends_with("[default: the image's largest] [a finite number above 0]"), "{}", texts[0]);
    }
    fn named_alike<T: clap::ValueEnum + serde::Serialize>() -> bool {
        let option = |v: &T| v.to_possible_value().map(|word| word.get_name().to_owned());
        T::value_variants().iter().all(|v| option(v) == Some(Entry::one_of("", v).value))
    }

    #[test]
    fn messages_name_choices_as_options_do() {
        assert!(named_alike::<PixelFilter>() && named_alike::<Sampler>());
        assert!(named_alike::<AtrousForm>() && named_alike::<GuidedSums>() && named_alike::<WaveletBasis>());
    }
}
