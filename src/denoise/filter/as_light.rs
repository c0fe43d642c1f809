//! Keeps light from becoming negative: the last pass of filters that overshoot. Kernel: `glsl/filter/as_light.comp`.
use super::pixel::known_radiance;
use super::{FilterInput, Planes};
use crate::error::Result;
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::layout::{SizePush, vec4};
use crate::shaders::as_light::{Bind, REACH};
use glam::{Vec3, Vec4, Vec4Swizzles};

/// The kernel.
pub struct AsLight(Kernel<Bind<'static>>);

impl AsLight {
    /// For images of any size.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self(Kernel::new(gpu, &Default::default())?))
    }

    /// radiance\[P\], output\[P\] -> output\[P\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the image is too large for the device.
    pub fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let bind = Bind { radiance: &planes.radiance, filtered: &planes.output };
        let push = SizePush { size: planes.size, ..Default::default() };
        rec.dispatch(&self.0, bind, &push, self.0.groups(planes.size))
    }
}

/// The twin: `filtered` with no light below 0 and below that of all known pixels around in `input`.
pub fn as_light(input: &FilterInput, filtered: Vec<vec4>) -> Vec<vec4> {
    let [width, height] = input.size().map(i64::from);
    let least = |i: i64| {
        let around = (-REACH..=REACH).flat_map(|v| (-REACH..=REACH).map(move |u| (u, v)));
        let taps = around.map(|(u, v)| {
            let [x, y] = [(i % width + i64::from(u), width), (i / width + i64::from(v), height)];
            y.0.clamp(0, y.1 - 1) * width + x.0.clamp(0, x.1 - 1)
        });
        taps.filter_map(|tap| known_radiance(input.radiance[tap as usize])).fold(Vec3::ZERO, Vec3::min)
    };
    let kept = |(i, result): (i64, vec4)| Vec4::from(result).xyz().max(least(i)).extend(result[3]).into();
    (0..).zip(filtered).map(kept).collect()
}
