//! Structs of the kernels that carry samples from frame to frame (`glsl/reproject`).
#[cfg(doc)]
use super::*;
use super::{Field, PathConstants, Struct, float, uint, uvec2, vec2, vec3};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// A point of a surface, named by its triangle, so that it moves with its mesh. 1 texel.
    struct SurfacePoint {
        /// Index of the triangle in leaf order, or [`NONE`] where there is no surface.
        triangle: uint,
        /// Index of the instance in leaf order of the top level, or [`NONE`].
        instance: uint,
        /// Weights of vertices 1 and 2; of a sphere, its unit normal as an octahedral point.
        weights: vec2,
    }

    /// What a pixel of the last frame hands on. Their number is in a word of its own (`glsl/shared/history.glsl`). 3 texels.
    struct History {
        /// The point that the samples are of, as [`SurfacePoint::triangle`], numbered as in the new frame.
        triangle: uint,
        /// As [`SurfacePoint::instance`].
        instance: uint,
        /// As [`SurfacePoint::weights`].
        weights: vec2,
        /// As [`PixelStats::mean`].
        mean: vec3,
        /// Variance of one sample; where nothing has moved, as [`PixelStats::m2`].
        variance: vec3,
        /// Variance of one sample of the pixels around, sum of the channels, as a share of the square of their mean radiance: 1e15 where
        /// it is unknown, or not asked for.
        noise: float,
        /// What the pixel keeps if neither the camera nor anything that it shows moves, as a word of `glsl/shared/history.glsl`; or 0.
        resting: uint,
    }

    /// The light of a [`History`], where direct and indirect light are kept apart. 2 texels.
    struct HistoryLight {
        /// As [`PixelLight::direct`].
        direct: vec3,
        /// As [`PixelLight::albedo`].
        albedo: vec3,
        /// Variance of one sample; where nothing has moved, as [`PixelLight::indirect_m2`].
        indirect_variance: float,
        /// As [`PixelLight::remainder`].
        remainder: uint,
    }

    /// Push constants of `glsl/reproject`.
    struct ReprojectPush {
        /// Film in pixels.
        size: uvec2,
        /// First pixel of the dispatch.
        first_pixel: uint,
        /// Pixels of the dispatch.
        pixels: uint,
        /// Change of light by the view, as a share of the deviation of one sample, that counts as much as it.
        view: float,
        /// Change of light, as a share of it, that counts as much as the deviation of one sample.
        noise: float,
        /// Largest distance of a neighbour's first hit from the plane of the pixel's own, in widths of the pixel there.
        aliasing: float,
        /// Largest number of samples that a pixel hands on.
        max_samples: uint,
        /// Largest number of times that samples may move, at most 255.
        max_age: uint,
        /// Samples that the new frame gives a pixel: carried samples that are fewer take on the new frame's point.
        spp: uint,
        /// 1 where something in the scene has changed besides the camera.
        moved: uint,
        /// 1 where the light of the sky has changed.
        sky: uint,
        /// 1 where instances are numbered anew.
        instances: uint,
        /// 1 where triangles are numbered anew.
        triangles: uint,
    }

    /// Of a cell, a square of the film: one path, as the light was before the scene changed. 2 texels.
    struct Probe {
        /// Radiance, W/(m^2 sr).
        light: vec3,
        /// The pixel that its first point is of, or [`NONE`] where no pixel of the cell hands on samples.
        pixel: uint,
        /// Of that radiance what the light without extent that was chosen at the first surface brings there, times the probability of the
        /// choice.
        certain: vec3,
        /// That light, or [`NONE`].
        choice: uint,
    }

    /// How light has changed at the paths of a cell, or of the cells around it, linear Rec. 709, each path in units of the radiance around
    /// its pixel. 2 texels.
    struct LightChange {
        /// Sum of the differences of radiance.
        sum: vec3,
        /// Sum of the squares of `size` of each path.
        squares: float,
        /// Sum of the brightest channels of radiance, before or after, whichever is more.
        light: float,
        /// Number of paths.
        count: uint,
        /// The largest change so far, as a share of the light.
        change: float,
        /// Sum of the largest channels of the differences' magnitudes.
        size: float,
    }

    /// Push constants of `probe.comp`.
    struct ProbePush {
        /// As [`PathPush::constants`], with a seed of the probes' own.
        constants: PathConstants,
        /// Cells.
        cells: uint,
        /// 1 once the scene has changed.
        after: uint,
    }

    /// Push constants of `light_change.comp`.
    struct LightChangePush {
        /// Cells across and down.
        cells: uvec2,
        /// Distance between the cells that are summed, in cells.
        spacing: uint,
    }
}
