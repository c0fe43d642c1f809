//! Supersampling of filtered light (GIF, section 3.2). Kernel: `glsl/trace/guide_lookup.comp`. Twin: [`crate::twins::guide_lookup`].
use super::Renderer;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, FrameResources, Kernel, Location, PassTime};
use crate::layout::{Guide, PathPush, vec3, vec4};
use crate::render::settings::Settings;
use crate::shaders::guide_lookup::{Bind, Constants};
use crate::shaders::shared::frame;

/// Eye rays of a dispatch, unless there are more pixels: drivers kill what runs for seconds.
const RAYS_AT_ONCE: u32 = 1 << 22;
/// And of a pixel: software devices end loops early (`glsl/shared/loop_limit.glsl`).
const RAYS_OF_A_PIXEL: u32 = 8;

impl Renderer {
    /// Indirect light of every pixel, row-major, and what each pass took. The guide rays through the pixels' centres, which
    /// meet `guide`, carry `filtered` (light before albedo; w = 0 where there is none); `eye_rays` further rays per pixel,
    /// those of the pixel's first samples, take the light of the guide ray that is most alike in normal and depth among
    /// the four nearest, times the albedo that the samples keep ([`PixelLight::albedo`](crate::layout::PixelLight::albedo)). Rays to
    /// the sky bring none.
    ///
    /// Source: Bauszat, Eisemann and Magnor, "Guided Image Filtering for Interactive High-quality Global Illumination",
    /// EGSR 2011.
    ///
    /// # Errors
    /// [`Error::Usage`] when there are no eye rays or more than [`Settings::MAX_SPP`], or not as many guide rays as pixels, [`Error::Device`].
    pub fn look_up(&self, guide: &[Guide], filtered: &[vec4], eye_rays: u32) -> Result<(Vec<vec3>, Vec<PassTime>)> {
        let pixels = self.settings.pixels();
        if !(1..=Settings::MAX_SPP).contains(&eye_rays) || guide.len() != pixels || filtered.len() != pixels {
            let (guides, lights) = (guide.len(), filtered.len());
            return Err(Error::Usage(format!(
                "{eye_rays} eye rays look up {guides} guide rays with {lights} filtered values: choose 1 to {} eye \
                 rays, and as many guide rays as the film has pixels, {pixels}",
                Settings::MAX_SPP
            )));
        }
        let gpu = &self.gpu;
        let (effects, thread, traverse) = (self.effects, gpu.tuning().thread(), gpu.tuning().traverse(self.stack));
        let kernel = Kernel::new(gpu, &Constants { effects, thread, traverse })?;
        let guide = Buffer::from_slice(gpu, "guide rays", guide)?;
        let filtered = Buffer::from_slice(gpu, "filtered", filtered)?;
        let indirect = Buffer::new(gpu, "indirect", pixels, Location::Device)?;
        let (mut frame, mut times) = (FrameResources::new(gpu)?, Vec::new());
        // One of its own: what was accumulated, and what a next frame is compared with, may be of another.
        let camera = Buffer::from_slice(gpu, "camera", &[self.frame.constants.camera])?;
        times.extend(gpu.run(&mut frame, |rec| rec.fill(&indirect, 0))?);
        let at_once = (RAYS_AT_ONCE / pixels as u32).clamp(1, RAYS_OF_A_PIXEL);
        for first_sample in (0..eye_rays).step_by(at_once as usize) {
            let samples = at_once.min(eye_rays - first_sample);
            let first_sample = self.settings.first_sample.wrapping_add(first_sample);
            let push = PathPush {
                constants: self.frame.constants.path,
                first_pixel: 0,
                pixels: pixels as u32,
                first_sample,
                samples,
                ..Default::default()
            };
            times.extend(gpu.run(&mut frame, |rec| {
                let s = &self.frame.scene;
                let (scene, frame, ray_query) = (s.bind(), frame::Bind { camera: &camera }, s.bind_world());
                let (guides, filtered, indirect) = (&guide, &filtered, &indirect);
                let bind = Bind { scene, frame, ray_query, guides, filtered, indirect };
                rec.dispatch_threads(&kernel, bind, &push, push.pixels)
            })?);
        }
        let light = indirect.read()?.into_iter().map(|sum| sum.map(|v| v / eye_rays as f32));
        Ok((light.collect(), times))
    }
}
