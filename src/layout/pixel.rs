//! Guides, statistics and light of a pixel, and the count of broken samples.
#[cfg(doc)]
use super::*;
use super::{Field, Struct, float, uint, vec3};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// The primary hit at the pixel centre. Zero where the ray leaves the scene, with `object` = [`NONE`].
    struct Guide {
        /// Shading normal in world space, unit, towards the camera.
        normal: vec3,
        /// Distance from the camera position along the unit ray, world units; 0 on a miss.
        depth: float,
        /// Point that is hit, world units.
        position: vec3,
        /// Index of the object, or [`NONE`].
        object: uint,
        /// Reflectance of the first hit that indirect light is divided by, linear Rec. 709; 0 for mirrors and clear glass.
        albedo: vec3,
        /// Index of the material, or [`NONE`]: where nothing was hit and, for filters, where a lens blurs what the pixel shows.
        material: uint,
    }

    /// Running statistics of one pixel (Welford 1962), linear Rec. 709. 2 texels.
    struct PixelStats {
        /// Mean radiance, W/(m^2 sr).
        mean: vec3,
        /// Number of samples of `mean`.
        count: uint,
        /// Sum of squared deviations from the mean; the variance of one sample is m2 / (count - 1).
        m2: vec3,
        /// Remainder that rounding took off `mean`: three signed numbers of 10 bits, red lowest, in units of 2^-10 of its last
        /// place; 0 up to 4096 samples.
        remainder: uint,
    }

    /// Running means of one pixel that the filters read; the count is that of its [`PixelStats`]. 2 texels.
    struct PixelLight {
        /// Radiance that needs no filter: emission that is seen, and direct light; with FX_SOFT that of the key light alone (see
        /// `glsl/shared/light.glsl`), by the samples that chose it.
        direct: vec3,
        /// Sum of squared deviations of the luminance of all other light, as [`PixelStats::m2`].
        indirect_m2: float,
        /// Reflectance that all other light has been multiplied by: that of the first hit or, seen in mirrors, of the first that is
        /// none, times theirs; samples that show emission alone count as 0. Of what clear glass shows, that by the way that most samples
        /// take, mixed with white by the share of the others.
        albedo: vec3,
        /// As [`PixelStats::remainder`]: three numbers of 5 bits for `direct`, in units of 2^-5, and above them three of 4 bits
        /// for `albedo`, in units of 2^-4. The three highest bits are the marks of `glsl/shared/sample_marks.glsl`.
        remainder: uint,
    }

    /// Samples that were not finite and counted as black, or whose path ended before its time: see `glsl/shared/sample.glsl`.
    struct BrokenTally {
        /// Number of such samples, up to about 2^31.
        count: uint,
        /// Complement of the lowest pixel of such a sample; 0 stands for none.
        lowest: uint,
        /// Complement of the pixel that `index` belongs to; it equals `lowest` once a batch is accumulated.
        pixel: uint,
        /// Index of the first such sample of that pixel, counted from its first sample of all.
        index: uint,
    }
}
