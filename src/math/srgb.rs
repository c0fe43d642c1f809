//! The sRGB transfer function (IEC 61966-2-1:1999). Twin of `glsl/shared/texture.glsl`.

/// Linear value in [0, 1] to its code value in [0, 1]; values outside are cut.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// The inverse, for single and for double precision, which sums over textures need.
macro_rules! linear_from_srgb {
    ($name:ident, $float:ty) => {
        /// Code value in [0, 1] to its linear value: the inverse of [`srgb_from_linear`].
        pub fn $name(code: $float) -> $float {
            if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
        }
    };
}
linear_from_srgb!(linear_from_srgb, f32);
linear_from_srgb!(linear_from_srgb_f64, f64);

/// Luminance of a linear colour.
pub fn luminance(colour: impl Into<[f32; 3]>) -> f32 {
    let [r, g, b] = colour.into();
    0.2126 * r + 0.7152 * g + 0.0722 * b
}
