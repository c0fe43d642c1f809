//! Structs of the kernels that trace rays, and of `accumulate.comp`, which adds up their samples.
#[cfg(doc)]
use super::*;
use super::{Camera, Field, Struct, float, uint, uvec2, vec2, vec3};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// What a scene and its settings tell all paths of a frame. It steers branches and loops, and is pushed for that reason:
    /// lavapipe compiles kernels for the values of push constants, and takes 3 % longer where they lie in a buffer.
    struct PathConstants {
        /// Film in pixels.
        size: uvec2,
        /// Chooses the random sequence.
        seed: uint,
        /// Path edges, at least 1.
        max_depth: uint,
        /// Edges after which roulette starts; 0 is off.
        roulette_depth: uint,
        /// Limit of an indirect sample's largest channel; 0 is off.
        clamp_indirect: float,
        /// Distance along both axes between pixels whose filtered light is traced; 1 is all.
        indirect_stride: uint,
        /// One of the PIXEL_FILTER_ constants.
        pixel_filter: uint,
        /// Number of lights in the alias table.
        light_count: uint,
        /// Area pdf of an emissive triangle = this * its material's emission_weight.
        triangle_pdf_scale: float,
        /// Index of the environment among the lights, or NONE.
        environment: uint,
        /// Columns and rows of the environment image; 0 without one.
        environment_size: uvec2,
        /// Node where traversal starts, with ROOT_OF_INSTANCES.
        root: uint,
    }

    /// Push constants of `path.comp`, `primary_hit.comp`, `guide_lookup.comp` and the kernels of a wavefront, 76 of the 128 bytes
    /// that every device has.
    struct PathPush {
        /// What stays the same during the frame.
        constants: PathConstants,
        /// First pixel of the batch, row-major.
        first_pixel: uint,
        /// Number of pixels of the batch; with `samples` = 0, number of its paths.
        pixels: uint,
        /// Index of the batch's first sample of every pixel.
        first_sample: uint,
        /// Samples of every pixel in the batch; 0 when the sample-to-pixel buffer lists the paths.
        samples: uint,
        /// Of a wavefront: surfaces that all of its paths have met.
        stage: uint,
    }

    /// Push constants of `accumulate.comp`.
    struct FoldPush {
        /// First pixel to fold, counted from the tile's first.
        first_pixel: uint,
        /// Pixels to fold.
        pixels: uint,
        /// First pixel of the tile in the film.
        tile: uint,
        /// First pixel of those whose statistics are bound for writing, counted from the tile's first.
        window: uint,
        /// Samples of every pixel in the batch; 0 when the list of paths determines them.
        samples: uint,
        /// With `samples` = 0: paths in the batch.
        paths: uint,
        /// With `samples` = 0: index of the batch's first path in the round, 64 bits.
        first_path: uvec2,
        /// Index of the round, as in [`BatchPush`].
        round: uint,
        /// Number of rounds, as in [`BatchPush`].
        rounds: uint,
    }

    /// A ray for `traverse.comp`.
    #[doc(hidden)] // tests and benches alone use it
    struct RayQuery {
        /// Start of the ray, world units.
        origin: vec3,
        /// End of the ray, in lengths of `direction`.
        t_max: float,
        /// Of any length but 0.
        direction: vec3,
        /// Decides hits on partly transparent surfaces.
        mask_seed: uint,
    }

    /// What `traverse.comp` finds.
    #[doc(hidden)] // tests and benches alone use it
    struct RayHit {
        /// In lengths of the ray's direction; its `t_max` on a miss.
        t: float,
        /// Index of the triangle in leaf order, or [`NONE`].
        triangle: uint,
        /// Index of the instance in leaf order of the top level, or [`NONE`].
        instance: uint,
        /// Weights of vertices 1 and 2; of a sphere, its unit normal as an octahedral point.
        barycentric: vec2,
    }

    /// Push constants of `traverse.comp`.
    #[doc(hidden)] // tests and benches alone use it
    struct TraversePush {
        /// Number of rays.
        count: uint,
        /// Root node, as [`PathConstants::root`].
        root: uint,
        /// 1 = any hit, 0 = the closest.
        any_hit: uint,
    }

    /// Push constants of kernels under `glsl/test`.
    struct TestPush {
        /// Threads with work to do.
        count: uint,
        /// Seed of the sampler.
        seed: uint,
    }
}

/// What all paths of a frame have in common. Kernels read the camera from a uniform buffer, and the rest from push constants.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameConstants {
    /// The camera that rays start from.
    pub camera: Camera,
    /// The rest.
    pub path: PathConstants,
}
