//! What both forms of `guided` read of an image. Kernel: `glsl/guided/guided_pack.comp`.
use crate::denoise::filter::Planes;
use crate::denoise::filter::pixel::{known_channel, reflects};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{Guide, GuidedPackPush, NONE, PixelLight, vec4};
use crate::math::srgb::luminance;
use crate::shaders::guided_pack::{self, DARKEST};
use crate::shaders::shared::sampled_albedo;
use glam::{DVec4, Vec3};

/// Columns of a plane that lie beside each other, and rows of a strip, as in `glsl/shared/tiled_index.glsl`.
pub const BESIDE: u32 = 8;

/// What the guide of a pixel consists of.
#[derive(Clone, Copy, Debug)]
pub struct Channels {
    count: u32,
    extent: f32,
    with_albedo: bool,
}

impl Channels {
    /// Those of `guided`, as published: `count` is 1 (grey normal), 3 (normal) or 4 (normal, and depth in units of `extent`).
    pub fn new(count: u32, extent: f32) -> Self {
        Self { count, extent, with_albedo: false }
    }

    /// The same, with normals whose length tells the albedo, for light that was divided by it.
    pub fn with_albedo(self) -> Self {
        Self { with_albedo: true, ..self }
    }

    /// Twin of `guided_pack.comp`.
    pub fn of(&self, g: &Guide) -> DVec4 {
        let n = Vec3::from(g.normal.map(known_channel)) * 0.5 * self.length_of_normal(g);
        let depth = known_channel(g.depth * (1.0 / self.extent));
        match self.count {
            1 => glam::vec4((n.x + n.y + n.z) / 3.0, 0.0, 0.0, 0.0),
            3 => n.extend(0.0),
            _ => n.extend(depth),
        }
        .as_dvec4()
    }

    fn length_of_normal(&self, g: &Guide) -> f32 {
        match self.with_albedo && g.material != NONE && reflects(&g.albedo) {
            true => 1.0 + DARKEST / luminance(g.albedo.map(known_channel)).max(DARKEST),
            false => 1.0,
        }
    }
}

/// What the kernels read of an image.
pub struct Packed {
    /// Where no plane holds the albedo of samples, and where one does.
    kernels: [Kernel<guided_pack::Bind<'static>>; 2],
    no_light: Buffer<PixelLight>,
    /// Radiance and the samples behind it, all zero where nothing is known.
    pub colour: Buffer<vec4>,
    /// The guide.
    pub channels: Buffer<vec4>,
    depth_scale: f32,
}

impl Packed {
    /// For images of (width, height).
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when they do not fit.
    pub fn new(gpu: &Gpu, guide: Channels, [width, height]: [u32; 2]) -> Result<Self> {
        let Channels { count: channels, extent, with_albedo } = guide;
        let kernel = |has_light: bool| {
            let sampled_albedo = sampled_albedo::Constants { has_light: has_light && with_albedo };
            Kernel::new(gpu, &guided_pack::Constants { channels, with_albedo, sampled_albedo })
        };
        let pixels = width.next_multiple_of(BESIDE) as usize * height as usize;
        Ok(Self {
            kernels: [kernel(false)?, kernel(true)?],
            no_light: Buffer::new(gpu, "no light", 1, Location::Device)?,
            colour: Buffer::new(gpu, "colour", pixels, Location::Device)?,
            channels: Buffer::new(gpu, "channels", pixels, Location::Device)?,
            depth_scale: 1.0 / extent,
        })
    }

    /// radiance\[P\], guide\[P\], light\[P\] -> colour\[P\], channels\[P\]
    pub fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let (radiance, guide) = (&planes.radiance, &planes.guide);
        let (kernel, light) = match &planes.light {
            Some(light) => (&self.kernels[1], light),
            None => (&self.kernels[0], &self.no_light),
        };
        let sampled_albedo = sampled_albedo::Bind { light };
        let bind =
            guided_pack::Bind { radiance, guide, colour: &self.colour, channels: &self.channels, sampled_albedo };
        let push = GuidedPackPush { size: planes.size, depth_scale: self.depth_scale, ..Default::default() };
        rec.dispatch(kernel, bind, &push, kernel.groups(planes.size))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_normal_is_the_longer_the_darker_the_surface() {
        let plain = Channels::new(3, 1.0);
        let length = |channels: Channels, albedo: f32, material: u32| {
            let g = Guide { normal: [0.0, 0.0, 1.0], albedo: [albedo; 3], material, ..Guide::default() };
            2.0 * channels.of(&g).truncate().length() as f32
        };
        let lengths = [0.0, 0.02, 0.16, 0.64, f32::NAN].map(|albedo| length(plain.with_albedo(), albedo, 0));
        let expected = [1.0, 2.0, 2.0, 1.25, 1.0];
        assert!(lengths.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{lengths:?}");
        // Where a lens blurs, and in `guided` by itself.
        assert_eq!([length(plain.with_albedo(), 0.16, NONE), length(plain, 0.16, 0)], [1.0; 2]);
    }
}
