//! What all filters can be told. What one filter alone reads is written in its own file.
use super::atrous::{AtrousOverrides, AtrousSettings};
use super::edge::{EdgeOverrides, EdgeSettings};
use super::footprint::{FootprintOverrides, FootprintSettings};
use super::guided::{GuidedOverrides, GuidedSettings};
use super::oidn::{OidnOverrides, OidnSettings};
use super::svgf::{SvgfOverrides, SvgfSettings};
use super::wavelet::{WaveletOverrides, WaveletSettings};
use super::{FilterInput, Scales};
use crate::error::Result;
use crate::scene::Scene;
use crate::settings::{entry, settings};
use glam::Vec3;

settings! {
    /// The settings of all filters.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct FilterSettings {
        /// What is given of them.
        FilterOverrides {
            ..edge: EdgeSettings, EdgeOverrides;
            ..footprint: FootprintSettings, FootprintOverrides;
            ..atrous: AtrousSettings, AtrousOverrides;
            ..guided: GuidedSettings, GuidedOverrides;
            ..wavelet: WaveletSettings, WaveletOverrides;
            ..svgf: SvgfSettings, SvgfOverrides;
            ..oidn: OidnSettings, OidnOverrides;
        }
    }
}

impl FilterSettings {
    /// # Errors
    /// [`crate::error::Error::Usage`] with the parameter, its value and its range.
    pub fn validate(&self) -> Result<()> {
        entry::check(&self.entries())
    }

    /// The defaults for frames of this scene: `extent` is the diagonal of its bounds, and stays 1 where it has no surface.
    pub fn for_scene(scene: &Scene) -> Self {
        let [low, high] = scene.bounds.map(Vec3::from);
        let diagonal = (high - low).length();
        Self::default().with(|s| s.edge.extent = if diagonal > 0.0 { diagonal } else { s.edge.extent })
    }

    /// These settings, changed.
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// The same with `intensity`, `usual` and `extent` of an image: see [`Scales::applied_to`].
    pub fn scaled_by(self, scales: &Scales) -> Self {
        Self { edge: scales.applied_to(self.edge), ..self }
    }

    /// The same, but of what is not at its default already: that was asked for, and stays. What is asked for at its default is not told apart.
    pub fn scaled_at_defaults(self, scales: &Scales) -> Self {
        let (own, usual, found) = (self.edge, EdgeSettings::default(), scales.applied_to(self.edge));
        let of = |read: fn(&EdgeSettings) -> f32| if read(&own) == read(&usual) { read(&found) } else { read(&own) };
        let edge =
            EdgeSettings { intensity: of(|e| e.intensity), usual: of(|e| e.usual), extent: of(|e| e.extent), ..own };
        Self { edge, ..self }
    }

    /// The same for this image.
    pub fn scaled_to(self, input: &FilterInput) -> Self {
        self.scaled_by(&Scales::of(input))
    }
}
