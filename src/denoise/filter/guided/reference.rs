//! The guided filter on the host, window by window: the twin of both of its forms on a device.
use super::{Channels, GuidedSettings, GuidedSums, step};
use crate::denoise::filter::FilterInput;
use crate::denoise::filter::pixel::known_radiance;
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

/// An image, and the blocks that windows consist of.
struct Image<'a> {
    input: &'a FilterInput,
    pixels: Vec<Pixel>,
    size: [u32; 2],
    blocks: [u32; 2],
    step: u32,
    /// Blocks from a window's centre to its border.
    radius: u32,
    eps: &'a vec4,
}

impl<'a> Image<'a> {
    fn new(input: &'a FilterInput, own: &'a GuidedSettings, radius: u32, channels: Channels) -> Self {
        let pixel =
            |(c, g): (&vec4, &Guide)| Pixel { colour: known_radiance(*c).map(|c| c.as_dvec3()), guide: channels.of(g) };
        let pixels = input.radiance.iter().zip(&input.guide).map(pixel).collect();
        let size = input.size();
        let step = if own.sums == GuidedSums::Table { 1 } else { step(radius) };
        let blocks = size.map(|edge| edge.div_ceil(step));
        Self { input, pixels, size, blocks, step, radius: radius / step, eps: &own.eps }
    }

    fn block_of(&self, at: usize) -> usize {
        let (at, [width, _]) = (at as u32, self.size);
        (at / width / self.step * self.blocks[0] + at % width / self.step) as usize
    }

    /// Sums over the window around a block.
    fn sums(&self, block: usize) -> Option<Sums> {
        let (size, step) = (self.size, self.step);
        let mut known = Vec::new();
        for block in window(self.blocks, block, self.radius) {
            let corner = [block as u32 % self.blocks[0] * step, block as u32 / self.blocks[0] * step];
            let (left, right) = (corner[0], (corner[0] + step).min(size[0]));
            for v in corner[1]..(corner[1] + step).min(size[1]) {
                let row = &self.pixels[(v * size[0] + left) as usize..(v * size[0] + right) as usize];
                known.extend(row.iter().filter_map(|pixel| pixel.colour.map(|colour| (colour, pixel.guide))));
            }
        }
        Sums::new(&known, self.eps)
    }
}

/// Window by window, in double precision: the definition. Beside edges fits may be negative.
pub fn fits(input: &FilterInput, own: &GuidedSettings, radius: u32, channels: Channels) -> Vec<vec4> {
    let image = Image::new(input, own, radius, channels);
    let model = |block: usize| image.sums(block).map(Sums::model);
    let models: Vec<Option<Model>> =
        (0..(image.blocks[0] * image.blocks[1]) as usize).into_par_iter().map(model).collect();
    let mean = |at: usize| {
        let around = window(image.blocks, image.block_of(at), image.radius);
        let values = around.filter_map(|k| models[k]).map(|m| {
            let off = image.pixels[at].guide - m.mean_guide;
            m.mean + DVec3::from(m.slopes.map(|slope| slope.dot(off)))
        });
        let (count, sum) = values.fold((0.0, DVec3::ZERO), |(n, sum), v| (n + 1.0, sum + v));
        let own = image.pixels[at].colour.map(|c| c.as_vec3().extend(image.input.radiance[at][3]));
        let value = (sum / count).as_vec3();
        // A model that no float can hold, or no known pixel in reach: the pixel stays as it is.
        match value.is_finite() {
            true => value.extend(own.map_or(1.0, |own| own.w)).into(),
            false => own.unwrap_or_default().into(),
        }
    };
    (0..image.pixels.len()).into_par_iter().map(mean).collect()
}

/// The derivative of every pixel's value in the model of the window around it by its own value; at least the mean of that of the
/// window's pixels.
pub fn leverages(input: &FilterInput, own: &GuidedSettings, radius: u32, channels: Channels) -> Vec<f32> {
    let image = Image::new(input, own, radius, channels);
    let leverage = |at: usize| {
        image.sums(image.block_of(at)).map_or(1.0, |sums| {
            let off = image.pixels[at].guide - sums.mean_guide;
            let own = off.dot(solve(sums.guide, off));
            ((1.0 + own.max(sums.fitted_channels(image.eps))) / sums.count) as f32
        })
    };
    (0..image.pixels.len()).into_par_iter().map(leverage).collect()
}

/// Indices of the blocks of a window, clipped to the image.
fn window([width, height]: [u32; 2], at: usize, radius: u32) -> impl Iterator<Item = usize> {
    let (x, y) = (at as u32 % width, at as u32 / width);
    let around = move |v: u32, edge: u32| -> Range<u32> { v.saturating_sub(radius)..(v + radius + 1).min(edge) };
    around(y, height).flat_map(move |v| around(x, width).map(move |u| (v * width + u) as usize))
}

/// Means of a window's known pixels, covariances of the guide with eps added, and of the three colours with it.
struct Sums {
    count: f64,
    mean: DVec3,
    mean_guide: DVec4,
    guide: [[f64; 4]; 4],
    colour: [DVec4; 3],
}

impl Sums {
    /// Of none where no pixel is known.
    fn new(known: &[(DVec3, DVec4)], eps: &vec4) -> Option<Self> {
        let (count, share) = (known.len() as f64, 1.0 / known.len().max(1) as f64);
        let mean = known.iter().map(|(c, _)| c * share).sum::<DVec3>();
        let mean_guide = known.iter().map(|(_, g)| g * share).sum::<DVec4>();
        let (mut columns, mut colour) = ([DVec4::ZERO; 4], [DVec4::ZERO; 3]);
        // Whole columns, written out: builds that hardly optimise take several times as long for numbers one by one.
        for (c, g) in known {
            let (off, c) = (*g - mean_guide, *c - mean);
            columns[0] += off.x * off * share;
            columns[1] += off.y * off * share;
            columns[2] += off.z * off * share;
            columns[3] += off.w * off * share;
            colour[0] += off * c.x * share;
            colour[1] += off * c.y * share;
            colour[2] += off * c.z * share;
        }
        let mut guide = columns.map(|column| column.to_array());
        (0..4).for_each(|i| guide[i][i] += f64::from(eps[i]));
        (count > 0.0).then_some(Self { count, mean, mean_guide, guide, colour })
    }

    /// The trace of the inverse of `guide` times the covariances without eps.
    fn fitted_channels(&self, eps: &vec4) -> f64 {
        let column = |k: usize| {
            let mut column = self.guide[k];
            column[k] -= f64::from(eps[k]);
            solve(self.guide, DVec4::from_array(column))[k]
        };
        (0..4).map(column).sum()
    }

    fn model(self) -> Model {
        let slopes = self.colour.map(|rhs| solve(self.guide, rhs));
        Model { slopes, mean: self.mean, mean_guide: self.mean_guide }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Five pixels in a row with these depths, in windows of three.
    fn in_threes(depth: impl Fn(usize) -> f32, eps: f32) -> Vec<f32> {
        let guide = (0..5).map(|i| Guide { depth: depth(i), ..Default::default() }).collect();
        let input = FilterInput { width: 5, height: 1, radiance: vec![[1.0; 4]; 5], guide, variance: None };
        let settings = GuidedSettings { eps: [eps; 4], ..Default::default() };
        leverages(&input, &settings, 1, Channels::new(settings.channels, 1.0))
    }

    fn close(found: &[f32], right: [f32; 5]) -> bool {
        found.iter().zip(right).all(|(a, b)| (a - b).abs() < 1e-6)
    }

    #[test]
    fn leverages_are_shares_of_what_a_model_fits() {
        // A constant guide leaves means, of three pixels or, at the ends, of two.
        let means = in_threes(|_| 4.0, 0.0);
        assert!(close(&means, [0.5, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 0.5]), "{means:?}");
        // A line through two pixels meets both. One through depths of -1, 0 and 1 keeps two numbers of three; of the middle alone it
        // would keep a third.
        let lines = in_threes(|i| i as f32, 0.0);
        assert!(close(&lines, [1.0, 2.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0, 1.0]), "{lines:?}");
        // With an eps of as much as their variance, 2/3, half a slope is left; at the ends, of variance 1/4, 3/11.
        let ends = 0.5 * (1.0 + 3.0 / 11.0);
        let half = in_threes(|i| i as f32, 2.0 / 3.0);
        assert!(close(&half, [ends, 0.5, 0.5, 0.5, ends]), "{half:?}");
        // One that lies apart keeps more: depths of 0, 0 and 3 vary by 2, and it is 2 from their mean.
        let apart = in_threes(|i| if i == 2 { 3.0 } else { 0.0 }, 2.0);
        assert!((apart[2] - (1.0 + 4.0 / 4.0) / 3.0).abs() < 1e-6 && (apart[1] - 0.5).abs() < 1e-6, "{apart:?}");
    }
}
