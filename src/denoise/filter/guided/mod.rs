//! Guided image filter (He, Sun, Tang, ECCV 2010) on normals and depth, as Bauszat, Eisemann and Magnor (EGSR 2011) use
//! it. Kernels: `glsl/guided/`. Its time hardly depends on the radius.
mod pack;
mod reference;
mod table;

use super::as_light::{AsLight, as_light};
use super::{Filter, Planes, Row};
use crate::error::{Checked, Result};
use crate::gpu::{Buffer, Gpu, Kernel, Location, MAX_GROUPS, Recorder, Tuning};
use crate::layout::{GuidedPush, float, vec4};
use crate::settings::{Is, choices, settings};
use crate::shaders::{guided_columns, guided_mean_columns, guided_mean_rows, guided_rows, shared};
use crate::threads::both;
pub use pack::{BESIDE, Channels, Packed};
pub use reference::{fits, leverages};
use table::GuidedTable;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "guided",
    about: "guided image filter: light as a local linear function of normal and depth",
    bytes: 96, // colours, channels and four planes of models; tables are of small images
    weighs_noise: false,
    make: |gpu, s, size| {
        let (own, radius) = (&s.guided, s.footprint.radius);
        let pack = Packed::new(gpu, Channels::new(own.channels, s.edge.extent), size)?;
        let fits: Box<dyn Filter> = match own.sums {
            GuidedSums::Blocks => Box::new(Fits { windows: Windows::new(gpu, radius, own.eps, false, size)?, pack }),
            GuidedSums::Table => Box::new(GuidedTable::new(gpu, pack, radius, own.eps, size)?),
        };
        Ok(Box::new(Guided { fits, light: AsLight::new(gpu)? }))
    },
    reference: |input, s| {
        let channels = Channels::new(s.guided.channels, s.edge.extent);
        as_light(input, fits(input, &s.guided, s.footprint.radius, channels))
    },
};

/// `vec4`s of a pixel's record in a strip.
const RECORD: u64 = shared::moments::MOMENTS as u64;

choices! {
    /// How `guided` sums over windows.
    pub enum GuidedSums {
        /// Block by block, about local means: nothing cancels.
        #[default]
        Blocks,
        /// Summed-area tables, as published: digits are lost where images are large or guides far away. Images of one
        /// million pixels at most where storage buffers hold 128 MiB.
        Table,
    }
}

/// A guide of normals alone, or with depth.
const CHANNELS: Is<u32> = Is("1, 3 or 4", |n| [1, 3, 4].contains(n));
const EPS: Is<vec4> = Is("finite numbers of 0 or more", |eps| eps.iter().all(|e| e.is_finite() && *e >= 0.0));

settings! {
    /// What `guided` can be told, and `auto`, which has windows of it.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct GuidedSettings {
        /// What is given of them.
        GuidedOverrides {
            /// Channels of the guide: 1 (grey normal), 3 (normal) or 4 (normal and depth).
            channels: u32 = 4, CHANNELS;
            // Normals are halved, depths in units of the extent.
            /// Variance of the guide below which there is no edge: one number, or one per channel.
            eps: vec4 = [0.01, 0.01, 0.01, 0.02], EPS, [value_parser = per_channel, allow_hyphen_values = true];
            /// How windows are summed.
            sums: GuidedSums = GuidedSums::Blocks, ..;
        }
    }
}

/// Pixels from one window's centre to the next, and along the edges of the blocks that windows consist of: see
/// `glsl/shared/window_blocks.glsl`. Blocks of 4 x 4 pixels took longer.
fn step(radius: u32) -> u32 {
    if radius < 8 { 1 } else { 2 }
}

/// One number for all channels, or four.
#[cfg(feature = "cli")]
fn per_channel(text: &str) -> Checked<vec4> {
    let numbers: std::result::Result<Vec<f32>, _> = text.split(',').map(str::parse).collect();
    match numbers.as_deref() {
        Ok([n]) => Ok([*n; 4]),
        Ok(&[a, b, c, d]) => Ok([a, b, c, d]),
        _ => Err("expected one number, or four with commas between them".to_owned()),
    }
}

/// Alone, it leaves no light negative.
struct Guided {
    fits: Box<dyn Filter>,
    light: AsLight,
}

impl Filter for Guided {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.fits.record(rec, planes)?;
        self.light.record(rec, planes)
    }
}

/// Packs what it reads.
struct Fits {
    pack: Packed,
    windows: Windows,
}

impl Filter for Fits {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        let Packed { colour, channels, .. } = &self.pack;
        self.windows.record(rec, planes.size, [colour, channels], &planes.output)
    }
}

/// The filter of one radius, on what is packed already.
pub struct Windows {
    columns: Kernel<guided_columns::Bind<'static>>,
    rows: Kernel<guided_rows::Bind<'static>>,
    mean_columns: Kernel<guided_mean_columns::Bind<'static>>,
    mean_rows: Kernel<guided_mean_rows::Bind<'static>>,
    /// Slopes of the three colours, then the value at the window's centre with the number of its windows.
    model: [Buffer<vec4>; 4],
    /// How much of a pixel's own value the window around it keeps, row-major, if that is wanted; else one number.
    pub leverages: Buffer<float>,
    /// A strip's sums over columns.
    strip: Buffer<vec4>,
    down: Walk,
    along: Walk,
    strip_rows: u32,
    step: u32,
    eps: vec4,
}

/// Widest windows that a thread of a GPU takes at once, element by element, in a time that grows with the width.
const WIDEST_AT_ONCE: u32 = 255;
/// Most windows that a thread takes at once.
const MOST_AT_ONCE: u32 = 4;

/// How windows along a line are summed, by `glsl/shared/windows.glsl`.
#[derive(Clone, Copy)]
struct Walk {
    /// Elements of a window.
    window: u32,
    /// Windows that a thread takes.
    segment: u32,
    /// Lines of a workgroup.
    lines: u32,
}

impl Walk {
    fn new(tuning: &Tuning, radius: u32, edge: u32) -> Self {
        let window = 2 * radius.min(edge - 1) + 1;
        let segment = match tuning.windows {
            0 => edge,
            n if window <= WIDEST_AT_ONCE => n.min(window),
            _ => window,
        };
        Self { window, segment: segment.max(edge.div_ceil(MAX_GROUPS)), lines: tuning.lines }
    }

    /// Windows that are taken at a time, each of which costs registers, and the driver time to compile. Wide windows are worth more,
    /// lest their groups become many. Twice as many take .97 of the time on lavapipe, and 1.3 times as long to compile.
    fn tile(self) -> u32 {
        let most = if self.window > 40 { 8 } else { 4 };
        // Elements and groups, per window, that are added besides those of the tile itself.
        let besides = |tile: u32| {
            let whole = ((self.window - 1) / tile).max(1);
            f64::from(self.window - whole * (tile - 1)) / f64::from(tile)
        };
        let tiles = (most / 2 + 1).min(self.window)..=most.min(self.window);
        tiles.min_by(|a, b| besides(*a).total_cmp(&besides(*b))).unwrap_or(1)
    }

    fn constants(self) -> shared::windows::Constants {
        let at_once = if self.segment <= MOST_AT_ONCE.min(self.window) { self.segment } else { 0 };
        let [window, tile, at_once] = [self.window, self.tile(), at_once].map(|n| n as i32);
        shared::windows::Constants { window, tile, at_once }
    }

    /// Workgroups for `windows` of each of `lines`.
    fn groups(self, lines: u32, windows: u32) -> [u32; 3] {
        [lines.div_ceil(self.lines), windows.div_ceil(self.segment), 1]
    }
}

impl Windows {
    /// For images of (width, height); with `leverages` it leaves those too.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when its buffers do not fit.
    pub fn new(gpu: &Gpu, radius: u32, eps: vec4, leverages: bool, size: [u32; 2]) -> Result<Self> {
        let step = step(radius);
        let [width, height] = size.map(|edge| edge.div_ceil(step));
        let [down, along] = [height, width].map(|edge| Walk::new(gpu.tuning(), radius / step, edge));
        let strip_rows =
            strip_rows(gpu.tuning().strip_bytes, gpu.info().max_storage_range, down.window, [width, height]);
        let models = width.next_multiple_of(BESIDE) as usize * height as usize;
        let pixels = size[0] as usize * size[1] as usize;
        let plane = |name| Buffer::new(gpu, name, models, Location::Device);
        let records = u64::from(strip_rows.next_multiple_of(BESIDE)) * u64::from(width) * RECORD;
        let window_blocks = shared::window_blocks::Constants { step: step as i32 };
        let (local_size_x, windows) = (down.lines, down.constants());
        let columns = || Kernel::new(gpu, &guided_columns::Constants { windows, window_blocks, local_size_x });
        let mean_columns =
            || Kernel::new(gpu, &guided_mean_columns::Constants { windows, window_blocks, local_size_x });
        let (local_size_x, windows) = (along.lines, along.constants());
        let rows = || Kernel::new(gpu, &guided_rows::Constants { windows, window_blocks, leverages, local_size_x });
        let mean_rows = || Kernel::new(gpu, &guided_mean_rows::Constants { windows, window_blocks, local_size_x });
        let ((columns, rows), (mean_columns, mean_rows)) =
            both(|| both(columns, rows), || both(mean_columns, mean_rows))?;
        Ok(Self {
            columns,
            rows,
            mean_columns,
            mean_rows,
            model: [plane("slope_r")?, plane("slope_g")?, plane("slope_b")?, plane("value")?],
            leverages: Buffer::new(gpu, "leverages", if leverages { pixels } else { 1 }, Location::Device)?,
            strip: Buffer::new(gpu, "columns", records as usize, Location::Device)?,
            down,
            along,
            strip_rows,
            step,
            eps,
        })
    }

    /// Columns, then rows of every strip: (push, workgroups of the two).
    fn strips(&self, size: [u32; 2]) -> impl Iterator<Item = (GuidedPush, [[u32; 3]; 2])> {
        let ([width, height], eps, strip) = (size.map(|edge| edge.div_ceil(self.step)), self.eps, self.strip_rows);
        (0..height).step_by(strip as usize).map(move |first_row| {
            let rows = strip.min(height - first_row);
            let push = GuidedPush { size, first_row, rows, eps, ..Default::default() };
            (push, [self.down.groups(width, rows), self.along.groups(rows, width)])
        })
    }

    /// colour\[P\], channels\[P\] as [`Packed`] has them -> filtered\[P\], row-major
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the image is too large for the device.
    pub fn record(
        &self,
        rec: &mut Recorder,
        size: [u32; 2],
        packed: [&Buffer<vec4>; 2],
        filtered: &Buffer<vec4>,
    ) -> Result<()> {
        self.record_models(rec, size, packed)?;
        self.record_means(rec, size, packed, filtered)
    }

    fn record_models(&self, rec: &mut Recorder, size: [u32; 2], [colour, channels]: [&Buffer<vec4>; 2]) -> Result<()> {
        let [slope_r, slope_g, slope_b, value] = &self.model;
        let (columns, leverages) = (&self.strip, &self.leverages);
        for (push, [down, along]) in self.strips(size) {
            rec.dispatch(&self.columns, guided_columns::Bind { colour, channels, sums: columns }, &push, down)?;
            let bind = guided_rows::Bind { columns, channels, slope_r, slope_g, slope_b, value, leverages };
            rec.dispatch(&self.rows, bind, &push, along)?;
        }
        Ok(())
    }

    fn record_means(
        &self,
        rec: &mut Recorder,
        size: [u32; 2],
        [colour, channels]: [&Buffer<vec4>; 2],
        filtered: &Buffer<vec4>,
    ) -> Result<()> {
        let ([slope_r, slope_g, slope_b, value], columns) = (&self.model, &self.strip);
        for (push, [down, along]) in self.strips(size) {
            let bind = guided_mean_columns::Bind { slope_r, slope_g, slope_b, value, channels, sums: columns };
            rec.dispatch(&self.mean_columns, bind, &push, down)?;
            let bind = guided_mean_rows::Bind { columns, channels, colour, filtered };
            rec.dispatch(&self.mean_rows, bind, &push, along)?;
        }
        Ok(())
    }
}

/// At least a few windows where memory allows it, since the first rows of a strip are summed anew. `limit`: bytes of one
/// storage binding; a strip's last rows take the room of [`BESIDE`].
fn strip_rows(target: u64, limit: u64, window: u32, [width, height]: [u32; 2]) -> u32 {
    let (row, beside) = (RECORD * 16 * u64::from(width), u64::from(BESIDE));
    let wanted = (target / row).max(4 * u64::from(window));
    wanted.min((limit / row / beside).max(1) * beside).min(u64::from(height)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Or a driver would compile them for each size of an image.
    #[test]
    fn images_of_all_sizes_share_kernels() {
        for tuning in [Tuning::CPU, Tuning::GPU] {
            for radius in [0, 4, 30, 300] {
                let of = |edge| Walk::new(&tuning, radius, edge).constants().entries();
                assert_eq!(of(301), of(60_000), "{tuning:?}, radius {radius}");
                assert!(radius == 0 || of(radius) != of(301), "control: a window beyond the image");
            }
        }
    }

    #[test]
    fn strips_fit_a_storage_binding() {
        let limit = 1 << 27; // lavapipe's
        for size in [[1200, 1200], [3840, 2160], [1, 1], [31, 70_001], [100_000, 9]] {
            for window in [1, 49, 601, 1181] {
                let rows = strip_rows(32 << 20, limit, window, size);
                let records = u64::from(rows.next_multiple_of(BESIDE)) * u64::from(size[0]);
                assert!(
                    rows > 0 && rows <= size[1] && records * RECORD * 16 <= limit,
                    "{size:?} {window}: {rows} rows"
                );
            }
        }
        // 128 bytes a pixel: 213 rows of 32 MiB, 4 windows, or what the binding holds of rows, in eights.
        let rows = [1, 60, 300].map(|window| strip_rows(32 << 20, limit, window, [1228, 1200]));
        assert_eq!(rows, [213, 240, 848]);
    }
}
