//! Edge-avoiding À-Trous wavelet filter (Dammertz, Sewtz, Hanika, Lensch, HPG 2010). Kernel: `glsl/filter/atrous.comp`.
use super::edge::{Rates, edge_weight};
use super::footprint::FootprintSettings;
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, FilterSettings, Planes, Row};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{AtrousPush, vec4};
use crate::settings::{choices, settings};
use crate::shaders::atrous::{Bind, Constants, MOST_SAMPLES, ROWS};
use glam::Vec3;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "atrous",
    about: "edge-avoiding À-Trous wavelets, steered by radiance, normal and position",
    bytes: super::pack::BYTES + 16,
    make: |gpu, settings, size| Ok(Box::new(Atrous::new(gpu, settings, size)?)),
    reference,
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
            /// Which form of the weights atrous uses.
            form: AtrousForm = AtrousForm::Listing, ..;
            // EAW's 1 or 2 are for images of which every 2nd or 4th pixel is known; unknown pixels do without it anyway.
            /// First level on which atrous looks at radiance.
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
    settings: FilterSettings,
}

impl Atrous {
    fn new(gpu: &Gpu, settings: &FilterSettings, size: [u32; 2]) -> Result<Self> {
        let kernel = |level: u32| {
            let edge = Rates::at_level(&settings.edge, &settings.atrous, level).constants();
            Kernel::new(gpu, &Constants { edge, conserve: settings.atrous.conserve_energy })
        };
        let pack = Pack::new(gpu, size)?;
        let scratch = Buffer::new(gpu, "atrous", pack.colour.len(), Location::Device)?;
        Ok(Self { pack, kernels: [kernel(0)?, kernel(settings.atrous.rt_from_level)?], scratch, settings: *settings })
    }
}

impl Filter for Atrous {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        let [width, height] = planes.size;
        let mut from = &self.pack.colour;
        for level in 0..self.settings.footprint.levels {
            let last = level + 1 == self.settings.footprint.levels;
            let to = match last {
                true => &planes.output,
                false if level % 2 == 0 => &self.scratch,
                false => &self.pack.colour,
            };
            let (rates, spacing) = (Rates::at_level(&self.settings.edge, &self.settings.atrous, level), 1 << level);
            let push = AtrousPush { size: planes.size, spacing, rates: rates.as_array(), ..Default::default() };
            let kernel = &self.kernels[usize::from(level >= self.settings.atrous.rt_from_level)];
            let bind = Bind { colour: from, place: &self.pack.place, filtered: to };
            let columns = height.div_ceil(ROWS as u32 * spacing) * spacing;
            rec.dispatch(kernel, bind, &push, kernel.groups([width, columns]))?;
            from = to;
        }
        Ok(())
    }
}

/// Every level in turn, tap by tap.
fn reference(input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let mut image = Packed::reference(input);
    for level in 0..settings.footprint.levels {
        let rates = Rates::at_level(&settings.edge, &settings.atrous, level);
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
            let trust = if settings.atrous.conserve_energy { 1.0 } else { q.count.min(MOST_SAMPLES).sqrt() };
            let w = h * trust * edge_weight(&q, rates.exponent(&p, &q));
            sum += w * (q.colour - p.colour);
            total += w;
        }
    }
    let kept = settings.atrous.conserve_energy && p.count > 0.0;
    p.moved_by(sum, if kept { 1.0 } else { total })
}
