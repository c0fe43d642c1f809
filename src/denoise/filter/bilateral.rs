//! The bilateral filter (Tomasi and Manduchi 1998), joint where normals or positions have weights: the yardstick of
//! quality. Kernel: `glsl/filter/bilateral.comp`.
use super::edge::{Rates, edge_weight, rate};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, Planes, Row};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{BilateralPush, vec4};
use crate::shaders::bilateral::{self, Bind, Constants};
use glam::Vec3;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "bilateral",
    about: "exact bilateral filter, joint with normal and position",
    bytes: super::pack::BYTES + 16,
    weighs_noise: false,
    make: |gpu, s, size| Ok(Box::new(Bilateral::new(gpu, Rates::new(&s.edge), s.footprint.radius, size)?)),
    reference: |input, s| reference(input, &Rates::new(&s.edge), s.footprint.radius),
};

/// Pixels of a column that a thread filters.
const ROWS: u32 = bilateral::ROWS as u32;

/// Taps of a thread in one dispatch: software devices end loops early (`glsl/shared/loop_limit.glsl`).
const TAPS: u32 = 60_000;

struct Bilateral {
    pack: Pack,
    kernel: Kernel<Bind<'static>>,
    /// One element where one dispatch is enough.
    sums: Buffer<vec4>,
    /// No more than there is around a pixel.
    radius: u32,
    rate_space: f32,
    rates: Rates,
}

impl Bilateral {
    fn new(gpu: &Gpu, rates: Rates, radius: u32, size: [u32; 2]) -> Result<Self> {
        let (pack, rate_space) = (Pack::new(gpu, size)?, rate_space(radius));
        let radius = radius.min(size[0].max(size[1]) - 1);
        let banded = bands(radius).0 > 1;
        let (edge, local_size_x) = (rates.constants(), gpu.tuning().filter_workgroup);
        let kernel = Kernel::new(gpu, &Constants { edge, local_size_x, bands: banded })?;
        let sums = Buffer::new(gpu, "sums", if banded { pack.colour.len() } else { 1 }, Location::Device)?;
        Ok(Self { pack, kernel, sums, radius, rate_space, rates })
    }
}

/// How many bands a thread's window is cut into, and the rows of each.
fn bands(radius: u32) -> (u32, u32) {
    let (columns, rows) = (2 * radius + 1, 2 * radius + ROWS);
    let band = (TAPS / columns).clamp(1, rows);
    (rows.div_ceil(band), band)
}

/// Of a Gaussian whose standard deviation is half the radius.
fn rate_space(radius: u32) -> f32 {
    rate(radius.max(1) as f32 * std::f32::consts::FRAC_1_SQRT_2)
}

impl Filter for Bilateral {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        let [width, height] = planes.size;
        let (bands, band_rows) = bands(self.radius);
        let push = BilateralPush {
            size: planes.size,
            radius: self.radius,
            rate_space: self.rate_space,
            rates: self.rates.as_array(),
            band: 0,
            band_rows,
            ..Default::default()
        };
        (0..bands).try_for_each(|band| {
            let bind = Bind { packed_pixels: self.pack.bind(), filtered: &planes.output, sums: &self.sums };
            let groups = self.kernel.groups([width, height.div_ceil(ROWS)]);
            rec.dispatch(&self.kernel, bind, &BilateralPush { band, ..push }, groups)
        })
    }
}

fn reference(input: &FilterInput, rates: &Rates, radius: u32) -> Vec<vec4> {
    let image = Packed::reference(input);
    let space = rate_space(radius);
    let (width, height, radius) = (input.width as i64, input.height as i64, i64::from(radius));
    let pixel = |at: usize| {
        let (x, y) = (at as i64 % width, at as i64 / width);
        let p = image[at];
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for v in (y - radius).max(0)..=(y + radius).min(height - 1) {
            for u in (x - radius).max(0)..=(x + radius).min(width - 1) {
                let q = image[(v * width + u) as usize];
                let distance = ((u - x).pow(2) + (v - y).pow(2)) as f32;
                let w = edge_weight(&q, rates.exponent(&p, &q) - space * distance);
                sum += w * (q.colour - p.colour);
                total += w;
            }
        }
        p.moved_by(sum, total)
    };
    (0..image.len()).map(|at| pixel(at).output()).collect()
}
