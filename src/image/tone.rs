//! Conversion of radiance to display values: exposure, tone curve and sRGB encoding.
use crate::math::srgb::srgb_from_linear;

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

/// Narkowicz's fit, per channel: "ACES Filmic Tone Mapping Curve", 2016. Its own result is linear.
fn aces(x: f32) -> f32 {
    (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14)
}

/// Exposes, tone-maps and encodes one value; the result is in [0, 1], and NaN is 0.
pub fn display(radiance: f32, exposure: f32, tone_map: ToneMap) -> f32 {
    let exposed = radiance * exposure.exp2();
    // Infinity becomes a large finite value, because the rational curve would give inf / inf.
    let exposed = if exposed > 0.0 { exposed.min(1e9) } else { 0.0 };
    match tone_map {
        ToneMap::None => srgb_from_linear(exposed),
        ToneMap::Aces => srgb_from_linear(aces(exposed)),
    }
}
