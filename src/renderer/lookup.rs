//! Supersampling of filtered light (GIF, section 3.2).
use super::{Renderer, workgroup};
use crate::error::{Error, Result};
use crate::gpu::layout::{Guide, PathPush, vec3, vec4};
use crate::gpu::{Buffer, FrameResources, Location, PassTime};
use crate::stage::{PerThread, lookup};

/// Eye rays of a pixel in a dispatch: drivers kill what runs for seconds, and software devices end loops early
/// (`glsl/shared/rounds.glsl`).
const RAYS_AT_ONCE: u32 = 32;

impl Renderer {
    /// Indirect light of every pixel, row-major, and what each pass took. The guide rays through the pixels' centres, which
    /// meet `guide`, carry `filtered` (light before albedo; w = 0 where there is none); `eye_rays` further rays per pixel,
    /// those of the pixel's first samples, take the light of the guide ray that is most alike in normal and depth among
    /// the four nearest, times the albedo that they meet themselves. Rays to the sky and to smooth surfaces bring none.
    ///
    /// Source: Bauszat, Eisemann and Magnor, "Guided Image Filtering for Interactive High-quality Global Illumination",
    /// EGSR 2011.
    ///
    /// # Errors
    /// [`Error::Usage`] when there are no eye rays or not as many guide rays as pixels, [`Error::Device`].
    pub fn look_up(&self, guide: &[Guide], filtered: &[vec4], eye_rays: u32) -> Result<(Vec<vec3>, Vec<PassTime>)> {
        let pixels = self.settings.pixels();
        if eye_rays == 0 || guide.len() != pixels || filtered.len() != pixels {
            let (guides, lights) = (guide.len(), filtered.len());
            return Err(Error::Usage(format!(
                "{eye_rays} eye rays look up {guides} guide rays with {lights} filtered values: choose at least 1, and \
                 as many guide rays as the film has pixels, {pixels}"
            )));
        }
        let gpu = &self.gpu;
        let kernel = PerThread::new(gpu, &self.effects, workgroup(gpu))?;
        let guide = Buffer::from_slice(gpu, "guide rays", guide)?;
        let filtered = Buffer::from_slice(gpu, "filtered", filtered)?;
        let indirect = Buffer::new(gpu, "indirect", pixels, Location::Device)?;
        let (mut frame, mut times) = (FrameResources::new(gpu)?, Vec::new());
        times.extend(gpu.run(&mut frame, |rec| rec.fill(&indirect, 0))?);
        for first_sample in (0..eye_rays).step_by(RAYS_AT_ONCE as usize) {
            let samples = RAYS_AT_ONCE.min(eye_rays - first_sample);
            let push = PathPush { first_sample: self.push.first_sample + first_sample, samples, ..self.push };
            let push = PathPush { pixels: pixels as u32, ..push };
            times.extend(gpu.run(&mut frame, |rec| {
                lookup::record(&kernel, rec, &self.scene, &guide, &filtered, &indirect, &push)
            })?);
        }
        let light = indirect.read()?.into_iter().map(|sum| sum.map(|v| v / eye_rays as f32));
        Ok((light.collect(), times))
    }
}
