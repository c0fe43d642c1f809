//! Every struct that host and shaders share, declared once. The crate compiles this file; `build.rs` includes it by `#[path]` and
//! writes the same structs in GLSL at the head of every kernel.
//!
//! Structs have GLSL's `scalar` layout: members of four bytes without padding. A kernel that binds a struct as texels reads it
//! by functions that the build writes too: `Guide_depth(guides, i)`, `Guide_load(guides, i)`. They fetch 16 bytes at a time where
//! the size of the struct is a multiple of 16, 8 where it is one of 8, else 4; a `pad` field brings often-read structs to 16.
#![allow(non_camel_case_types)]

/// GLSL's unsigned integer of 32 bits.
pub type uint = u32;
/// GLSL's float of 32 bits.
pub type float = f32;
/// Two unsigned integers of 32 bits.
pub type uvec2 = [u32; 2];
/// Two floats of 32 bits.
pub type vec2 = [f32; 2];
/// Three floats without padding (`scalar` layout).
pub type vec3 = [f32; 3];
/// Four floats of 32 bits.
pub type vec4 = [f32; 4];
/// Three unsigned integers of 32 bits.
pub type uvec3 = [u32; 3];
/// Four unsigned integers of 32 bits.
pub type uvec4 = [u32; 4];

/// A struct as kernels know it, in the order of memory.
pub struct Struct {
    /// Name in Rust and in GLSL.
    pub name: &'static str,
    /// Size in bytes.
    pub size: usize,
    /// Every field, in the order of memory.
    pub fields: &'static [Field],
}

/// A field of a [`Struct`].
pub struct Field {
    /// Name in Rust and in GLSL.
    pub name: &'static str,
    /// GLSL's name of the type.
    pub ty: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
}

/// Declares structs, and lists them in `STRUCTS` for `build.rs`. With the feature `dummy-fields` each begins with a field that
/// nothing reads: tests that pass with it show that no code depends on fixed offsets of fields.
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
        /// The structs that this file declares.
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
mod allocate;
#[path = "constants.rs"]
mod constants;
#[path = "effects.rs"]
mod effects;
#[path = "filter.rs"]
mod filter;
#[path = "path.rs"]
mod path;
#[path = "pixel.rs"]
mod pixel;
#[path = "reproject.rs"]
mod reproject;
#[path = "scene.rs"]
mod scene;
pub use allocate::*;
pub use constants::*;
pub use effects::*;
pub(crate) use filter::*;
pub use path::*;
pub use pixel::*;
pub use reproject::*;
pub use scene::*;

/// Every struct; one that is a field of another comes before it.
#[doc(hidden)]
pub const STRUCTS: [&[Struct]; 6] =
    [scene::STRUCTS, pixel::STRUCTS, path::STRUCTS, allocate::STRUCTS, filter::STRUCTS, reproject::STRUCTS];
