//! Which part of an image's light goes through a filter.

/// What is kept away from the filter, where an image tells it: `colour = sharp + factor * filtered`.
///
/// | | filtered | factor | sharp |
/// |---|---|---|---|
/// | `Light` | all light but direct light, before albedo | that albedo | direct light: the emission that is seen, and what the key light brings |
/// | `Albedo` | colour / albedo, or what a noisy mirror or clear glass shows | albedo, or 1 | lamps, sky |
/// | `Off` | colour | 1 | nothing |
///
/// For filters that weigh noise, the factor of `Light` has the mean albedo around for the share of light that does not follow albedo, as what a
/// gloss mirrors: see `glsl/film/gloss.comp`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demodulation {
    /// Surface colour and direct light.
    Light,
    /// Surface colour.
    Albedo,
    /// Nothing.
    Off,
}

impl Demodulation {
    /// One line for the user.
    pub fn note(self) -> &'static str {
        match self {
            Self::Light => "filtered: light before albedo; direct light stays as it is",
            Self::Albedo => "filtered: colour / albedo; lamps and sky, and their rims, stay as they are",
            Self::Off => "filtered: the colour, without demodulation",
        }
    }
}
