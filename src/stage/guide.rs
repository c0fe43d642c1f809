//! Primary hits at pixel centres. Kernel: `glsl/guide.comp`. Twin: [`crate::reference::guide`].
use super::{WORKGROUP_ID, groups};
use crate::error::Result;
use crate::frame::DeviceScene;
use crate::gpu::layout::{Effects, Guide, PathPush};
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
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
        Ok(Self { kernel: Kernel::new(gpu, effects, &[(WORKGROUP_ID, workgroup)])?, workgroup })
    }

    /// camera -> guide\[P\]
    pub fn record(&self, rec: &mut Recorder, s: &DeviceScene, out: &Buffer<Guide>, push: &PathPush) -> Result<()> {
        let pixels = push.size[0] * push.size[1];
        let push = PathPush { first_pixel: 0, pixels, ..*push };
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
            guides: out,
        };
        rec.dispatch(&self.kernel, bind, &push, groups(pixels, self.workgroup))
    }

    /// Milliseconds that the pipeline took to create.
    pub fn compile_ms(&self) -> f64 {
        self.kernel.compile_time().as_secs_f64() * 1e3
    }
}
