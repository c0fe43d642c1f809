//! From radiance to what a screen shows.

/// Curve applied after exposure and before the sRGB transfer function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum ToneMap {
    /// Values above 1 are cut.
    #[default]
    None,
    /// Filmic curve close to that of ACES, which rolls highlights off towards white.
    Aces,
}

/// Linear value in [0, 1] to its sRGB code value in [0, 1]; values outside are cut. IEC 61966-2-1:1999.
pub fn srgb_from_linear(linear: f32) -> f32 {
    let v = linear.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// Inverse of [`srgb_from_linear`].
pub fn linear_from_srgb(code: f32) -> f32 {
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Narkowicz's fit, per channel: "ACES Filmic Tone Mapping Curve", 2016. Its own result is linear.
fn aces(x: f32) -> f32 {
    (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
}

/// Exposes, tone-maps and encodes one value; the result is in [0, 1], and NaN is 0.
pub fn display(radiance: f32, exposure: f32, tone_map: ToneMap) -> f32 {
    let exposed = radiance * exposure.exp2();
    // A large finite value instead of infinity keeps the rational curve from inf / inf.
    let exposed = if exposed > 0.0 { exposed.min(1e9) } else { 0.0 };
    match tone_map {
        ToneMap::None => srgb_from_linear(exposed),
        ToneMap::Aces => srgb_from_linear(aces(exposed)),
    }
}
