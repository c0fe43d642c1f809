//! The features that a scene and its settings need, as specialisation constants.

macro_rules! effects {
    ($($(#[$doc:meta])* $field:ident: $glsl:ident;)+) => {
        /// The features that a scene and its settings need, one specialisation constant each. Kernels are compiled without the
        /// others. `scene/effects.rs` fills it in and says which object needs each.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct Effects { $($(#[$doc])* pub $field: bool,)+ }
        impl Effects {
            /// Every effect switched on (`--effects all`).
            pub const ALL: Self = Self { $($field: true,)+ };
            /// Whether each effect is on, in the order of their ids.
            pub fn switches(&self) -> [bool; Effect::ALL.len()] {
                [$(self.$field,)+]
            }

            /// Those that are on in either.
            pub fn or(self, other: Self) -> Self {
                Self { $($field: self.$field || other.$field,)+ }
            }

            /// Whether an effect is on, to be changed.
            pub fn switch(&mut self, effect: Effect) -> &mut bool {
                match effect {
                    $(Effect::$field => &mut self.$field,)+
                }
            }

            /// The same with one effect switched.
            pub fn toggled(mut self, effect: Effect) -> Self {
                let switch = self.switch(effect);
                *switch = !*switch;
                self
            }
        }

        /// One of [`Effects`]. They are named as its fields are, so that both come from one list.
        #[allow(non_camel_case_types)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[non_exhaustive]
        pub enum Effect { $($(#[$doc])* $field,)+ }
        impl Effect {
            /// All effects, in the order of their ids.
            pub const ALL: &[Self] = &[$(Self::$field,)+];

            /// The name that users know it by.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$field => stringify!($field),)+
                }
            }
        }
        /// What the shaders call them, in the order of their ids.
        pub const GLSL_NAMES: &[&str] = &[$(stringify!($glsl),)+];
    };
}

impl Effects {
    /// Records of a texel each that a path leaves: its radiance, and where light is kept apart two more.
    pub fn records_per_path(&self) -> usize {
        if self.split_light { 3 } else { 1 }
    }

    /// (constant id, value) of all effects: an effect's id is its position in the list.
    pub fn entries(&self) -> Vec<(u32, u32)> {
        (0..).zip(self.switches().map(u32::from)).collect()
    }
}

effects! {
    /// A colour, specular, roughness or emission texture.
    textures: FX_TEXTURES;
    /// Vertex normals that differ from the face's.
    smooth_normals: FX_SMOOTH_NORMALS;
    /// A height map that perturbs normals.
    bump_maps: FX_BUMP_MAPS;
    /// A texture that is mirrored, clamped along one axis, turned, or not interpolated.
    texture_modes: FX_TEXTURE_MODES;
    /// A texture of a file that holds floats, or numbers of 16 bits that are no colours.
    hdr_textures: FX_HDR_TEXTURES;
    /// A texture that reads the second set of coordinates.
    second_uv: FX_SECOND_UV;
    /// Colours of vertices.
    vertex_colors: FX_VERTEX_COLORS;
    /// Tangents of vertices.
    tangents: FX_TANGENTS;
    /// Opacity that is either all or nothing.
    alpha_cutoff: FX_CUTOFF;
    /// A tangent-space normal map.
    normal_maps: FX_NORMAL_MAPS;
    /// Opacity below 1, constant or by texture.
    alpha_masks: FX_ALPHA_MASKS;
    /// A diffuse lobe (diffuse or coated material).
    diffuse: FX_DIFFUSE;
    /// A conductor, rough or smooth.
    conductor: FX_CONDUCTOR;
    /// A dielectric, rough or smooth.
    dielectric: FX_DIELECTRIC;
    /// A diffuse base under a coat.
    coated: FX_COATED;
    /// A metallic-roughness material.
    metallic: FX_METALLIC;
    /// A clear coat on one.
    clearcoat: FX_CLEARCOAT;
    /// Clear coats whose normals are not those of what is below.
    coat_normals: FX_COAT_NORMALS;
    /// One that lets light through as a thin wall.
    thin_walls: FX_THIN;
    /// Smooth thin walls, and materials of an opacity below 1, that dim the light of point, spot and directional lights.
    clear_walls: FX_CLEAR_WALLS;
    /// A conductor or dielectric whose roughness depends on the direction.
    anisotropic: FX_ANISOTROPIC;
    /// An interface with alpha of at least 0.01.
    rough: FX_ROUGH;
    /// An interface with alpha below 0.01.
    smooth_interface: FX_SMOOTH;
    /// The Beckmann distribution.
    beckmann: FX_BECKMANN;
    /// The GGX distribution.
    ggx: FX_GGX;
    /// Emissive triangles or spheres.
    emissive: FX_EMISSIVE;
    /// Lights that shine from a point in all directions.
    point_lights: FX_POINT;
    /// Lights that shine from a point into a cone.
    spot_lights: FX_SPOT;
    /// Parallel light from infinitely far.
    directional_lights: FX_DIRECTIONAL;
    /// An environment, constant or an image.
    environment: FX_ENVIRONMENT;
    /// An environment given by an image.
    environment_map: FX_ENVIRONMENT_MAP;
    /// A lens of finite radius.
    lens: FX_LENS;
    /// A camera whose rays are parallel.
    orthographic: FX_ORTHOGRAPHIC;
    /// Instances: a second BVH level.
    instances: FX_INSTANCES;
    /// Light beyond direct (max_depth over 2).
    indirect: FX_INDIRECT;
    /// Random ends of long paths (Russian roulette).
    roulette: FX_ROULETTE;
    /// A clamp of indirect light.
    clamp: FX_CLAMP;
    /// A pixel filter other than the box.
    pixel_filter: FX_PIXEL_FILTER;
    /// Direct and indirect light in separate layers.
    split_light: FX_SPLIT;
    /// Independent PCG numbers instead of Owen-scrambled Sobol.
    independent_sampler: FX_INDEPENDENT;
    /// Ray and node counters.
    counters: FX_COUNTERS;
    /// Samples placed by priority: a list of paths in place of equally many per pixel.
    adaptive: FX_ADAPTIVE;
    /// More than 4096 samples per pixel, for which means keep the remainder of rounding.
    many_samples: FX_MANY_SAMPLES;
    /// Emissive triangles large enough to be sampled by solid angle.
    large_lamps: FX_LARGE_LAMPS;
    /// Lamps that shine from both sides.
    two_sided_lamps: FX_TWO_SIDED_LAMPS;
    /// Several point, spot and directional lights, 32 at most, one of which is chosen by what it would bring.
    weighed_lights: FX_WEIGHED_LIGHTS;
    /// Several lights within the scene: one is chosen by a tree over them.
    light_tree: FX_LIGHT_TREE;
    /// Exact spheres among the triangles.
    spheres: FX_SPHERES;
    /// What all but the key light brings to the first hit goes with indirect light.
    soft_light: FX_SOFT;
    /// Light that a filter takes is traced for some pixels only.
    sparse_light: FX_SPARSE;
    /// A hierarchy deep enough that rays of a subgroup gain from testing each other's triangles.
    dealt_triangles: FX_DEALT;
    /// Textures of more texels than one view of single words may have: words are fetched by four.
    many_texels: FX_MANY_TEXELS;
}
