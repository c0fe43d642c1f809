//! Open Image Denoise, the learned filter that others are measured against. It runs on the host's processor, where it is installed.
use super::Planes;
use super::pixel::sampled_albedo;
use crate::error::Result;
use crate::gpu::{Oidn, OidnInput, Texels};
use crate::layout::{Guide, vec3, vec4};
use crate::settings::{choices, settings};
use std::mem::offset_of;
use std::time::{Duration, Instant};

choices! {
    /// What Open Image Denoise spends on an image. The numbers are its own.
    pub enum OidnQuality {
        /// For previews.
        Fast = 4,
        /// Between the two.
        Balanced = 5,
        /// For final images.
        #[default]
        High = 6,
    }
}

settings! {
    /// What Open Image Denoise alone can be told.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct OidnSettings {
        /// What is given of them.
        OidnOverrides {
            /// What Open Image Denoise spends on an image.
            oidn_quality: OidnQuality = OidnQuality::High, ..;
        }
    }
}

/// Host memory that a pixel takes: its radiance before and after, its surface, and what version 2.5.1 was seen to take at high
/// quality (578 to 600 bytes at 512 x 512 to 2048 x 2048).
pub(super) const HOST_BYTES: u64 = 2 * size_of::<vec4>() as u64 + size_of::<Guide>() as u64 + LIBRARY_BYTES;
const LIBRARY_BYTES: u64 = 600;

/// What was done, and how long it took by the host's clock.
type Took = (&'static str, Duration);

/// radiance\[P\], guide\[P\] -> output\[P\], through host memory. Albedo and normals are given where any pixel has one. Pixels
/// without a sample, or with what is no number, are black before.
///
/// # Errors
/// [`crate::error::Error::Device`] where the library is not installed, or with its own message.
pub fn filter(settings: OidnSettings, planes: &Planes) -> Result<Vec<Took>> {
    let begun = Instant::now();
    let oidn = Oidn::open()?;
    let opened = begun.elapsed();
    let (radiance, guide) = (read_radiance(planes)?, read_guide(planes)?);
    let any = |of: fn(&Guide) -> vec3| guide.iter().any(|g| of(g) != [0.0; 3]);
    let input = OidnInput {
        size: planes.size,
        colour: Texels::new(&radiance, 0),
        albedo: any(|g| g.albedo).then(|| Texels::new(&guide, offset_of!(Guide, albedo))),
        normal: any(|g| g.normal).then(|| Texels::new(&guide, offset_of!(Guide, normal))),
        quality: settings.oidn_quality as i32,
    };
    let mut output = vec![[0.0, 0.0, 0.0, 1.0]; radiance.len()];
    let begun = Instant::now();
    oidn.filter(&input, &mut output)?;
    let filtered = begun.elapsed();
    planes.output.write(0, &output)?;
    Ok(vec![("oidn start (wall clock)", opened), ("oidn (wall clock)", filtered)])
}

/// Surfaces with the albedo of the samples, where a pixel has any.
fn read_guide(planes: &Planes) -> Result<Vec<Guide>> {
    let mut guide = planes.guide.read()?;
    let Some(light) = &planes.light else { return Ok(guide) };
    for ((guide, light), radiance) in guide.iter_mut().zip(light.read()?).zip(planes.radiance.read()?) {
        guide.albedo = sampled_albedo(&light, radiance[3], guide.albedo);
    }
    Ok(guide)
}

fn read_radiance(planes: &Planes) -> Result<Vec<vec4>> {
    let mut radiance = planes.radiance.read()?;
    let unknown = |pixel: &&mut vec4| pixel[3] == 0.0 || !pixel.iter().all(|v| v.is_finite());
    radiance.iter_mut().filter(unknown).for_each(|pixel| *pixel = [0.0; 4]);
    Ok(radiance)
}
