//! Edge-avoiding À-Trous wavelet filter (Dammertz, Sewtz, Hanika, Lensch, HPG 2010). Kernel: `glsl/filter/atrous.comp`.
use super::atrous_taps::{b3_spline, threads};
use super::edge::{EdgeSettings, Rates, edge_weight};
use super::footprint::FootprintSettings;
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, Planes, Row};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{AtrousPush, vec4};
use crate::settings::{choices, settings};
use crate::shaders::atrous::{Bind, Constants, MOST_SAMPLES};
use crate::shaders::shared::packed_pixels;
use glam::Vec3;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "atrous",
    about: "edge-avoiding À-Trous wavelets, steered by radiance, normal and position",
    bytes: super::pack::BYTES + 16,
    weighs_noise: false,
    make: |gpu, s, size| Ok(Box::new(Atrous::new(gpu, &s.edge, &s.atrous, s.footprint.levels, size)?)),
    reference: |input, s| reference(input, &s.edge, &s.atrous, s.footprint.levels),
};

choices! {
    /// How EAW's edge-stopping weights are computed: the paper's listing and its equations differ.
    pub enum AtrousForm {
        /// As the listing: squared differences, that of normals divided by the squared distance between taps.
        #[default]
        Listing,
        /// Squared differences, alike on every level.
        Squared,
        /// As equation 5 prints it: the norm of the difference, not squared.
        Printed,
    }
}

settings! {
    /// What `atrous` alone can be told.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct AtrousSettings {
        /// What is given of them.
        AtrousOverrides {
            /// Form of the weights.
            form: AtrousForm = AtrousForm::Listing, ..;
            // EAW's 1 or 2 are for images of which every 2nd or 4th pixel is known; unknown pixels do without it anyway.
            /// First level that looks at radiance.
            rt_from_level: u32 = 0, 0..=FootprintSettings::MAX_LEVELS;
            // So that no light is lost or gained. EAW's own proposal, a channel of weights that normalises the last level
            // alone, kept 0.79 to 1.04 of the light of five images where this keeps all of it, and less than no measure
            // at all.
            /// Leave rejected weight with the centre pixel.
            conserve_energy: bool = false, ..;
        }
    }
}

struct Atrous {
    pack: Pack,
    /// With the radiance weight, and without it for the levels that in-paint.
    kernels: [Kernel<Bind<'static>>; 2],
    scratch: Buffer<vec4>,
    /// One per level.
    rates: Vec<Rates>,
    rt_from_level: u32,
}

impl AtrousSettings {
    /// Of a level: the sigma of radiance halves from one to the next, and the listing's of normals doubles.
    fn rates(&self, edge: &EdgeSettings, level: u32) -> Rates {
        let spacing = (1 << level) as f32;
        let per_distance = if self.form == AtrousForm::Listing { spacing } else { 1.0 };
        let sigma_rt = if level < self.rt_from_level { f32::INFINITY } else { edge.sigma_rt / spacing };
        let scaled = EdgeSettings { sigma_rt, sigma_n: edge.sigma_n * per_distance, ..*edge };
        Rates::new(&scaled).per_square(self.form != AtrousForm::Printed)
    }
}

impl Atrous {
    fn new(gpu: &Gpu, edge: &EdgeSettings, own: &AtrousSettings, levels: u32, size: [u32; 2]) -> Result<Self> {
        let kernel = |level: u32| {
            let (edge, local_size_x) = (own.rates(edge, level).constants(), gpu.tuning().filter_workgroup);
            Kernel::new(gpu, &Constants { edge, local_size_x, conserve: own.conserve_energy })
        };
        let pack = Pack::new(gpu, size)?;
        Ok(Self {
            kernels: [kernel(0)?, kernel(own.rt_from_level)?],
            scratch: Buffer::new(gpu, "atrous", pack.colour.len(), Location::Device)?,
            rates: (0..levels).map(|level| own.rates(edge, level)).collect(),
            rt_from_level: own.rt_from_level,
            pack,
        })
    }
}

impl Filter for Atrous {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        let mut from = &self.pack.colour;
        for (level, rates) in (0..).zip(&self.rates) {
            let to = match level + 1 == self.rates.len() {
                true => &planes.output,
                false if level % 2 == 0 => &self.scratch,
                false => &self.pack.colour,
            };
            let spacing = 1 << level;
            let push = AtrousPush { size: planes.size, spacing, rates: rates.as_array(), ..Default::default() };
            let kernel = &self.kernels[usize::from(level >= self.rt_from_level as usize)];
            let bind = Bind { packed_pixels: packed_pixels::Bind { colour: from, ..self.pack.bind() }, filtered: to };
            rec.dispatch(kernel, bind, &push, kernel.groups(threads(planes.size, spacing)))?;
            from = to;
        }
        Ok(())
    }
}

/// One level over an image.
struct Level<'a> {
    image: &'a [Packed],
    size: [i64; 2],
    spacing: i64,
    rates: Rates,
    conserve: bool,
}

/// Every level in turn, tap by tap.
fn reference(input: &FilterInput, edge: &EdgeSettings, own: &AtrousSettings, levels: u32) -> Vec<vec4> {
    let (mut image, size) = (Packed::reference(input), input.size().map(i64::from));
    for level in 0..levels {
        let (rates, conserve) = (own.rates(edge, level), own.conserve_energy);
        let filter = Level { image: &image, size, spacing: 1 << level, rates, conserve };
        image = (0..image.len()).map(|at| filter.filtered(at)).collect();
    }
    image.iter().map(Packed::output).collect()
}

impl Level<'_> {
    fn filtered(&self, at: usize) -> Packed {
        let ([width, height], p) = (self.size, self.image[at]);
        let (x, y) = (at as i64 % width, at as i64 / width);
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for (i, j) in (-2i64..=2).flat_map(|i| (-2i64..=2).map(move |j| (i, j))) {
            let (u, v) = (x + i * self.spacing, y + j * self.spacing);
            if (0..width).contains(&u) && (0..height).contains(&v) {
                let q = self.image[(v * width + u) as usize];
                let h = b3_spline(i) * b3_spline(j);
                let trust = if self.conserve { 1.0 } else { q.count.min(MOST_SAMPLES).sqrt() };
                let w = h * trust * edge_weight(&q, self.rates.exponent(&p, &q));
                sum += w * (q.colour - p.colour);
                total += w;
            }
        }
        let kept = self.conserve && p.count > 0.0;
        p.moved_by(sum, if kept { 1.0 } else { total })
    }
}
