//! Push constants of the filters' kernels.
use super::{float, uint, uvec2};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// Push constants of `pack.comp`.
    struct PackPush {
        /// Pixels.
        count: uint,
    }

    /// Push constants of `atrous.comp`: one level.
    struct AtrousPush {
        /// Image in pixels.
        size: uvec2,
        /// Pixels from one tap to the next.
        spacing: uint,
        /// Exponents of the weights, in base 2, per squared (or plain) difference of radiance.
        rate_rt: float,
        /// The same of unit normals.
        rate_n: float,
        /// The same of positions.
        rate_x: float,
    }
}
