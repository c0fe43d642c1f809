//! Traces one path per thread. Kernel: `glsl/path.comp`. Twin: [`crate::reference::path`].
use super::{groups, workgroup_constants};
use crate::error::Result;
use crate::frame::{Batch, DeviceScene, FilmBuffers};
use crate::gpu::layout::{Effects, PathPush};
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::shaders::path::Bind;

/// The specialised kernel.
pub struct Path {
    kernel: Kernel<Bind<'static>>,
    workgroup: u32,
}

impl Path {
    /// Compiles the kernel for what `effects` call for.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses it.
    pub fn new(gpu: &Gpu, effects: &Effects, workgroup: u32) -> Result<Self> {
        Ok(Self { kernel: Kernel::new(gpu, effects, &workgroup_constants(workgroup))?, workgroup })
    }

    /// scene -> samples\[batch\]
    pub fn record(
        &self,
        rec: &mut Recorder,
        s: &DeviceScene,
        f: &FilmBuffers,
        push: &PathPush,
        b: &Batch,
    ) -> Result<()> {
        let push = PathPush {
            first_pixel: b.first_pixel,
            pixels: b.pixels,
            first_sample: b.first_sample,
            samples: b.samples,
            ..*push
        };
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
            samples: &f.samples,
            counters: &f.counters,
        };
        rec.dispatch(&self.kernel, bind, &push, groups(b.pixels * b.samples, self.workgroup))
    }

    /// Milliseconds that the pipeline took to create.
    pub fn compile_ms(&self) -> f64 {
        self.kernel.compile_time().as_secs_f64() * 1e3
    }
}
