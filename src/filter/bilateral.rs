//! The bilateral filter (Tomasi and Manduchi 1998), joint where normals or positions have weights: the yardstick of
//! quality. Kernel: `glsl/bilateral.comp`.
use super::edge::{Rates, edge_weight, rate};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, FilterSettings, Planes, Row};
use crate::error::Result;
use crate::gpu::layout::{BilateralPush, Effects, vec4};
use crate::gpu::{Gpu, Kernel, Recorder};
use crate::shaders::bilateral::Bind;
use glam::Vec3;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "bilateral",
    about: "exact bilateral filter, joint with normal and position",
    make: |gpu, settings, size| Ok(Box::new(Bilateral::new(gpu, settings, size)?)),
    reference,
};

/// Pixels of a column that a thread filters, and threads of a workgroup, as in the kernel.
const ROWS: u32 = 8;
const WORKGROUP: u32 = 32;

struct Bilateral {
    pack: Pack,
    kernel: Kernel<Bind<'static>>,
    settings: FilterSettings,
}

impl Bilateral {
    fn new(gpu: &Gpu, settings: &FilterSettings, size: [u32; 2]) -> Result<Self> {
        let kernel = Kernel::new(gpu, &Effects::default(), &Rates::new(settings).constants())?;
        Ok(Self { pack: Pack::new(gpu, size)?, kernel, settings: *settings })
    }
}

/// Of a Gaussian whose standard deviation is half the radius.
fn rate_space(settings: &FilterSettings) -> f32 {
    rate(settings.radius.max(1) as f32 * std::f32::consts::FRAC_1_SQRT_2)
}

impl Filter for Bilateral {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        let [width, height] = planes.size;
        let push = BilateralPush {
            size: planes.size,
            radius: self.settings.radius.min(width.max(height) - 1),
            rate_space: rate_space(&self.settings),
            rates: Rates::new(&self.settings).as_array(),
        };
        let bind = Bind { colour: &self.pack.colour, place: &self.pack.place, filtered: &planes.output };
        rec.dispatch(&self.kernel, bind, &push, [width.div_ceil(WORKGROUP), height.div_ceil(ROWS), 1])
    }
}

fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let image = Packed::reference(input);
    let (rates, space) = (Rates::new(settings), rate_space(settings));
    let (width, height, radius) = (input.width as i64, input.height as i64, i64::from(settings.radius));
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
