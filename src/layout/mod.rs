//! Every struct that crosses the line between host and shader, written once. The crate compiles this file; `build.rs` includes
//! it by `#[path]` and writes the same structs in GLSL at the head of every kernel.
//!
//! Structs are laid out as GLSL `scalar` does: members of four bytes, no padding anywhere. A kernel that binds a struct as texels
//! reads it by functions that the build writes too: `Guide_depth(guides, i)`, `Guide_load(guides, i)`. They fetch 16 bytes at a
//! time where the struct is a multiple of that, 8 where it is one of 8, else 4: structs that are read often have a `pad`.
#![allow(non_camel_case_types)]

use bytemuck::{Pod, Zeroable};

/// GLSL's names for the member types.
pub type uint = u32;
/// 32-bit float.
pub type float = f32;
/// Two unsigned words.
pub type uvec2 = [u32; 2];
/// Two floats.
pub type vec2 = [f32; 2];
/// Three floats without padding (`scalar` layout).
pub type vec3 = [f32; 3];
/// Four floats.
pub type vec4 = [f32; 4];
/// Three unsigned words.
pub type uvec3 = [u32; 3];
/// Four unsigned words.
pub type uvec4 = [u32; 4];

/// A struct as kernels know it, in the order of memory.
pub struct Struct {
    /// Name on both sides.
    pub name: &'static str,
    /// Bytes.
    pub size: usize,
    /// All of them.
    pub fields: &'static [Field],
}

/// A field of a [`Struct`].
pub struct Field {
    /// Name on both sides.
    pub name: &'static str,
    /// GLSL's name of the type.
    pub ty: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
}

/// Declares structs, and lists them in `STRUCTS` for `build.rs`. With the feature `dummy-fields` each begins with a field that
/// nothing reads: tests that pass with it show that nobody knows the places of fields by heart.
macro_rules! gpu_structs {
    ($($(#[$doc:meta])* struct $name:ident { $($(#[$unit:meta])* $field:ident: $ty:ident,)+ })+) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
            pub struct $name {
                #[cfg(feature = "dummy-fields")]
                #[doc(hidden)]
                pub dummy: [f32; 4],
                $($(#[$unit])* pub $field: $ty,)+
            }
        )+
        /// The structs of this file.
        #[doc(hidden)]
        pub const STRUCTS: &[Struct] = &[$(Struct {
            name: stringify!($name),
            size: size_of::<$name>(),
            fields: &[
                #[cfg(feature = "dummy-fields")]
                Field { name: "dummy", ty: "vec4", offset: 0 },
                $(Field { name: stringify!($field), ty: stringify!($ty), offset: std::mem::offset_of!($name, $field) },)+
            ],
        },)+];
    };
}

macro_rules! constants {
    ($($(#[$doc:meta])* $name:ident: $ty:ident = $value:literal;)+) => {
        $($(#[$doc])* pub const $name: $ty = $value;)+
        /// The same constants as GLSL text.
        pub const GLSL_CONSTANTS: &str =
            concat!($("const ", stringify!($ty), " ", stringify!($name), " = ", stringify!($value), ";\n",)+);
    };
}

#[path = "allocate.rs"]
pub mod allocate;
#[path = "effects.rs"]
pub mod effects;
#[path = "filter.rs"]
pub mod filter;
pub use allocate::*;
pub use effects::*;
pub use filter::*;

constants! {
    /// "No texture", "no material override", "no hit".
    NONE: uint = 0xffffffff;
    /// Groups of nodes that a traversal can put aside; scenes that need more are refused when they are loaded.
    TRAVERSAL_STACK: uint = 32;
    /// Set in [`FrameConstants::root`] when the leaves of that level are instances.
    ROOT_OF_INSTANCES: uint = 0x80000000;
    /// Set in [`Triangle::primitive`] of a sphere.
    SPHERE: uint = 0x80000000;
    /// [`Triangle::primitive`] of a sphere: its front side is the inner one.
    SPHERE_INWARD: uint = 1;
    /// [`Triangle::primitive`] of a sphere: its azimuth runs the other way, as a mirror shows it.
    SPHERE_MIRRORED: uint = 2;
    /// [`Material::kind`]: Lambertian reflection, `base_color / pi`.
    BSDF_DIFFUSE: uint = 0;
    /// [`Material::kind`]: microfacet conductor with exact Fresnel from `eta`, `k`.
    BSDF_CONDUCTOR: uint = 1;
    /// [`Material::kind`]: microfacet dielectric, reflection and refraction, `eta[0]` = interior / exterior index.
    BSDF_DIELECTRIC: uint = 2;
    /// [`Material::kind`]: diffuse base under a dielectric coat of index `eta[0]`, roughness `alpha`.
    BSDF_COATED: uint = 3;
    /// An interface whose [`Material::alpha`] is below this is smooth.
    SMOOTH_ALPHA: float = 0.01;
    /// [`Material::flags`]: the GGX distribution instead of Beckmann.
    MATERIAL_GGX: uint = 1;
    /// [`Material::flags`]: both sides scatter alike (dielectrics ignore it: their sides differ by definition).
    MATERIAL_TWO_SIDED: uint = 2;
    /// [`Material::flags`]: `bump_texture` is a tangent-space normal map, not a height map.
    MATERIAL_NORMAL_MAP: uint = 4;
    /// [`Material::flags`]: hits are subject to an alpha mask (`opacity_texture` or `opacity` below 1).
    MATERIAL_MASKED: uint = 8;
    /// [`Material::flags`]: light that scatters below a coat takes on the base's colour at every turn.
    MATERIAL_NONLINEAR: uint = 16;
    /// [`FrameConstants::pixel_filter`]: uniform over the pixel.
    PIXEL_FILTER_BOX: uint = 0;
    /// [`FrameConstants::pixel_filter`]: triangle of radius 1 pixel.
    PIXEL_FILTER_TENT: uint = 1;
    /// [`FrameConstants::pixel_filter`]: Gaussian of standard deviation 0.5 pixels, cut at radius 2.
    PIXEL_FILTER_GAUSSIAN: uint = 2;
    /// [`FrameConstants::pixel_filter`]: the pixel's centre.
    PIXEL_FILTER_POINT: uint = 3;
    /// Roughnesses in the table of a rough coat (reference::coat).
    COAT_ROWS: uint = 32;
    /// Numbers for each of them: [`COAT_COLUMNS`] - 1 cosines, and the mean from inside.
    COAT_COLUMNS: uint = 49;
    /// [`Texture::flags`]: RGB is stored with the sRGB curve and decoded when read.
    TEXTURE_SRGB: uint = 1;
    /// [`Texture::flags`]: coordinates outside [0, 1] clamp to the border texel; otherwise they repeat.
    TEXTURE_CLAMP: uint = 2;
    /// [`Light::kind`]: emissive triangle `a`, `b`, `c` (vertices in world units), radiance `value`.
    LIGHT_TRIANGLE: uint = 0;
    /// [`Light::kind`]: point at `a`, radiant intensity `value` in W/sr.
    LIGHT_POINT: uint = 1;
    /// [`Light::kind`]: spot at `a` along unit `b`; `c` = (cos of the full-intensity angle, cos of the cut-off angle, 0).
    LIGHT_SPOT: uint = 2;
    /// [`Light::kind`]: directional along unit `b` (the way light travels), irradiance `value` on a facing plane.
    LIGHT_DIRECTIONAL: uint = 3;
    /// [`Light::kind`]: the environment; rows of the rotation environment_from_world in `a`, `b`, `c`; radiance scale `value`.
    LIGHT_ENVIRONMENT: uint = 4;
    /// [`Light::kind`]: sphere around `a` of radius `b.x` (world units), emits radiance `value` outward.
    LIGHT_SPHERE: uint = 5;
}

gpu_structs! {
    /// Camera rays start at `position` (pinhole) or on a disk of `lens_radius` around it. For film coordinates
    /// `sx`, `sy` in [-1, 1] (right, up): `direction = forward + sx * right + sy * up`, all in world space; `right`
    /// and `up` are already scaled by the tangent of half the field of view, so they need not be unit, nor
    /// right-handed (a mirrored camera).
    struct Camera {
        /// World units.
        position: vec3,
        /// World units; 0 is a pinhole.
        lens_radius: float,
        /// Scaled by tan(horizontal fov / 2).
        right: vec3,
        /// Distance along `forward` to the plane in focus, world units.
        focus_distance: float,
        /// Scaled by tan(vertical fov / 2).
        up: vec3,
        /// Near clip distance along the ray, world units; 0 clips nothing.
        near: float,
        /// Unit.
        forward: vec3,
    }

    /// One eight-way compressed node (Ylitie et al. 2017) as obvhs lays it out; child and triangle indices are
    /// global. 5 texels. `words[0..3]` = origin, `[3]` = exponents and inner mask, `[4]` = first child,
    /// `[5]` = first primitive, `[6..8]` = child meta, then 8 bytes each of min x, max x, min y, max y, min z, max z.
    struct BvhNode {
        /// Origin of the quantisation grid, world (or object) units.
        p: vec3,
        /// Exponents of x, y, z in the low three bytes, mask of inner children in the high byte.
        e_imask: uint,
        /// Index of the first inner child.
        child_base: uint,
        /// Index of the first primitive: a triangle, or an instance in the top level.
        primitive_base: uint,
        /// Eight bytes: kind and offset of each child.
        meta: uvec2,
        /// Quantised bounds of the children.
        min_x: uvec2,
        /// See `min_x`.
        max_x: uvec2,
        /// See `min_x`.
        min_y: uvec2,
        /// See `min_x`.
        max_y: uvec2,
        /// See `min_x`.
        min_z: uvec2,
        /// See `min_x`.
        max_z: uvec2,
    }

    /// What traversal reads of a triangle, in leaf order. 3 texels. One with [`SPHERE`] is a sphere instead: `v0` is its
    /// centre, `v1` and `v2` lead from there to the pole and to where the meridian of u = 0 crosses the equator.
    struct Triangle {
        /// World units, or object units below an instance.
        v0: vec3,
        /// Index of the triangle in its mesh file, for reports; or SPHERE_ bits.
        primitive: uint,
        /// See `v0`.
        v1: vec3,
        /// Index into the materials.
        material: uint,
        /// See `v0`.
        v2: vec3,
        /// Index of the object (shape), the `id` layer of the outputs.
        object: uint,
    }

    /// What shading reads of a triangle beyond its positions; same index as its [`Triangle`]. 3 texels.
    /// Present only when a mesh of the scene has vertex normals or texture coordinates.
    struct Shading {
        /// Octahedral unit normals of the three vertices, snorm 2 x 16, x in the low half. All three 0xffffffff: flat.
        normal: uvec3,
        /// Texture coordinates of vertex 0; v points up, so row 0 of an image is v = 1.
        uv0: vec2,
        /// Of vertex 1.
        uv1: vec2,
        /// Of vertex 2.
        uv2: vec2,
        /// Unused words, zero.
        pad: uvec3,
    }

    /// A placed mesh. 7 texels. Matrices are three rows of four, `x_world = rows * (x_object, 1)`.
    struct Instance {
        /// Row 0 of world_from_object.
        world0: vec4,
        /// Row 1.
        world1: vec4,
        /// Row 2.
        world2: vec4,
        /// Row 0 of object_from_world.
        object0: vec4,
        /// Row 1.
        object1: vec4,
        /// Row 2.
        object2: vec4,
        /// Index of the mesh's root node.
        root: uint,
        /// Material for the whole instance, or [`NONE`] to keep those of the triangles.
        material: uint,
        /// Added to the triangles' object index.
        object: uint,
        /// 1 when the transform mirrors (negative determinant): the geometric normal flips.
        mirrored: uint,
    }

    /// Surface appearance. 8 texels, of which a diffuse surface without textures needs the first two. Colours are linear Rec. 709 in
    /// [0, 1] unless said otherwise.
    struct Material {
        /// Diffuse albedo; multiplies `base_texture`.
        base_color: vec3,
        /// MATERIAL_ bits.
        flags: uint,
        /// Emitted radiance of the front side, W/(m^2 sr); 0 emits nothing.
        emission: vec3,
        /// Luminance of the mean emission, times the mean opacity; emissive triangles are chosen in proportion to it times their area.
        emission_weight: float,
        /// Index of refraction per channel (conductor), or interior / exterior in `x` (dielectric, coated).
        eta: vec3,
        /// Constant opacity in [0, 1]; multiplies `opacity_texture`.
        opacity: float,
        /// Extinction per channel (conductor).
        k: vec3,
        /// Microfacet roughness (alpha itself, not its root); see [`SMOOTH_ALPHA`].
        alpha: float,
        /// Tint of specular reflection; multiplies `specular_texture`.
        specular: vec3,
        /// Height of a bump map in world units per unit of texture value.
        bump_scale: float,
        /// Tint of specular transmission (dielectric).
        transmission: vec3,
        /// Texture index or [`NONE`].
        base_texture: uint,
        /// Tint; texture index or [`NONE`].
        specular_texture: uint,
        /// Opacity in its red channel (the loader moves an alpha channel there); texture index or [`NONE`].
        opacity_texture: uint,
        /// Height map, or normal map with MATERIAL_NORMAL_MAP.
        bump_texture: uint,
        /// Perceptual roughness r in its red channel, multiplies sqrt(alpha).
        roughness_texture: uint,
        /// Multiplies `emission`.
        emission_texture: uint,
        /// Diffuse reflectance of the smooth interface seen from inside (coated): mean internal Fresnel reflectance.
        internal_fresnel: float,
        /// One of the BSDF_ constants.
        kind: uint,
        /// Index of the first word of a coat's table among the texels (coated, where rough); else zero.
        coat_table: uint,
    }

    /// A picture in the texel buffer: RGBA8 texels (R in the low byte), row 0 at the top. 2 texels.
    struct Texture {
        /// Index of the first texel.
        first: uint,
        /// Texels.
        width: uint,
        /// Texels.
        height: uint,
        /// TEXTURE_ bits.
        flags: uint,
        /// It is read at `uv * scale + offset`.
        scale: vec2,
        /// See `scale`.
        offset: vec2,
    }

    /// A light. 4 texels; what the vectors mean depends on `kind`.
    struct Light {
        /// See the LIGHT_ constants.
        a: vec3,
        /// One of the LIGHT_ constants.
        kind: uint,
        /// See the LIGHT_ constants.
        b: vec3,
        /// Probability that the alias table returns this light.
        probability: float,
        /// See the LIGHT_ constants.
        c: vec3,
        /// Index of the triangle in leaf order (LIGHT_TRIANGLE, LIGHT_SPHERE), else [`NONE`].
        triangle: uint,
        /// Radiance, intensity or irradiance, linear Rec. 709.
        value: vec3,
        /// Index of the material (LIGHT_TRIANGLE, LIGHT_SPHERE), else [`NONE`].
        material: uint,
    }

    /// One slot of an alias table (Walker 1977, Vose 1991) over n entries. From a 32-bit random word r, the slot is
    /// the high word of r * n; the low word picks the slot itself when below `threshold`, its alias otherwise.
    struct AliasEntry {
        /// Probability of staying, in units of 2^-32; 0xffffffff always stays.
        threshold: uint,
        /// The other entry.
        alias: uint,
    }

    /// The primary hit at the pixel centre. Zero where the ray leaves the scene, with `object` = [`NONE`].
    struct Guide {
        /// Shading normal in world space, unit, towards the camera.
        normal: vec3,
        /// Distance from the camera position along the unit ray, world units; 0 on a miss.
        depth: float,
        /// Hit in world units.
        position: vec3,
        /// Object index, or [`NONE`].
        object: uint,
        /// Reflectance of the first hit that indirect light is divided by, linear Rec. 709; 0 for mirrors and clear glass.
        albedo: vec3,
        /// Index of the material, or [`NONE`].
        material: uint,
    }

    /// Running statistics of one pixel (Welford 1962), linear Rec. 709. 2 texels.
    struct PixelStats {
        /// Mean radiance, W/(m^2 sr).
        mean: vec3,
        /// Samples behind `mean`.
        count: uint,
        /// Sum of squared deviations from the mean; the variance of one sample is m2 / (count - 1).
        m2: vec3,
        /// What rounding took off `mean`: three signed numbers of 10 bits, in units of 2^-10 of its last place, red lowest;
        /// 0 up to 4096 samples.
        remainder: uint,
    }

    /// Running means of one pixel that the filters read; the count is that of its [`PixelStats`]. 2 texels.
    struct PixelLight {
        /// Radiance that needs no filter: emission, direct light, and all that smooth interfaces show at the first hit.
        direct: vec3,
        /// Sum of squared deviations of the luminance of `indirect`, as [`PixelStats::m2`].
        indirect_m2: float,
        /// Incident indirect irradiance over pi at the first hit: indirect radiance before its albedo.
        indirect: vec3,
        /// As [`PixelStats::remainder`]: six numbers of 5 bits, in units of 2^-5; those of `direct` are the lowest.
        remainder: uint,
    }

    /// Samples that were no number and counted as black.
    struct BrokenTally {
        /// How many, up to 2^31.
        count: uint,
        /// Complement of the lowest pixel of such a sample; 0: none.
        lowest: uint,
        /// Complement of the pixel that `index` is of; it is that of `lowest` once a batch is folded.
        pixel: uint,
        /// Index of the first such sample of that pixel, counted from its first sample of all.
        index: uint,
    }

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
    struct TraversePush {
        /// Rays.
        count: uint,
        /// As [`FrameConstants::root`].
        root: uint,
        /// 1 = any hit, 0 = the closest.
        any_hit: uint,
    }

    /// Push block of the kernels under glsl/test.
    struct TestPush {
        /// Threads with work to do.
        count: uint,
        /// Seed of the sampler.
        seed: uint,
    }
}
