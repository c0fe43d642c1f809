//! What kernels that trace rays, and the one that adds up what they bring, are told and tell.
#[cfg(doc)]
use super::*;
use super::{Camera, Field, Struct, float, uint, uvec2, vec2, vec3};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// What all paths of a frame have in common: of the scene, the camera and the settings. Kernels read it as a uniform buffer,
    /// which has room for more, where push constants end at 128 bytes.
    struct FrameConstants {
        /// Where rays start.
        camera: Camera,
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
        /// 0 = box, 1 = tent, 2 = Gaussian, 3 = the pixel's centre.
        pixel_filter: uint,
        /// Lights in the alias table.
        light_count: uint,
        /// Area pdf of an emissive triangle = this * its material's emission_weight.
        triangle_pdf_scale: float,
        /// Index of the environment among the lights, or NONE.
        environment: uint,
        /// Columns of the environment image; 0 without one.
        environment_width: uint,
        /// Node where traversal starts, with ROOT_OF_INSTANCES.
        root: uint,
    }

    /// Push constants of `path.comp`, `primary_hit.comp` and `guide_lookup.comp`: what differs from dispatch to dispatch.
    struct PathPush {
        /// First pixel of the batch, row-major.
        first_pixel: uint,
        /// Pixels of the batch; its paths, with `samples` = 0.
        pixels: uint,
        /// Index of the batch's first sample of every pixel.
        first_sample: uint,
        /// Samples of every pixel in the batch; 0 when the sample-to-pixel buffer lists the paths.
        samples: uint,
    }

    /// Push constants of `accumulate.comp`.
    struct FoldPush {
        /// First pixel to fold, counted from the tile's first.
        first_pixel: uint,
        /// Pixels to fold.
        pixels: uint,
        /// First pixel of the tile in the film.
        tile: uint,
        /// First pixel of those that are bound, counted from the tile's first.
        window: uint,
        /// Samples of every pixel in the batch; 0 when the round's offsets say how many.
        samples: uint,
        /// With `samples` = 0: paths in the batch.
        paths: uint,
        /// With `samples` = 0: index of the batch's first path in the round, 64 bits.
        first_path: uvec2,
        /// As in [`BatchPush`].
        round: uint,
        /// As in [`BatchPush`].
        rounds: uint,
    }

    /// A ray for `traverse.comp`.
    #[doc(hidden)] // tests and benches alone use it
    struct RayQuery {
        /// World units.
        origin: vec3,
        /// In lengths of `direction`.
        t_max: float,
        /// Not 0.
        direction: vec3,
        /// Decides hits on partly transparent surfaces.
        mask_seed: uint,
    }

    /// What `traverse.comp` finds.
    #[doc(hidden)] // tests and benches alone use it
    struct RayHit {
        /// In lengths of the ray's direction; its `t_max` on a miss.
        t: float,
        /// In leaf order, or [`NONE`].
        triangle: uint,
        /// Leaf order of the top level, or [`NONE`].
        instance: uint,
        /// Weights of vertices 1 and 2.
        barycentric: vec2,
    }

    /// Push constants of `traverse.comp`.
    #[doc(hidden)] // tests and benches alone use it
    struct TraversePush {
        /// Rays.
        count: uint,
        /// As [`FrameConstants::root`].
        root: uint,
        /// 1 = any hit, 0 = the closest.
        any_hit: uint,
    }

    /// Push block of the kernels under glsl/test.
    #[doc(hidden)] // tests and benches alone use it
    struct TestPush {
        /// Threads with work to do.
        count: uint,
        /// Seed of the sampler.
        seed: uint,
    }
}
