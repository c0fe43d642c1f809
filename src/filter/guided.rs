//! Guided image filter (He, Sun, Tang, ECCV 2010) on normals and depth, as Bauszat, Eisemann and Magnor (EGSR 2011) use
//! it. Kernels: `glsl/guided_*.comp`. Its time does not depend on the radius.
use super::guided_table::GuidedTable;
use super::pixel::{known_channel, known_radiance};
use super::{Filter, FilterInput, FilterSettings, GuidedSums, Planes, Row};
use crate::error::Result;
use crate::gpu::layout::{Effects, Guide, GuidedPackPush, GuidedPush, vec4};
use crate::gpu::{Bindings, Buffer, Gpu, Kernel, Location, Recorder};
use crate::shaders::{guided_columns, guided_mean_columns, guided_mean_rows, guided_pack, guided_rows};
use crate::stage::groups;
use glam::{DVec3, DVec4};
use rayon::prelude::*;
use std::ops::Range;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "guided",
    about: "guided image filter: light as a local linear function of normal and depth",
    make: |gpu, settings, size| {
        Ok(match settings.sums {
            GuidedSums::Blocks => Box::new(Guided::new(gpu, settings, size)?),
            GuidedSums::Table => Box::new(GuidedTable::new(gpu, settings, size)?),
        })
    },
    reference,
};

const WORKGROUP: u32 = 32;
/// Columns that lie beside each other, as in `glsl/shared/tiles.glsl`.
const COLUMNS: u32 = 8;
/// Most windows whose sums a thread counts from one point: its registers are 240 floats then.
const LARGEST_TILE: u32 = 8;
/// `vec4`s of a pixel's record in a strip.
const RECORD: u64 = 8;
/// Bytes of a strip on a CPU, whose caches should hold two; a GPU is filled by larger ones.
const STRIP_CPU: u64 = 8 << 20;
const STRIP_GPU: u64 = 256 << 20;

/// What the kernels read of an image.
pub struct Packed {
    kernel: Kernel<guided_pack::Bind<'static>>,
    /// Radiance and the samples behind it, all zero where nothing is known.
    pub colour: Buffer<vec4>,
    /// The guide.
    pub channels: Buffer<vec4>,
}

impl Packed {
    /// For images of (width, height).
    pub fn new(gpu: &Gpu, settings: &FilterSettings, [width, height]: [u32; 2]) -> Result<Self> {
        let pixels = width.next_multiple_of(COLUMNS) as usize * height as usize;
        Ok(Self {
            kernel: Kernel::new(gpu, &Effects::default(), &[(110, settings.channels)])?,
            colour: Buffer::new(gpu, "colour", pixels, Location::Device)?,
            channels: Buffer::new(gpu, "channels", pixels, Location::Device)?,
        })
    }

    /// radiance\[P\], guide\[P\] -> colour\[P\], channels\[P\]
    pub fn record(&self, rec: &mut Recorder, planes: &Planes, settings: &FilterSettings) -> Result<()> {
        let (radiance, guide) = (&planes.radiance, &planes.guide);
        let bind = guided_pack::Bind { radiance, guide, colour: &self.colour, channels: &self.channels };
        let push = GuidedPackPush { size: planes.size, depth_scale: 1.0 / settings.extent };
        rec.dispatch(&self.kernel, bind, &push, groups(self.colour.len() as u32, 64))
    }
}

/// Each pass over the strips is two dispatches of one kernel.
struct Guided {
    pack: Packed,
    // Backward, then forward.
    columns: [Kernel<guided_columns::Bind<'static>>; 2],
    rows: [Kernel<guided_rows::Bind<'static>>; 2],
    mean_columns: [Kernel<guided_mean_columns::Bind<'static>>; 2],
    mean_rows: [Kernel<guided_mean_rows::Bind<'static>>; 2],
    /// Slopes of the three colours, then the value at the window's centre with the number of its windows.
    model: [Buffer<vec4>; 4],
    /// A strip's sums over columns.
    strip: Buffer<vec4>,
    /// A strip's sums over the ends of blocks, for every tile.
    ends: Buffer<vec4>,
    strip_rows: u32,
    settings: FilterSettings,
}

impl Guided {
    fn new(gpu: &Gpu, settings: &FilterSettings, [width, height]: [u32; 2]) -> Result<Self> {
        let [down, along] = [height, width].map(|edge| 2 * settings.radius.min(edge - 1) + 1);
        let pack = Packed::new(gpu, settings, [width, height])?;
        let strip_rows = strip_rows(gpu, settings.radius, width, height);
        let plane = |name| Buffer::new(gpu, name, pack.colour.len(), Location::Device);
        let records = |name, count: u32| Buffer::new(gpu, name, count as usize * RECORD as usize, Location::Device);
        // Tiles of a line of this many pixels: each block may cut one.
        let tiles = |edge: u32, window: u32| edge.div_ceil(tile(window)) + edge.div_ceil(window);
        let most_ends = (tiles(strip_rows, down) * width).max(tiles(width, along) * strip_rows);
        Ok(Self {
            columns: both(gpu, down)?,
            rows: both(gpu, along)?,
            mean_columns: both(gpu, down)?,
            mean_rows: both(gpu, along)?,
            model: [plane("slope_r")?, plane("slope_g")?, plane("slope_b")?, plane("value")?],
            strip: records("columns", strip_rows * width)?,
            ends: records("ends", most_ends)?,
            strip_rows,
            settings: *settings,
            pack,
        })
    }

    /// Columns, then rows of every strip: (first row, pushes of the two, workgroups of the two).
    fn strips(&self, size: [u32; 2]) -> impl Iterator<Item = [(GuidedPush, [u32; 3]); 2]> {
        let ([width, height], settings, strip) = (size, self.settings, self.strip_rows);
        (0..height).step_by(strip as usize).map(move |first_row| {
            let rows = strip.min(height - first_row);
            let push = |edge: u32| GuidedPush {
                size,
                first_row,
                rows,
                radius: settings.radius.min(edge - 1),
                eps: settings.eps,
            };
            let (down, along) = (push(height), push(width));
            let blocks = |count: u32, push: &GuidedPush| count.div_ceil(2 * push.radius + 1);
            let groups_down = [width.div_ceil(WORKGROUP), blocks(rows, &down), 1];
            let groups_along = [rows.div_ceil(WORKGROUP), blocks(width, &along), 1];
            [(down, groups_down), (along, groups_along)]
        })
    }

    fn record_models(&self, rec: &mut Recorder, size: [u32; 2]) -> Result<()> {
        let [slope_r, slope_g, slope_b, value] = &self.model;
        let (colour, channels, columns, ends) = (&self.pack.colour, &self.pack.channels, &self.strip, &self.ends);
        for [(down, groups_down), (along, groups_along)] in self.strips(size) {
            for (kernel, [ends, sums]) in self.columns.iter().zip([[columns, ends], [ends, columns]]) {
                rec.dispatch(kernel, guided_columns::Bind { colour, channels, ends, sums }, &down, groups_down)?;
            }
            // The second writes models alone, and no sums.
            for (kernel, [ends, sums]) in self.rows.iter().zip([[columns, ends], [ends, columns]]) {
                let bind = guided_rows::Bind { columns, channels, ends, sums, slope_r, slope_g, slope_b, value };
                rec.dispatch(kernel, bind, &along, groups_along)?;
            }
        }
        Ok(())
    }

    fn record_means(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        let [slope_r, slope_g, slope_b, value] = &self.model;
        let (colour, channels, columns, ends) = (&self.pack.colour, &self.pack.channels, &self.strip, &self.ends);
        let filtered = &planes.output;
        for [(down, groups_down), (along, groups_along)] in self.strips(planes.size) {
            for (kernel, [ends, sums]) in self.mean_columns.iter().zip([[columns, ends], [ends, columns]]) {
                let bind = guided_mean_columns::Bind { slope_r, slope_g, slope_b, value, channels, ends, sums };
                rec.dispatch(kernel, bind, &down, groups_down)?;
            }
            for (kernel, [ends, sums]) in self.mean_rows.iter().zip([[columns, ends], [ends, columns]]) {
                let bind = guided_mean_rows::Bind { columns, channels, colour, ends, sums, filtered };
                rec.dispatch(kernel, bind, &along, groups_along)?;
            }
        }
        Ok(())
    }
}

/// Windows that a thread sums from one point: as equal parts of a block as there can be.
fn tile(window: u32) -> u32 {
    window.div_ceil(window.div_ceil(LARGEST_TILE))
}

/// A kernel for walking blocks backward, and the same for walking them forward.
fn both<B: Bindings>(gpu: &Gpu, window: u32) -> Result<[Kernel<B>; 2]> {
    let kernel = |backward| Kernel::new(gpu, &Effects::default(), &[(110, backward), (111, tile(window))]);
    Ok([kernel(1)?, kernel(0)?])
}

/// A multiple of the window where memory allows it, so that no block is cut.
fn strip_rows(gpu: &Gpu, radius: u32, width: u32, height: u32) -> u32 {
    let (info, window) = (gpu.info(), u64::from(2 * radius.min(height - 1) + 1));
    let row = RECORD * 16 * u64::from(width);
    let target = if info.kind == "CPU" { STRIP_CPU } else { STRIP_GPU };
    let wanted = (target / (row * window)).max(1) * window;
    wanted.min((info.max_storage_range / row).max(1)).min(u64::from(height)) as u32
}

impl Filter for Guided {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes, &self.settings)?;
        self.record_models(rec, planes.size)?;
        self.record_means(rec, planes)
    }
}

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
fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let pixel = |(c, g): (&vec4, &Guide)| Pixel {
        colour: known_radiance(*c).map(|c| c.as_dvec3()),
        guide: channels(g, settings),
    };
    let pixels: Vec<Pixel> = input.radiance.iter().zip(&input.guide).map(pixel).collect();
    let size = [input.width, input.height];
    let models: Vec<Option<Model>> = (0..pixels.len())
        .into_par_iter()
        .map(|at| model(&pixels, window(size, at, settings.radius), settings))
        .collect();
    let mean = |at: usize| {
        let values = window(size, at, settings.radius).filter_map(|k| models[k]).map(|m| {
            let off = pixels[at].guide - m.mean_guide;
            m.mean + DVec3::from(m.slopes.map(|slope| slope.dot(off)))
        });
        let (count, sum) = values.fold((0.0, DVec3::ZERO), |(n, sum), v| (n + 1.0, sum + v));
        let count_out = if pixels[at].colour.is_some() { input.radiance[at][3] } else { 1.0 };
        if count > 0.0 { (sum / count).as_vec3().extend(count_out).into() } else { [0.0; 4] }
    };
    (0..pixels.len()).into_par_iter().map(mean).collect()
}

fn channels(g: &Guide, settings: &FilterSettings) -> DVec4 {
    let n = glam::Vec3::from(g.normal.map(known_channel)) * 0.5;
    let depth = known_channel(g.depth * (1.0 / settings.extent));
    match settings.channels {
        1 => glam::vec4((n.x + n.y + n.z) / 3.0, 0.0, 0.0, 0.0),
        3 => n.extend(0.0),
        _ => n.extend(depth),
    }
    .as_dvec4()
}

/// Indices of the pixels of a window, clipped to the image.
fn window([width, height]: [u32; 2], at: usize, radius: u32) -> impl Iterator<Item = usize> {
    let (x, y) = (at as u32 % width, at as u32 / width);
    let around = move |v: u32, edge: u32| -> Range<u32> { v.saturating_sub(radius)..(v + radius + 1).min(edge) };
    around(y, height).flat_map(move |v| around(x, width).map(move |u| (v * width + u) as usize))
}

fn model(pixels: &[Pixel], window: impl Iterator<Item = usize>, settings: &FilterSettings) -> Option<Model> {
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
    (0..4).for_each(|i| guide[i][i] += f64::from(settings.eps[i]));
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
