//! Heat maps of the differences between two pictures.
use super::film::Picture;

/// Width in pixels of the scale bar and of the gap before it.
const BAR: usize = 12;
const GAP: usize = 4;

/// Draws the mean over the channels of `|test - reference|`, on linear values, in the colour map magma (perceptually
/// uniform; FLIP uses it too). A bar at the right edge shows the scale, with 0 at its lower end.
///
/// Returns the picture, [`WIDER`] columns wider than its arguments, and the value at the top of the scale: the 99.9th
/// percentile of the differences that are not 0, so that a few fireflies do not hide the rest. Larger values are clamped.
///
/// # Panics
/// When the sizes differ, or the pictures have no pixel.
pub fn heat_map(test: &Picture, reference: &Picture) -> (Picture, f32) {
    let top = scale_top(&errors(test, reference));
    (heat_map_to(test, reference, top), top)
}

/// As [`heat_map`] with a given top of the scale, for maps that are to be compared with each other.
///
/// # Panics
/// When the sizes differ, or the pictures have no pixel.
pub fn heat_map_to(test: &Picture, reference: &Picture, top: f32) -> Picture {
    false_colours(test.width, &errors(test, reference), top)
}

/// Draws values from 0 to `top` (1, if that is not above 0) in the colours of [`heat_map`], with its scale bar. The picture is [`WIDER`]
/// columns wider than `width`.
///
/// # Panics
/// For a width of 0.
pub fn false_colours(width: u32, values: &[f32], top: f32) -> Picture {
    let (magma, top) = (magma(), if top > 0.0 { top } else { 1.0 });
    let colour = |fraction: f32| magma[(fraction * 255.0).round().min(255.0) as usize];
    let width = width as usize;
    let height = values.len() / width;
    let mut pixels = Vec::with_capacity((width + GAP + BAR) * height);
    for (y, row) in values.chunks_exact(width).enumerate() {
        pixels.extend(row.iter().map(|e| colour(e / top)));
        pixels.extend([[1.0; 3]; GAP]);
        pixels.extend([colour((height - 1 - y) as f32 / (height - 1).max(1) as f32); BAR]);
    }
    Picture { width: width as u32 + WIDER, height: height as u32, pixels }
}

fn errors(test: &Picture, reference: &Picture) -> Vec<f32> {
    assert_eq!(test.size(), reference.size(), "pictures of one size");
    let error = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f32>() / 3.0;
    test.pixels.iter().zip(&reference.pixels).map(error).collect()
}

/// Number of columns that [`heat_map`] adds.
pub const WIDER: u32 = (BAR + GAP) as u32;

/// The 99.9th percentile of the errors above 0, or 1 if there are none.
fn scale_top(errors: &[f32]) -> f32 {
    let mut some: Vec<f32> = errors.iter().copied().filter(|&e| e > 0.0).collect();
    some.sort_by(f32::total_cmp);
    let last = some.len().saturating_sub(1);
    some.get(last - last / 1000).copied().unwrap_or(1.0)
}

/// 256 linear colours from black through purple and orange to pale yellow.
fn magma() -> Vec<[f32; 3]> {
    let codes = nv_flip::magma_lut().to_vec();
    let linear = |c: u8| crate::math::srgb::linear_from_srgb(f32::from(c) / 255.0);
    codes.chunks_exact(3).map(|c| [linear(c[0]), linear(c[1]), linear(c[2])]).collect()
}
