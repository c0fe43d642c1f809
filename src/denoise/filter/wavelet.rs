//! Decimated wavelets whose details are dropped, as EAW is compared with: CDF(2,2) and red-black (Uytterhoeven and
//! Bultheel 1998), and with edge-stopping weights their edge-avoiding forms (Fattal 2009). Kernel: `glsl/filter/wavelet.comp`.
//!
//! Predictions are weighted means, and updates half of such means, as Fattal has them. The weights are EAW's, of guides too,
//! not 1 / (|a - b|^alpha + eps) of the image alone; and on the way back, that of radiance compares with the smoothed
//! neighbours, where Fattal keeps the weights of the way down.
//!
//! Updates keep the mean of the image where all weights are equal and all pixels known. Beside edges and unknown pixels they do not,
//! and a few coarse coefficients stand for all of a small image: a sphere beside a sky in 64 x 64 pixels lost two fifths of its light.
use super::as_light::{AsLight, as_light};
use super::edge::{Rates, edge_weight};
use super::pack::{Pack, Packed};
use super::{Filter, FilterInput, Planes, Row};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{WaveletPush, vec4};
use crate::settings::{choices, settings};
use crate::shaders::shared::packed_pixels;
use crate::shaders::wavelet::{Bind, Constants};
use crate::threads::each;
use glam::Vec3;

/// See [`super::FILTERS`].
pub const ROW: Row = Row {
    name: "wavelet",
    about: "decimated wavelets, CDF(2,2) or red-black, edge-avoiding where there are weights",
    bytes: super::pack::BYTES + 16,
    weighs_noise: false,
    make: |gpu, s, size| {
        let steps = steps(s.footprint.levels, s.wavelet.basis);
        Ok(Box::new(Wavelet::new(gpu, Rates::new(&s.edge), steps, size)?))
    },
    reference: |input, s| {
        as_light(input, reference(input, Rates::new(&s.edge), steps(s.footprint.levels, s.wavelet.basis)))
    },
};

/// Neighbours by stencil: along rows, along columns, side by side, diagonally.
const AROUND: [&[[i64; 2]]; 4] = [
    &[[-1, 0], [1, 0]],
    &[[0, -1], [0, 1]],
    &[[-1, 0], [1, 0], [0, -1], [0, 1]],
    &[[-1, -1], [1, -1], [-1, 1], [1, 1]],
];

/// A lifting step: (spacing, stencil, whether it goes back).
type Lifting = (u32, u32, bool);

/// All of them in turn.
fn steps(levels: u32, basis: WaveletBasis) -> Vec<Lifting> {
    let stencils = match basis {
        WaveletBasis::Cdf22 => [0, 1],
        WaveletBasis::RedBlack => [2, 3],
    };
    let forward: Vec<_> = (0..levels).flat_map(|l| stencils.map(|s| (1 << l, s, false))).collect();
    let back: Vec<_> = forward.iter().rev().map(|&(spacing, stencil, _)| (spacing, stencil, true)).collect();
    [forward, back].concat()
}

choices! {
    /// The lattices of the decimated wavelets.
    pub enum WaveletBasis {
        /// CDF(2,2), along rows and columns.
        #[default]
        Cdf22,
        /// Red-black, on the quincunx.
        RedBlack,
    }
}

settings! {
    /// What `wavelet` alone can be told.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct WaveletSettings {
        /// What is given of them.
        WaveletOverrides {
            /// Wavelets.
            basis: WaveletBasis = WaveletBasis::Cdf22, ..;
        }
    }
}

struct Wavelet {
    pack: Pack,
    /// Forward, then back.
    kernels: [Kernel<Bind<'static>>; 2],
    scratch: Buffer<vec4>,
    rates: Rates,
    steps: Vec<Lifting>,
    light: AsLight,
}

impl Wavelet {
    fn new(gpu: &Gpu, rates: Rates, steps: Vec<Lifting>, size: [u32; 2]) -> Result<Self> {
        let (edge, local_size_x) = (rates.constants(), gpu.tuning().filter_workgroup);
        let kernel = |inverse| Kernel::new(gpu, &Constants { edge, local_size_x, inverse });
        let pack = Pack::new(gpu, size)?;
        let scratch = Buffer::new(gpu, "wavelet", pack.colour.len(), Location::Device)?;
        let light = AsLight::new(gpu)?;
        Ok(Self { pack, kernels: each([false, true], kernel)?, scratch, rates, steps, light })
    }
}

impl Filter for Wavelet {
    fn record(&self, rec: &mut Recorder, planes: &Planes) -> Result<()> {
        self.pack.record(rec, planes)?;
        let mut from = &self.pack.colour;
        for (i, (spacing, stencil, inverse)) in self.steps.iter().copied().enumerate() {
            let to = match i + 1 == self.steps.len() {
                true => &planes.output,
                false if i % 2 == 0 => &self.scratch,
                false => &self.pack.colour,
            };
            let rates = self.rates.as_array();
            let push = WaveletPush { size: planes.size, spacing, stencil, rates, ..Default::default() };
            let bind = Bind { packed_pixels: packed_pixels::Bind { colour: from, ..self.pack.bind() }, filtered: to };
            let kernel = &self.kernels[usize::from(inverse)];
            rec.dispatch(kernel, bind, &push, kernel.groups(planes.size))?;
            from = to;
        }
        self.light.record(rec, planes)
    }
}

/// One lifting step over an image.
struct Step<'a> {
    image: &'a [Packed],
    size: [i64; 2],
    spacing: i64,
    stencil: usize,
    rates: Rates,
}

fn reference(input: &FilterInput, rates: Rates, steps: Vec<Lifting>) -> Vec<vec4> {
    let mut image = Packed::reference(input);
    let size = [i64::from(input.width), i64::from(input.height)];
    for (spacing, stencil, inverse) in steps {
        let step = Step { image: &image, size, spacing: i64::from(spacing), stencil: stencil as usize, rates };
        image = (0..image.len()).map(|at| step.lifted(at as i64, inverse)).collect();
    }
    image.iter().map(Packed::output).collect()
}

impl Step<'_> {
    fn lifted(&self, at: i64, inverse: bool) -> Packed {
        let (x, y) = (at % self.size[0], at / self.size[0]);
        let p = self.image[at as usize];
        match (self.parity(x, y), inverse) {
            (Some(true), true) => self.predicted(x, y),
            (Some(false), false) if p.count == 0.0 => self.predicted(x, y),
            (Some(false), false) => Packed { colour: p.colour + self.update(x, y), ..p },
            _ => p,
        }
    }

    /// Whether a pixel of the lattice is odd.
    fn parity(&self, x: i64, y: i64) -> Option<bool> {
        let (u, v) = (x / self.spacing, y / self.spacing);
        let on = x % self.spacing == 0 && y % self.spacing == 0;
        let (on, odd) = match self.stencil {
            0 => (on, u % 2 == 1),
            1 => (on && u % 2 == 0, v % 2 == 1),
            2 => (on, (u + v) % 2 == 1),
            _ => (on && (u + v) % 2 == 0, u % 2 == 1),
        };
        on.then_some(odd)
    }

    fn neighbours(&self, x: i64, y: i64) -> impl Iterator<Item = (i64, i64, f32)> {
        let p = self.image[(y * self.size[0] + x) as usize];
        AROUND[self.stencil].iter().filter_map(move |[i, j]| {
            let (u, v) = (x + i * self.spacing, y + j * self.spacing);
            let inside = (0..self.size[0]).contains(&u) && (0..self.size[1]).contains(&v);
            let q = self.image.get((v * self.size[0] + u) as usize).filter(|_| inside)?;
            Some((u, v, edge_weight(q, self.rates.exponent(&p, q))))
        })
    }

    fn predicted(&self, x: i64, y: i64) -> Packed {
        let p = self.image[(y * self.size[0] + x) as usize];
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for (u, v, w) in self.neighbours(x, y) {
            sum += w * (self.image[(v * self.size[0] + u) as usize].colour - p.colour);
            total += w;
        }
        p.moved_by(sum, total)
    }

    fn update(&self, x: i64, y: i64) -> Vec3 {
        let (mut sum, mut total) = (Vec3::ZERO, 0.0);
        for (u, v, w) in self.neighbours(x, y) {
            sum += w * (self.image[(v * self.size[0] + u) as usize].colour - self.predicted(u, v).colour);
            total += w;
        }
        if total > 0.0 { 0.5 * sum / total } else { Vec3::ZERO }
    }
}
