//! The kernels that bring samples to the pixels of a new frame.
use super::Reprojection;
use crate::error::Result;
use crate::gpu::{Gpu, Kernel};
use crate::layout::Effects;
use crate::shaders;

/// Of either direction.
pub enum Way {
    Forward(Forward),
    /// Starts the new pixels with the samples that each of them finds.
    Backward(Kernel<shaders::gather::Bind<'static>>),
}

/// From old pixels to new ones.
pub struct Forward {
    /// Tells which pixels of the new frame are at edges.
    pub edges: Kernel<shaders::edges::Bind<'static>>,
    /// Finds where samples go to.
    pub project: Kernel<shaders::project::Bind<'static>>,
    /// Starts the new pixels with them.
    pub carry: Kernel<shaders::carry::Bind<'static>>,
}

impl Way {
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn new(gpu: &Gpu, effects: Effects, way: Reprojection) -> Result<Self> {
        let thread = gpu.tuning().thread();
        Ok(match way {
            Reprojection::Backward => {
                Self::Backward(Kernel::new(gpu, &shaders::gather::Constants { effects, thread })?)
            }
            Reprojection::Off | Reprojection::Forward => Self::Forward(Forward {
                edges: Kernel::new(gpu, &shaders::edges::Constants { effects, thread })?,
                project: Kernel::new(gpu, &shaders::project::Constants { effects, thread })?,
                carry: Kernel::new(gpu, &shaders::carry::Constants { effects, thread })?,
            }),
        })
    }
}
