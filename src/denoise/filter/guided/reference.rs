//! The guided filter on the host, window by window: the twin of both of its forms on a device.
use super::{GuidedSettings, GuidedSums, step};
use crate::denoise::filter::FilterInput;
use crate::denoise::filter::pixel::{known_channel, known_radiance};
use crate::layout::{Guide, vec4};
use glam::{DVec3, DVec4};
use rayon::prelude::*;
use std::ops::Range;

/// A pixel in double precision.
struct Pixel {
    colour: Option<DVec3>,
    guide: DVec4,
}

/// A window's model, with the value at the window's centre.
#[derive(Clone, Copy)]
struct Model {
    slopes: [DVec4; 3],
    mean: DVec3,
    mean_guide: DVec4,
}

/// Window by window, in double precision: the definition.
pub fn reference(input: &FilterInput, own: &GuidedSettings, radius: u32, extent: f32) -> Vec<vec4> {
    let pixel = |(c, g): (&vec4, &Guide)| Pixel {
        colour: known_radiance(*c).map(|c| c.as_dvec3()),
        guide: channels(g, own.channels, extent),
    };
    let pixels: Vec<Pixel> = input.radiance.iter().zip(&input.guide).map(pixel).collect();
    let (size, step) = ([input.width, input.height], if own.sums == GuidedSums::Table { 1 } else { step(radius) });
    let (blocks, radius) = (size.map(|edge| edge.div_ceil(step)), radius / step);
    let pixels_of = |block: usize| {
        let corner = [block as u32 % blocks[0] * step, block as u32 / blocks[0] * step];
        let [across, down] = [0, 1].map(|k| corner[k]..(corner[k] + step).min(size[k]));
        down.flat_map(move |v| across.clone().map(move |u| (v * size[0] + u) as usize))
    };
    let models: Vec<Option<Model>> = (0..(blocks[0] * blocks[1]) as usize)
        .into_par_iter()
        .map(|at| model(&pixels, window(blocks, at, radius).flat_map(pixels_of), &own.eps))
        .collect();
    let mean = |at: usize| {
        let block = at as u32 / size[0] / step * blocks[0] + at as u32 % size[0] / step;
        let values = window(blocks, block as usize, radius).filter_map(|k| models[k]).map(|m| {
            let off = pixels[at].guide - m.mean_guide;
            m.mean + DVec3::from(m.slopes.map(|slope| slope.dot(off)))
        });
        let (count, sum) = values.fold((0.0, DVec3::ZERO), |(n, sum), v| (n + 1.0, sum + v));
        let own = pixels[at].colour.map(|c| c.as_vec3().extend(input.radiance[at][3]));
        let value = (sum / count).as_vec3();
        // A model that no float can hold, or no known pixel in reach: the pixel stays as it is.
        match value.is_finite() {
            true => value.extend(own.map_or(1.0, |own| own.w)).into(),
            false => own.unwrap_or_default().into(),
        }
    };
    (0..pixels.len()).into_par_iter().map(mean).collect()
}

fn channels(g: &Guide, channels: u32, extent: f32) -> DVec4 {
    let n = glam::Vec3::from(g.normal.map(known_channel)) * 0.5;
    let depth = known_channel(g.depth * (1.0 / extent));
    match channels {
        1 => glam::vec4((n.x + n.y + n.z) / 3.0, 0.0, 0.0, 0.0),
        3 => n.extend(0.0),
        _ => n.extend(depth),
    }
    .as_dvec4()
}

/// Indices of the blocks of a window, clipped to the image.
fn window([width, height]: [u32; 2], at: usize, radius: u32) -> impl Iterator<Item = usize> {
    let (x, y) = (at as u32 % width, at as u32 / width);
    let around = move |v: u32, edge: u32| -> Range<u32> { v.saturating_sub(radius)..(v + radius + 1).min(edge) };
    around(y, height).flat_map(move |v| around(x, width).map(move |u| (v * width + u) as usize))
}

fn model(pixels: &[Pixel], window: impl Iterator<Item = usize>, eps: &vec4) -> Option<Model> {
    let known: Vec<(DVec3, DVec4)> =
        window.filter_map(|k| pixels[k].colour.map(|colour| (colour, pixels[k].guide))).collect();
    let share = 1.0 / known.len().max(1) as f64;
    let mean = known.iter().map(|(c, _)| c * share).sum::<DVec3>();
    let mean_guide = known.iter().map(|(_, g)| g * share).sum::<DVec4>();
    let (mut guide, mut colour) = ([[0.0; 4]; 4], [DVec4::ZERO; 3]);
    for (c, g) in &known {
        let (off, c) = (*g - mean_guide, *c - mean);
        for i in 0..4 {
            (0..4).for_each(|j| guide[i][j] += off[i] * off[j] * share);
        }
        (0..3).for_each(|i| colour[i] += off * c[i] * share);
    }
    (0..4).for_each(|i| guide[i][i] += f64::from(eps[i]));
    (!known.is_empty()).then(|| Model { slopes: colour.map(|rhs| solve(guide, rhs)), mean, mean_guide })
}

/// Gaussian elimination without exchanges, for symmetric matrices that are not negative; a channel that the others
/// explain takes no part.
fn solve(mut a: [[f64; 4]; 4], mut rhs: DVec4) -> DVec4 {
    let diagonal = [0, 1, 2, 3].map(|i| a[i][i]);
    let usable = |i: usize, pivot: f64| pivot > 1e-5 * diagonal[i] && pivot > 1e-20;
    for i in 0..4 {
        for j in i + 1..4 {
            let factor = if usable(i, a[i][i]) { a[j][i] / a[i][i] } else { 0.0 };
            (i..4).for_each(|k| a[j][k] -= factor * a[i][k]);
            rhs[j] -= factor * rhs[i];
        }
    }
    let mut x = DVec4::ZERO;
    for i in (0..4).rev() {
        let rest: f64 = (i + 1..4).map(|k| a[i][k] * x[k]).sum();
        x[i] = if usable(i, a[i][i]) { (rhs[i] - rest) / a[i][i] } else { 0.0 };
    }
    x
}
