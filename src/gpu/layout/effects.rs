//! What a scene and its settings call for, as specialisation constants.

macro_rules! effects {
    ($($(#[$doc:meta])* $field:ident = $id:literal, $glsl:ident;)+) => {
        /// What a scene and its settings call for: one specialisation constant each. Kernels drop the rest when they are
        /// compiled. `scene/effects.rs` fills it in and says which object asked.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct Effects { $($(#[$doc])* pub $field: bool,)+ }
        impl Effects {
            /// Every effect switched on (`--effects all`).
            pub const ALL: Self = Self { $($field: true,)+ };
            /// (name, specialisation constant id, on) of every effect, in order of id.
            pub fn entries(&self) -> Vec<(&'static str, u32, bool)> {
                vec![$((stringify!($field), $id, self.$field),)+]
            }
            /// The same with the effect of this id switched.
            pub fn toggled(mut self, id: u32) -> Self {
                match id {
                    $($id => self.$field = !self.$field,)+
                    _ => {}
                }
                self
            }
        }
        /// The constants as GLSL text.
        pub const GLSL_EFFECTS: &str = concat!($("layout(constant_id = ", $id, ") const bool ",
            stringify!($glsl), " = true;\n",)+);
    };
}

effects! {
    /// A colour, specular, roughness or emission texture.
    textures = 0, FX_TEXTURES;
    /// Vertex normals that differ from the face's.
    smooth_normals = 1, FX_SMOOTH_NORMALS;
    /// A height map.
    bump_maps = 2, FX_BUMP_MAPS;
    /// A tangent-space normal map.
    normal_maps = 3, FX_NORMAL_MAPS;
    /// Opacity below 1, constant or by texture.
    alpha_masks = 4, FX_ALPHA_MASKS;
    /// A diffuse lobe (diffuse or coated material).
    diffuse = 5, FX_DIFFUSE;
    /// A conductor, rough or smooth.
    conductor = 6, FX_CONDUCTOR;
    /// A dielectric, rough or smooth.
    dielectric = 7, FX_DIELECTRIC;
    /// A diffuse base under a coat.
    coated = 8, FX_COATED;
    /// An interface with alpha of at least 0.01.
    rough = 9, FX_ROUGH;
    /// An interface with alpha below 0.01.
    smooth_interface = 10, FX_SMOOTH;
    /// The Beckmann distribution.
    beckmann = 11, FX_BECKMANN;
    /// The GGX distribution.
    ggx = 12, FX_GGX;
    /// Emissive triangles.
    emissive = 13, FX_EMISSIVE;
    /// Point lights.
    point_lights = 14, FX_POINT;
    /// Spot lights.
    spot_lights = 15, FX_SPOT;
    /// Directional lights.
    directional_lights = 16, FX_DIRECTIONAL;
    /// An environment, constant or an image.
    environment = 17, FX_ENVIRONMENT;
    /// An environment given by an image.
    environment_map = 18, FX_ENVIRONMENT_MAP;
    /// A lens of finite radius.
    lens = 19, FX_LENS;
    /// Instances: a second BVH level.
    instances = 20, FX_INSTANCES;
    /// Light beyond direct (max_depth over 2).
    indirect = 21, FX_INDIRECT;
    /// Russian roulette.
    roulette = 22, FX_ROULETTE;
    /// A clamp of indirect light.
    clamp = 23, FX_CLAMP;
    /// A pixel filter other than the box.
    pixel_filter = 24, FX_PIXEL_FILTER;
    /// Direct and indirect light wanted apart.
    split_light = 25, FX_SPLIT;
    /// Independent PCG numbers instead of Owen-scrambled Sobol.
    independent_sampler = 26, FX_INDEPENDENT;
    /// Ray and node counters.
    counters = 27, FX_COUNTERS;
    /// Samples placed where they count: a list of paths instead of so many per pixel.
    adaptive = 28, FX_ADAPTIVE;
    /// Emissive triangles large enough to be sampled by solid angle.
    large_lamps = 29, FX_LARGE_LAMPS;
}
