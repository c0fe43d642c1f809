//! Every filter's parameters: default, unit and range in one place.
use super::{FilterInput, Scales};
use crate::error::Result;
use crate::layout::vec4;
use crate::render::settings::entry::{self, Entry};
use serde::Serialize;

/// How EAW's edge-stopping weights are computed: the paper's listing and its equations differ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum AtrousForm {
    /// As the listing: squared differences, that of normals divided by the squared distance between taps.
    #[default]
    Listing,
    /// Squared differences, alike on every level.
    Squared,
    /// As equation 5 prints it: the norm of the difference, not squared.
    Printed,
}

/// How `guided` sums over windows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum GuidedSums {
    /// Block by block, about local means: nothing cancels.
    #[default]
    Blocks,
    /// Summed-area tables, as published: digits are lost where images are large or guides far away. Images of one
    /// million pixels at most where storage buffers hold 128 MiB.
    Table,
}

/// The lattices of the decimated wavelets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum WaveletBasis {
    /// CDF(2,2), along rows and columns.
    #[default]
    Cdf22,
    /// Red-black, on the quincunx.
    RedBlack,
}

/// The parameters of all filters. A sigma of infinity switches its weight off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilterSettings {
    /// The radiance that `sigma_rt` counts in: the scale of the image's largest. Above 0; default 1.
    pub intensity: f32,
    /// World units that positions and depths are divided by: the extent of the scene. Above 0; default 1.
    pub extent: f32,
    /// Levels of the wavelet filters, 1 to 10; the footprint is 5 * 2^levels pixels wide. Default 5.
    pub levels: u32,
    /// Radiance difference that counts as an edge, in `intensity`; halved on every level. At least 0; default 1.
    pub sigma_rt: f32,
    /// Difference of unit normals that counts as an edge. At least 0; default 0.3.
    pub sigma_n: f32,
    /// Distance between hits that counts as an edge, in `extent`. At least 0; default 0.05.
    pub sigma_x: f32,
    /// Which of EAW's two descriptions `atrous` follows.
    pub form: AtrousForm,
    /// First level on which `atrous` uses the radiance weight, 0 to 10: EAW's 1 or 2 for images of which every 2nd or 4th
    /// pixel is known. Default 0: unknown pixels do without it anyway.
    pub rt_from_level: u32,
    /// Whether what a neighbour's weight falls short of stays with the centre pixel, so that no light is lost or gained.
    /// Default false, as published. EAW's own proposal, a channel of weights that normalises the last level alone, kept
    /// 0.79 to 1.04 of the light of five images where this keeps all of it, and less than no measure at all.
    pub conserve_energy: bool,
    /// Pixels from the centre of a window of `guided` or `bilateral` to its border, 0 to 4096. Default 24.
    pub radius: u32,
    /// Channels of `guided`'s guide: 1 (grey normal), 3 (normal) or 4 (normal and depth). Default 4.
    pub channels: u32,
    /// Variance of each channel (normal, depth) below which `guided` sees no edge; normals halved, depths in `extent`. At
    /// least 0; default 0.01, depth 0.02.
    pub eps: vec4,
    /// How `guided` sums over windows.
    pub sums: GuidedSums,
    /// Standard deviations of a pixel's luminance that count as an edge for `svgf`. At least 0; default 4.
    pub sigma_l: f32,
    /// The wavelets of `wavelet`.
    pub basis: WaveletBasis,
}

impl Default for FilterSettings {
    fn default() -> Self {
        Self {
            intensity: 1.0,
            extent: 1.0,
            levels: 5,
            sigma_rt: 1.0,
            sigma_n: 0.3,
            sigma_x: 0.05,
            form: AtrousForm::Listing,
            rt_from_level: 0,
            conserve_energy: false,
            radius: 24,
            channels: 4,
            eps: [0.01, 0.01, 0.01, 0.02],
            sums: GuidedSums::Blocks,
            sigma_l: 4.0,
            basis: WaveletBasis::Cdf22,
        }
    }
}

impl FilterSettings {
    /// The most levels of a wavelet filter.
    pub const MAX_LEVELS: u32 = 10;

    /// # Errors
    /// [`crate::error::Error::Usage`] with the parameter, its value and its range.
    pub fn validate(&self) -> Result<()> {
        entry::check(&self.entries())
    }

    /// Every parameter that is not a switch.
    pub fn entries(&self) -> [Entry; 14] {
        let scale = |name, v: f32| Entry::within(name, v, "a finite number above 0", v > 0.0 && v.is_finite());
        let sigma = |name, v: f32| Entry::within(name, v, "0 or more", v >= 0.0);
        let eps = self.eps.map(|e| e.to_string()).join(",");
        let usable = self.eps.iter().all(|e| e.is_finite() && *e >= 0.0);
        [
            scale("intensity", self.intensity),
            scale("extent", self.extent),
            Entry::whole("levels", self.levels, [1, Self::MAX_LEVELS]),
            sigma("sigma-rt", self.sigma_rt),
            sigma("sigma-n", self.sigma_n),
            sigma("sigma-x", self.sigma_x),
            Entry::one_of("form", &self.form),
            Entry::whole("rt-from-level", self.rt_from_level, [0, Self::MAX_LEVELS]),
            Entry::whole("radius", self.radius, [0, 4096]),
            Entry::within("channels", self.channels, "1, 3 or 4", [1, 3, 4].contains(&self.channels)),
            Entry::within("eps", eps, "finite numbers of 0 or more", usable),
            Entry::one_of("sums", &self.sums),
            sigma("sigma-l", self.sigma_l),
            Entry::one_of("basis", &self.basis),
        ]
    }

    /// The same with `intensity` and `extent` taken from an image: see [`Scales::applied_to`].
    pub fn scaled_to(self, input: &FilterInput) -> Self {
        Scales::of(input).applied_to(self)
    }
}
