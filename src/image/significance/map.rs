//! A picture of where two images differ.
use super::{Outcome, Scale};
use crate::image::Picture;
use crate::math::srgb::luminance;

/// A picture of the regions that differ.
pub struct Overlay {
    /// The second image in grey; orange where the first is brighter, blue where it is darker.
    pub picture: Picture,
    /// Relative difference at which the colours are full.
    pub full: f32,
}

/// Linear colours that remain distinct to the colour-blind: orange for brighter, blue for darker.
const BRIGHTER: [f32; 3] = [1.0, 0.33, 0.0];
const DARKER: [f32; 3] = [0.02, 0.25, 1.0];

/// Draws where the images differ. A pixel shows the finest region that differs and holds it; the whole image counts only if
/// nothing smaller differs.
pub fn overlay(outcome: &Outcome, reference: &Picture) -> Overlay {
    let mut found: Vec<_> = outcome.levels.iter().filter(|level| level.different > 0).collect();
    if found.len() > 1 {
        found.retain(|level| level.scale != Scale::Image);
    }
    let maps: Vec<_> = found.into_iter().map(|level| &level.map).collect();
    let finest = |pixel: usize| maps.iter().map(|map| map[pixel]).find(|d| *d != 0.0).unwrap_or(0.0);
    let relative: Vec<f32> = (0..reference.pixels.len()).map(finest).collect();
    let full = full_colour(&relative);
    let mean = reference.pixels.iter().map(|p| luminance(*p)).sum::<f32>() / reference.pixels.len().max(1) as f32;
    let colour = |(pixel, d): (&[f32; 3], &f32)| {
        // Half of the range, so that the mean is a dim grey behind the colours.
        let grey = 0.3 * luminance(*pixel).max(0.0) / (luminance(*pixel).max(0.0) + mean.max(f32::MIN_POSITIVE));
        let strength = if *d == 0.0 { 0.0 } else { 0.25 + 0.75 * (d.abs() / full).min(1.0) };
        let tint = if *d > 0.0 { BRIGHTER } else { DARKER };
        tint.map(|tint| grey + (tint - grey) * strength)
    };
    let pixels = reference.pixels.iter().zip(&relative).map(colour).collect();
    Overlay { picture: Picture { width: reference.width, height: reference.height, pixels }, full }
}

/// The 99th percentile of the differences, or 1 if there are none.
fn full_colour(relative: &[f32]) -> f32 {
    let mut some: Vec<f32> = relative.iter().map(|d| d.abs()).filter(|d| *d > 0.0).collect();
    some.sort_by(f32::total_cmp);
    let last = some.len().saturating_sub(1);
    some.get(last - last / 100).copied().unwrap_or(1.0)
}
