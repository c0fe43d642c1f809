//! An image to be filtered.
use crate::error::{Error, Result};
use crate::layout::{Guide, vec3, vec4};

/// Radiance (or irradiance) and what is known of the surfaces behind it, row-major, linear.
#[derive(Clone, Debug, Default)]
pub struct FilterInput {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// rgb; w is the number of samples behind it. A pixel with w = 0, or with a NaN or an infinity, is unknown: no
    /// other pixel takes anything from it, and it is in-painted where the filter can.
    pub radiance: Vec<vec4>,
    /// One per pixel; zero normals, positions and depths where there is nothing to be seen or nothing is known. `auto` also reads
    /// `object`: [`NONE`](crate::layout::NONE) where nothing is hit; `material`: the same where a lens blurs what is hit, too, else any
    /// other number; and `albedo`, that which the light was divided by, 0 where it was divided by none.
    pub guide: Vec<Guide>,
    /// Variance of each pixel's mean, per channel.
    pub variance: Option<Vec<vec3>>,
}

impl FilterInput {
    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Other light on the same surfaces.
    pub fn with_radiance(&self, radiance: Vec<vec4>) -> Self {
        Self { radiance, guide: self.guide.clone(), variance: None, ..*self }
    }

    /// # Errors
    /// [`Error::Usage`] when the image is empty, or a plane has another number of pixels.
    pub fn validate(&self) -> Result<()> {
        let pixels = self.width as usize * self.height as usize;
        let planes = [
            ("radiance", self.radiance.len()),
            ("guide", self.guide.len()),
            ("variance", self.variance.as_ref().map_or(pixels, Vec::len)),
        ];
        match planes.iter().find(|(_, len)| *len != pixels || pixels == 0) {
            Some((name, len)) => Err(Error::Usage(format!(
                "the image to filter is {}x{} but its {name} has {len} pixels: every plane needs as many as the image, \
                 at least one",
                self.width, self.height
            ))),
            None => Ok(()),
        }
    }
}
