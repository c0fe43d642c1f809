//! Primary hits at pixel centres. Kernel: `glsl/guide.comp`. Twin: [`crate::reference::guide`].
use super::{groups, workgroup_constants};
use crate::error::Result;
use crate::frame::{DeviceScene, FilmTile};
use crate::gpu::layout::{Effects, PathPush};
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::shaders::guide::Bind;

/// The specialised kernel.
pub struct Guides {
    kernel: Kernel<Bind<'static>>,
    workgroup: u32,
}

impl Guides {
    /// Compiles the kernel for what `effects` call for.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses it.
    pub fn new(gpu: &Gpu, effects: &Effects, workgroup: u32) -> Result<Self> {
        Ok(Self { kernel: Kernel::new(gpu, effects, &workgroup_constants(workgroup))?, workgroup })
    }

    /// camera -> guide\[tile\]
    pub fn record(&self, rec: &mut Recorder, s: &DeviceScene, tile: &FilmTile, push: &PathPush) -> Result<()> {
        let push = PathPush { first_pixel: tile.first_pixel, pixels: tile.pixels, ..*push };
        let bind = Bind {
            nodes: &s.nodes,
            triangles: &s.triangles,
            shading: &s.shading,
            instances: &s.instances,
            materials: &s.materials,
            textures: &s.textures,
            texels: &s.texels,
            lights: &s.lights,
            light_table: &s.light_table,
            environment: &s.environment,
            environment_table: &s.environment_table,
            guides: &tile.guide,
        };
        rec.dispatch(&self.kernel, bind, &push, groups(tile.pixels, self.workgroup))
    }

    /// Milliseconds that the pipeline took to create.
    pub fn compile_ms(&self) -> f64 {
        self.kernel.compile_time().as_secs_f64() * 1e3
    }
}
