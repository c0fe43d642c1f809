//! Edge-avoiding À-Trous wavelet filter (Dammertz, Sewtz, Hanika, Lensch, HPG 2010). Kernel: `glsl/atrous.comp`.
use super::pack::{Pack, Packed};
use super::{AtrousForm, Filter, FilterInput, FilterSettings, Planes, Row};
use crate::error::Result;
use crate::gpu::layout::{AtrousPush, Effects, vec4};
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::shaders::atrous::Bind;
use glam::Vec3;
use std::f32::consts::LOG2_E;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "atrous",
    about: "edge-avoiding À-Trous wavelets, steered by radiance, normal and position",
    make: |gpu, settings, size| Ok(Box::new(Atrous::new(gpu, settings, size)?)),
    reference,
};

/// Pixels of a column that a thread filters, and threads of a workgroup, as in the kernel.
const ROWS: u32 = 4;
const WORKGROUP: u32 = 32;
/// Weights below 2^LEAST are 0.
const LEAST: f32 = -80.0;

struct Atrous {
    pack: Pack,
    /// With the radiance weight, and without it for the levels that in-paint.
    kernels: [Kernel<Bind<'static>>; 2],
    scratch: Buffer<vec4>,
    settings: FilterSettings,
}

impl Atrous {
    fn new(gpu: &Gpu, settings: &FilterSettings, size: [u32; 2]) -> Result<Self> {
        let kernel = |level: u32| {
            let rates = Rates::new(settings, level);
            let switches = [
                rates.rt > 0.0,
                rates.n > 0.0,
                rates.x > 0.0,
                settings.form != AtrousForm::Printed,
                settings.conserve_energy,
            ];
            let constants: Vec<_> = (110..).zip(switches.map(u32::from)).collect();
            Kernel::new(gpu, &Effects::default(), &constants)
        };
        let pack = Pack::new(gpu, size)?;
        let scratch = Buffer::new(gpu, "atrous", pack.colour.len(), Location::Device)?;
        Ok(Self { pack, kernels: [kernel(0)?, kernel(settings.rt_from_level)?], scratch, settings: *settings })
    }
}

impl Filter for Atrous {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        let [width, height] = planes.size;
        let mut from = &self.pack.colour;
        for level in 0..self.settings.levels {
            let last = level + 1 == self.settings.levels;
            let to = match last {
                true => &planes.output,
                false if level % 2 == 0 => &self.scratch,
                false => &self.pack.colour,
            };
            let (rates, spacing) = (Rates::new(&self.settings, level), 1 << level);
            let push = AtrousPush { size: planes.size, spacing, rate_rt: rates.rt, rate_n: rates.n, rate_x: rates.x };
            let kernel = &self.kernels[usize::from(level >= self.settings.rt_from_level)];
            let bind = Bind { colour: from, place: &self.pack.place, filtered: to };
            let columns = height.div_ceil(ROWS * spacing) * spacing;
            rec.dispatch(kernel, bind, &push, [width.div_ceil(WORKGROUP), columns, 1])?;
            from = to;
        }
        Ok(())
    }
}

/// Exponents of the weights, in base 2, per squared (or plain) difference; 0 switches a weight off.
struct Rates {
    rt: f32,
    n: f32,
    x: f32,
}

impl Rates {
    fn new(s: &FilterSettings, level: u32) -> Self {
        let rate = |sigma: f32| match f64::from(LOG2_E) / f64::from(sigma).powi(2) {
            rate if rate < f64::from(f32::MIN_POSITIVE) => 0.0,
            rate => rate.min(f64::from(f32::MAX)) as f32,
        };
        let spacing = (1 << level) as f32;
        let per_distance = if s.form == AtrousForm::Listing { spacing } else { 1.0 };
        let sigma_rt = if level < s.rt_from_level { f32::INFINITY } else { s.sigma_rt * s.intensity / spacing };
        Self { rt: rate(sigma_rt), n: rate(s.sigma_n * per_distance), x: rate(s.sigma_x * s.extent) }
    }
}

/// Every level in turn, tap by tap.
fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let mut image = Packed::reference(input);
    for level in 0..settings.levels {
        let rates = Rates::new(settings, level);
        let pixel = |at: usize| filtered(&image, [input.width, input.height], at, 1 << level, &rates, settings);
        image = (0..image.len()).map(pixel).collect();
    }
    image.iter().map(Packed::output).collect()
}

fn filtered(
    image: &[Packed],
    [width, height]: [u32; 2],
    at: usize,
    spacing: i64,
    rates: &Rates,
    settings: &FilterSettings,
) -> Packed {
    const B3: [f32; 3] = [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0];
    let (x, y) = (at as i64 % i64::from(width), at as i64 / i64::from(width));
    let p = image[at];
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for (i, j) in (-2i64..=2).flat_map(|i| (-2i64..=2).map(move |j| (i, j))) {
        let (u, v) = (x + i * spacing, y + j * spacing);
        if (0..i64::from(width)).contains(&u) && (0..i64::from(height)).contains(&v) {
            let q = image[(v * i64::from(width) + u) as usize];
            let h = B3[i.unsigned_abs() as usize] * B3[j.unsigned_abs() as usize];
            let w = h * edge_weight(&p, &q, rates, settings.form);
            sum += w * (q.colour - p.colour);
            total += w;
        }
    }
    let known = p.count > 0.0;
    let divisor = if settings.conserve_energy && known { 1.0 } else { total };
    match total > 0.0 {
        true => Packed { colour: p.colour + sum / divisor, count: if known { p.count } else { 1.0 }, ..p },
        false => p,
    }
}

fn edge_weight(p: &Packed, q: &Packed, rates: &Rates, form: AtrousForm) -> f32 {
    let difference = |d: Vec3| if form == AtrousForm::Printed { d.length() } else { d.length_squared() };
    let term = |rate: f32, d: Vec3| if rate > 0.0 { rate * difference(d) } else { 0.0 };
    let rt = if p.count > 0.0 { term(rates.rt, q.colour - p.colour) } else { 0.0 };
    let exponent = -rt - term(rates.n, q.normal - p.normal) - term(rates.x, q.position - p.position);
    if q.count > 0.0 && exponent > LEAST { exponent.exp2() } else { 0.0 }
}
