//! Colour divided by albedo, for images that do not hold direct light apart.
use super::{Light, finite};
use crate::layout::vec3;
use crate::shaders::demodulate::{OUTLIER, SMALLEST_ALBEDO, WHOLE};

/// Lamps and sky, and the pixels at their rims, are not filtered: a rim's light divided by its little albedo would
/// outshine everything around it.
pub(super) fn split(colour: &[vec3], albedo: &[vec3], width: usize) -> Light {
    let is_rim = |i: usize| is_rim(colour, albedo, width, i);
    let factor = |i: usize| match reflects(&albedo[i]) && !is_rim(i) {
        true => divisor(&albedo[i]),
        false => [0.0; 3],
    };
    let factor: Vec<vec3> = (0..colour.len()).map(factor).collect();
    let lit = |(c, f): (&vec3, &vec3)| if f[0] > 0.0 { std::array::from_fn(|k| c[k] / f[k]) } else { [0.0; 3] };
    let dark = |(c, f): (&vec3, &vec3)| if f[0] > 0.0 { [0.0; 3] } else { c.map(finite) };
    Light {
        filtered: colour.iter().zip(&factor).map(lit).collect(),
        sharp: colour.iter().zip(&factor).map(dark).collect(),
        factor,
        unlit: None,
        variance: None,
        note: "filtered: colour / albedo; what has no albedo, and its rim, stays as it is",
    }
}

/// What a pixel's colour is divided by.
pub(super) fn divisor(albedo: &vec3) -> vec3 {
    albedo.map(|v| finite(v).max(SMALLEST_ALBEDO))
}

pub(super) fn reflects(albedo: &vec3) -> bool {
    largest(albedo) > SMALLEST_ALBEDO
}

/// 0 for what is no number.
fn largest(v: &vec3) -> f32 {
    v.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max)
}

/// Beside something brighter that reflects nothing, and partly of it: with less albedo than another neighbour, or, where
/// albedo is that of pixel centres, far brighter than most neighbours.
fn is_rim(colour: &[vec3], albedo: &[vec3], width: usize, i: usize) -> bool {
    let neighbours = || neighbours(colour.len(), width, i);
    let outshone = |q: usize| !reflects(&albedo[q]) && largest(&colour[q]) > largest(&colour[i]);
    if !neighbours().any(outshone) {
        return false;
    }
    let mut others: Vec<f32> = neighbours().filter(|&q| reflects(&albedo[q])).map(|q| largest(&colour[q])).collect();
    others.sort_by(f32::total_cmp);
    let median = others.get(others.len() / 2).copied().unwrap_or(0.0);
    largest(&colour[i]) > OUTLIER * median || neighbours().any(|q| largest(&albedo[i]) < WHOLE * largest(&albedo[q]))
}

/// Up to eight.
fn neighbours(pixels: usize, width: usize, i: usize) -> impl Iterator<Item = usize> {
    let (x, y, height) = (i % width, i / width, pixels / width);
    let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
    let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
    rows.flat_map(move |y| columns.clone().map(move |x| y * width + x)).filter(move |&q| q != i)
}
