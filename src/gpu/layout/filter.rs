//! Push constants of the filters' kernels.
use super::{float, uint, uvec2, vec4};
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

    /// Push constants of `guided_pack.comp`.
    struct GuidedPackPush {
        /// Pixels.
        count: uint,
        /// 1 / extent.
        depth_scale: float,
    }

    /// Push constants of the passes of the guided filter, over a strip of rows.
    struct GuidedPush {
        /// Image in pixels.
        size: uvec2,
        /// First row of the strip.
        first_row: uint,
        /// Rows of the strip.
        rows: uint,
        /// Pixels from a window's centre to its border, along the pass.
        radius: uint,
        /// Added to the variance of each channel of the guide.
        eps: vec4,
    }
}
