//! Every choice a user makes about a render. The command line and the tables of a scene file fill the same struct;
//! [`Settings::validate`] checks each by itself and together, [`Settings::check_most`] what only a render can say.
pub use crate::allocate::{Allocate, AllocateOverrides, Placing};
use crate::error::{Error, Result};
use crate::layout::{PIXEL_FILTER_BOX, PIXEL_FILTER_GAUSSIAN, PIXEL_FILTER_POINT, PIXEL_FILTER_TENT};
use crate::settings::{FINITE_FROM_0, choices, entry, settings};
use serde::{Deserialize, Serialize};

choices! {
    /// How a pixel's samples are spread over its surroundings. Widths are in pixels.
    pub enum PixelFilter {
        /// Uniform over the pixel.
        #[default]
        Box,
        /// Triangle of radius 1.
        Tent,
        /// Gaussian of standard deviation 0.5, cut at radius 2.
        Gaussian,
        /// The pixel's centre: samples differ in what happens beyond the first hit only.
        Point,
    }
}

impl PixelFilter {
    /// The PIXEL_FILTER_ constant that kernels know it by.
    pub fn code(self) -> u32 {
        match self {
            Self::Box => PIXEL_FILTER_BOX,
            Self::Tent => PIXEL_FILTER_TENT,
            Self::Gaussian => PIXEL_FILTER_GAUSSIAN,
            Self::Point => PIXEL_FILTER_POINT,
        }
    }
}

choices! {
    /// Where the random numbers come from.
    pub enum Sampler {
        /// Owen-scrambled Sobol points.
        #[default]
        Sobol,
        /// Independent numbers (PCG), the control.
        Independent,
    }
}

choices! {
    /// What the layers `direct` and `indirect` hold, and so what a filter gets where direct light is kept from it.
    pub enum Split {
        /// `indirect` holds light of two bounces and more, over the albedo of what is seen first.
        Indirect,
        /// `indirect` also holds what lamps and sky bring directly, which is noisy; `direct` the emission that is seen and what the point,
        /// spot or directional light brings that a place chooses most often, whose shadows are sharp, and whose noise is that of what edges
        /// and masks hide: all of it from 40 % of the choices on, none up to 20 %, and less where another lamp is about as likely.
        #[default]
        Soft,
    }
}

settings! {
    /// The settings of a render.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Settings {
        /// What is given of the `[film]` table.
        Film {
            /// Film width in pixels.
            width: u32 = 512, 1..=Self::MAX_EDGE;
            /// Film height in pixels.
            height: u32 = 512, 1..=Self::MAX_EDGE;
            /// Pixel filter.
            filter: PixelFilter = PixelFilter::Box, ..;
        }
        /// What is given of the `[render]` table.
        Render {
            /// Samples per pixel; where samples are placed, their mean.
            spp: u32 = 64, 1..=Self::MAX_SPP, [visible_alias = "budget-spp"];
            /// Path edges: 2 is direct light, 3 one bounce of indirect light.
            max_depth: u32 = 8, 1..=Self::MAX_DEPTH;
            /// Edges after which Russian roulette starts; 0 is off.
            roulette_depth: u32 = 0, ..;
            /// Limit of a sample's indirect light, largest channel; 0 is off, others bias the image.
            clamp_indirect: f32 = 0.0, FINITE_FROM_0;
            // Dammertz et al. 2010: 2 or 4.
            /// Trace the light that a filter takes (the layer `indirect`) for every N-th pixel along both axes only; --denoise fills
            /// in the others.
            indirect_stride: u32 = 1, 1..=Self::MAX_STRIDE;
            /// Chooses the random sequence.
            seed: u32 = 0, ..;
            /// Random numbers.
            sampler: Sampler = Sampler::Sobol, ..;
            /// What the layers `direct` and `indirect` hold: the colour is `direct` + `albedo` x `indirect`.
            split: Split = Split::Soft, ..;
        }
        /// Where in its sequence a pixel begins, which no scene file says.
        Sequence {
            /// Index of every pixel's first sample: renders of disjoint ranges can be merged.
            first_sample: u32 = 0, 0..=Self::MAX_SPP;
        }
        ..allocate: Allocate;
    }
}

impl Settings {
    /// The largest film edge in pixels.
    pub const MAX_EDGE: u32 = 16_384;
    /// The largest number of samples per pixel.
    pub const MAX_SPP: u32 = Allocate::MAX_SPP;
    /// The longest path in edges.
    pub const MAX_DEPTH: u32 = 1024;
    /// The largest distance between pixels whose indirect light is traced.
    pub const MAX_STRIDE: u32 = 8;

    /// # Errors
    /// [`crate::error::Error::Usage`] with the setting, its value and its range.
    pub fn validate(&self) -> Result<()> {
        entry::check(&self.entries())?;
        self.allocate.check_together()
    }

    /// Checks that no pixel is to get more samples than `max_spp`, which policies that place samples see to by themselves. The
    /// settings of a file need not pass, since options may choose another policy.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`].
    pub fn check_most(&self) -> Result<()> {
        let (most, spp, policy) = (self.allocate.max_spp, self.spp, self.allocate.policy.name);
        match self.allocate.is_even() && (1..spp).contains(&most) {
            true => Err(Error::Usage(format!(
                "max-spp is {most}: the policy {policy} gives every pixel the samples of spp, {spp}: lower that, or choose \
                 another policy"
            ))),
            false => Ok(()),
        }
    }

    /// In what they differ from others: the names, and both values.
    pub fn differences(&self, old: &Self) -> String {
        let pairs = old.entries().into_iter().zip(self.entries());
        let differ = pairs.filter(|(old, new)| old.value != new.value);
        let said = differ.map(|(old, new)| format!("{} was {}, now {}", old.name, old.value, new.value));
        said.collect::<Vec<_>>().join("; ")
    }

    /// Width and height of the film.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Number of pixels of the film.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}
