//! Smoothing of what `auto` estimates, over cells of pixels. Kernels: `glsl/auto/auto_cells.comp`, `auto_smooth.comp`,
//! `auto_spread.comp`. Twin: [`Cells`].
use super::alike;
use crate::denoise::filter::atrous_taps::{b3_spline, threads};
use crate::denoise::filter::edge::{EdgeSettings, Rates, edge_weight};
use crate::denoise::filter::pack::{Pack, Packed};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{AutoSmoothPush, SizePush, SurfacesPush, uvec4, vec3, vec4};
use crate::shaders::auto_spread::{OTHER, UNKNOWN};
use crate::shaders::shared::smoothing_cell::SMOOTHING_CELL;
use crate::shaders::{auto_cells, auto_smooth, auto_spread};
use crate::threads::each;
use glam::Vec4;

/// Levels of smoothing, a footprint of 61 pixels. Even: see [`Smoothing::record`].
const LEVELS: u32 = 4;
/// How much the errors of one surface count for another, to the power of the level: neighbours fully, far pixels hardly. Where
/// surfaces are small, as in grass, others are all there is to learn from, and few pixels seem to prove filters that keep much.
const ACROSS: f32 = 0.4;

/// Weight of what is not alike.
fn least(level: u32, across: bool) -> f32 {
    if across { ACROSS.powi(level as i32) } else { 0.0 }
}

/// Cells across and down an image.
fn grid([width, height]: [u32; 2]) -> [u32; 2] {
    [width, height].map(|edge| edge.div_ceil(SMOOTHING_CELL as u32))
}

/// The kernels of one or three planes.
struct Kernels {
    /// The first level, and the others.
    smooth: [Kernel<auto_smooth::Bind<'static>>; 2],
    spread: Kernel<auto_spread::Bind<'static>>,
}

impl Kernels {
    fn new(gpu: &Gpu, surfaces: &Rates, three: bool) -> Result<Self> {
        let (edge, local_size_x) = (surfaces.constants(), gpu.tuning().filter_workgroup);
        let smooth = |of_pixels| Kernel::new(gpu, &auto_smooth::Constants { edge, local_size_x, three, of_pixels });
        Ok(Self {
            smooth: each([true, false], smooth)?,
            spread: Kernel::new(gpu, &auto_spread::Constants { edge, three })?,
        })
    }
}

/// What smooths estimates of an image.
pub struct Smoothing {
    cells: Kernel<auto_cells::Bind<'static>>,
    /// Of one plane, which comes thrice, and of three.
    kernels: [Kernels; 2],
    /// The surfaces of cells.
    surfaces: Buffer<uvec4>,
    rates: vec3,
}

impl Smoothing {
    /// For images of (width, height).
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when it does not fit.
    pub fn new(gpu: &Gpu, edge: &EdgeSettings, size: [u32; 2]) -> Result<Self> {
        let (rates, [across, down]) = (Rates::of_surfaces(&alike(edge)), grid(size));
        Ok(Self {
            cells: Kernel::new(gpu, &Default::default())?,
            kernels: each([false, true], |three| Kernels::new(gpu, &rates, three))?,
            surfaces: Buffer::new(gpu, "cells", across as usize * down as usize, Location::Device)?,
            rates: rates.as_array(),
        })
    }

    /// colour\[P\], place\[P\] -> the surfaces of cells, for all that follows
    pub fn record_cells(&self, rec: &mut Recorder, pack: &Pack, size: [u32; 2]) -> Result<()> {
        let bind = auto_cells::Bind { packed_pixels: pack.bind(), cells: &self.surfaces };
        rec.dispatch(&self.cells, bind, &SizePush { size, ..Default::default() }, self.cells.groups(grid(size)))
    }

    /// from\[P\] -> to\[P\]; `between` holds every other level, and may be `from`. `across` surfaces, three planes; or within alike
    /// ones, one plane, which comes thrice.
    pub fn record(
        &self,
        rec: &mut Recorder,
        pack: &Pack,
        size: [u32; 2],
        [from, between, to]: [[&Buffer<vec4>; 3]; 3],
        across: bool,
    ) -> Result<()> {
        let (Kernels { smooth, spread }, rates) = (&self.kernels[usize::from(across)], self.rates);
        let (packed_pixels, cells) = (pack.bind(), &self.surfaces);
        for level in 0..LEVELS {
            let ([first, second, third], [first_smoothed, second_smoothed, third_smoothed]) = match level {
                0 => (from, to),
                level if level % 2 == 0 => (between, to),
                _ => (to, between),
            };
            let bind = auto_smooth::Bind {
                packed_pixels,
                cells,
                first,
                second,
                third,
                first_smoothed,
                second_smoothed,
                third_smoothed,
            };
            // The first level's taps are pixels, those of the others cells.
            let (smooth, spacing) =
                (&smooth[usize::from(level > 0)], if level == 0 { 1 } else { (1 << level) / SMOOTHING_CELL as u32 });
            let push = AutoSmoothPush { size, spacing, rates, least: least(level, across), ..Default::default() };
            rec.dispatch(smooth, bind, &push, smooth.groups(threads(grid(size), spacing)))?;
        }
        let ([first, second, third], [first_spread, second_spread, third_spread]) = (between, to);
        let bind =
            auto_spread::Bind { packed_pixels, cells, first, second, third, first_spread, second_spread, third_spread };
        rec.dispatch(spread, bind, &SurfacesPush { size, rates, ..Default::default() }, spread.groups(size))
    }
}

/// An image, and the surfaces that its cells stand for: what twins smooth over.
pub struct Cells<'a> {
    image: &'a [Packed],
    size: [i64; 2],
    surfaces: Vec<Packed>,
    /// Cells across and down.
    grid: [i64; 2],
    rates: Rates,
}

impl<'a> Cells<'a> {
    /// Of an image of (width, height).
    pub fn new(image: &'a [Packed], size: [u32; 2], edge: &EdgeSettings) -> Self {
        let (grid, [width, height]) = (grid(size), size);
        let surface = |cell: u32| {
            let [x, y] = [cell % grid[0], cell / grid[0]].map(|first| first * SMOOTHING_CELL as u32);
            let inside =
                |(i, j): (u32, u32)| (x + i < width && y + j < height).then(|| ((y + j) * width + x + i) as usize);
            let pixels = [(0, 0), (1, 0), (0, 1), (1, 1)].into_iter().filter_map(inside).map(|at| image[at]);
            let first = image[(y * width + x) as usize];
            pixels.into_iter().find(|pixel| pixel.count > 0.0).unwrap_or(first)
        };
        let surfaces = (0..grid[0] * grid[1]).map(surface).collect();
        let rates = Rates::of_surfaces(&alike(edge));
        Self { image, size: size.map(i64::from), surfaces, grid: grid.map(i64::from), rates }
    }

    /// A plane of estimates, `across` surfaces or within alike ones.
    pub fn smoothed(&self, plane: &[Vec4], across: bool) -> Vec<Vec4> {
        let first = self.level(plane, true, 1, least(0, across));
        let of_cells = (1..LEVELS).fold(first, |plane, level| {
            self.level(&plane, false, (1 << level) / i64::from(SMOOTHING_CELL), least(level, across))
        });
        self.spread(&of_cells)
    }

    fn level(&self, estimates: &[Vec4], of_pixels: bool, spacing: i64, least: f32) -> Vec<Vec4> {
        let (taps, [width, height], stride) = match of_pixels {
            true => (self.image, self.size, i64::from(SMOOTHING_CELL)),
            false => (&*self.surfaces, self.grid, 1),
        };
        let cell = |at: i64| {
            let (mut sum, mut total) = (Vec4::ZERO, 0.0);
            for (i, j) in (-2..=2i64).flat_map(|j| (-2..=2i64).map(move |i| (i, j))) {
                let u = (stride * (at % self.grid[0]) + i * spacing).clamp(0, width - 1);
                let v = (stride * (at / self.grid[0]) + j * spacing).clamp(0, height - 1);
                let (p, q) = (&self.surfaces[at as usize], &taps[(v * width + u) as usize]);
                let w = b3_spline(i) * b3_spline(j);
                let alike = edge_weight(q, self.rates.exponent(p, q));
                let w = if q.count > 0.0 { w * alike.max(least) } else { 0.0 };
                sum += w * estimates[(v * width + u) as usize];
                total += w;
            }
            if total > 0.0 { sum / total } else { Vec4::ZERO }
        };
        (0..self.grid[0] * self.grid[1]).map(cell).collect()
    }

    fn spread(&self, estimates: &[Vec4]) -> Vec<Vec4> {
        let [width, height] = self.size;
        let pixel = |at: i64| {
            let (p, [x, y]) = (&self.image[at as usize], [at % width, at / width]);
            let cell = i64::from(SMOOTHING_CELL);
            let between = [x, y].map(|v| (v % cell) as f32 / cell as f32);
            let (mut sum, mut total) = (Vec4::ZERO, 0.0);
            for (i, j) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let [u, v] = [(x / cell + i).min(self.grid[0] - 1), (y / cell + j).min(self.grid[1] - 1)];
                let (there, near) =
                    ((v * self.grid[0] + u) as usize, |step, b: f32| if step == 1 { b } else { 1.0 - b });
                let q = &self.surfaces[there];
                let alike = edge_weight(q, self.rates.exponent(p, q));
                let w =
                    near(i, between[0]) * near(j, between[1]) * if q.count > 0.0 { alike.max(OTHER) } else { UNKNOWN };
                sum += w * estimates[there];
                total += w;
            }
            sum / total
        };
        (0..width * height).map(pixel).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// An image of two surfaces that meet between columns 2 and 3, within a cell; `known` pixels have samples.
    fn two_surfaces([width, height]: [u32; 2], known: impl Fn(u32) -> bool) -> Vec<Packed> {
        let pixel = |i: u32| Packed {
            colour: Vec3::ONE,
            count: if known(i) { 4.0 } else { 0.0 },
            normal: if i % width < 3 { Vec3::X } else { Vec3::NEG_X },
            position: Vec3::ZERO,
        };
        (0..width * height).map(pixel).collect()
    }

    #[test]
    fn what_is_constant_stays_so() {
        for size in [[1, 1], [2, 1], [1, 7], [65, 3], [9, 8]] {
            let image = two_surfaces(size, |i| i % 3 != 1 || i == 1);
            let cells = Cells::new(&image, size, &EdgeSettings::default());
            for across in [false, true] {
                let found = cells.smoothed(&vec![Vec4::splat(3.0); image.len()], across);
                assert!(found.iter().all(|v| v.abs_diff_eq(Vec4::splat(3.0), 1e-5)), "{size:?}, {across}: {found:?}");
            }
        }
    }

    #[test]
    fn surfaces_keep_their_estimates_unless_they_are_smoothed_across() {
        let size = [9, 8];
        let image = two_surfaces(size, |i| i != 0); // the first cell stands for its second pixel
        let cells = Cells::new(&image, size, &EdgeSettings::default());
        let right = |i: usize| if i % 9 < 3 { 1.0 } else { 5.0 };
        let plane: Vec<Vec4> = (0..image.len()).map(|i| Vec4::splat(if i == 0 { 99.0 } else { right(i) })).collect();
        let off = |across| {
            let found = cells.smoothed(&plane, across);
            (0..image.len()).map(|i| (found[i].x - right(i)).abs()).fold(0.0, f32::max)
        };
        // Beside the border, half of a pixel's weight is a cell of the other surface, of which OTHER counts.
        assert!(off(false) < 2.0 * 4.0 * OTHER, "{}", off(false));
        assert!(off(true) > 0.5 && off(true) < 4.0, "{}", off(true));
    }
}
