//! Push constants of the kernels that filter and of those of `glsl/film` but `accumulate.comp`.
use super::{Field, Struct, float, uint, uvec2, vec2, vec3, vec4};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// Push constants of `demodulate.comp`, `gloss.comp`, `as_light.comp`, `auto_cells.comp` and `expected_error.comp`.
    struct SizePush {
        /// Film in pixels.
        size: uvec2,
    }

    /// Push constants of `decimate.comp` and `upsample.comp`.
    struct SparsePush {
        /// Film in pixels.
        size: uvec2,
        /// Distance along both axes between pixels whose light was traced.
        stride: uint,
    }

    /// Push constants of `pack.comp` and of other kernels that look at no neighbours.
    struct PackPush {
        /// Pixels of the image.
        count: uint,
    }

    /// Push constants of `atrous.comp`: one level.
    struct AtrousPush {
        /// Image in pixels.
        size: uvec2,
        /// Pixels from one tap to the next.
        spacing: uint,
        /// Exponents of the weights of radiance, normal and position, in base 2, per squared (or plain) difference.
        rates: vec3,
    }

    /// Push constants of `guided_pack.comp`.
    struct GuidedPackPush {
        /// Image in pixels.
        size: uvec2,
        /// Reciprocal of the depths' extent, 1 / world units.
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
        /// Pixels from a window's centre to its border; only the kernels with summed-area tables read it.
        radius: uint,
        /// Added to the variance of each channel of the guide.
        eps: vec4,
    }

    /// Push constants of `bilateral.comp`.
    struct BilateralPush {
        /// Image in pixels.
        size: uvec2,
        /// Pixels from the centre to the border of the window.
        radius: uint,
        /// Exponent of the weight of distance on the image, in base 2, per squared pixel.
        rate_space: float,
        /// As in [`AtrousPush`].
        rates: vec3,
        /// Index of the band of the window's rows, from its top.
        band: uint,
        /// Rows of a full band.
        band_rows: uint,
    }

    /// Push constants of `svgf.comp`.
    struct SvgfPush {
        /// Image in pixels.
        size: uvec2,
        /// Pixels from one tap to the next.
        spacing: uint,
        /// Exponent, in base 2, per standard deviation of luminance.
        rate_l: float,
        /// As in [`AtrousPush`]; that of radiance is 0.
        rates: vec3,
    }

    /// Push constants of `wavelet.comp`.
    struct WaveletPush {
        /// Image in pixels.
        size: uvec2,
        /// Pixels between neighbours on the lattice of this level.
        spacing: uint,
        /// Neighbours: 0 = two along rows, 1 = two along columns, 2 = four side by side, 3 = four diagonally.
        stencil: uint,
        /// As in [`AtrousPush`].
        rates: vec3,
    }

    /// Push constants of `firefly.comp`.
    struct FireflyPush {
        /// Image in pixels.
        size: uvec2,
        /// How much brighter than its surroundings a pixel may be.
        factor: float,
    }

    /// Push constants of `auto_inputs.comp`, `auto_leverage.comp`, `auto_error.comp`, `auto.comp` and `auto_residual.comp`.
    struct AutoPush {
        /// Image in pixels.
        size: uvec2,
        /// Luminance below which errors count as absolute.
        floor: float,
        /// As in [`AtrousPush`]; that of radiance is 0.
        rates: vec3,
        /// Pixels of the narrow window over those of the wide and of the middle one.
        shares: vec2,
    }

    /// Push constants of `noise_estimate.comp` and `auto_spread.comp`.
    struct SurfacesPush {
        /// Image in pixels.
        size: uvec2,
        /// As in [`AtrousPush`]; that of radiance is 0.
        rates: vec3,
    }

    /// Push constants of `auto_smooth.comp`.
    struct AutoSmoothPush {
        /// Image in pixels.
        size: uvec2,
        /// Cells from one tap to the next, or pixels at the first level.
        spacing: uint,
        /// As in [`AtrousPush`]; that of radiance is 0.
        rates: vec3,
        /// Smallest weight of a known pixel, however unlike it is, 0 to 1.
        least: float,
    }
}
