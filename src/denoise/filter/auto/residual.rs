//! What `auto` gives back of what its blend has lost: the twin of `glsl/auto/auto_residual.comp`.
use crate::denoise::filter::FilterInput;
use crate::denoise::filter::edge::{Rates, edge_weight};
use crate::denoise::filter::noise_estimate::{blurred, contrast, own_variance, window};
use crate::denoise::filter::pack::Packed;
use crate::denoise::filter::pixel::reflects;
use crate::layout::{NONE, vec4};
use crate::shaders::auto::{ENOUGH_TO_DOUBT, NEAR};
use crate::shaders::auto_residual::{self, ENOUGH_PIXELS, ENOUGH_SAMPLES, NARROW, PRIOR_SAMPLES, SIGNIFICANT};
use glam::{Vec3, Vec4, Vec4Swizzles};

/// The blend with what it has lost, where samples show that: twin of `auto_residual.comp`. `prior` is the variance of what is lost.
pub fn given_back(
    input: &FilterInput,
    image: &[Packed],
    noise: &[f32],
    blend: &[Vec4],
    surfaces: &Rates,
    prior: impl Fn(usize) -> f32,
) -> Vec<vec4> {
    let size = input.size().map(i64::from);
    let own: Vec<Option<f32>> = (0..image.len()).map(|i| own_variance(input, i, image[i].count)).collect();
    let doubted = |i: usize| image[i].count >= ENOUGH_TO_DOUBT && tell_like_pixels(input, i);
    let residual = |i: usize| Residual {
        blended: blend[i].xyz(),
        colour: image[i].colour - blend[i].xyz(),
        filtered: blend[i].w > 0.0,
        variance: own[i].map_or(noise[i].max(0.0), |own| if doubted(i) { own.max(noise[i]) } else { own }),
        noise: noise[i].max(own[i].unwrap_or(0.0)).max(0.0),
        blurred: blurred(&input.guide[i]),
        measured: own[i].is_some(),
    };
    let residuals: Vec<_> = (0..image.len()).map(residual).collect();
    let restored =
        |i: usize| -> vec4 { restored(image, &residuals, size, i, surfaces, prior(i)).extend(blend[i].w).into() };
    (0..image.len()).map(restored).collect()
}

/// Whether what like pixels tell of noise counts, as in `auto.comp`.
fn tell_like_pixels(input: &FilterInput, at: usize) -> bool {
    let shaded = |q: usize| input.guide[q].object != NONE && reflects(&input.guide[q].albedo);
    !blurred(&input.guide[at]) || window(input, at, NEAR as i64).all(shaded)
}

/// Sums over the like pixels of a window.
#[derive(Clone, Copy, Default)]
struct Window {
    residual: Vec3,
    weights: f32,
    squares: f32,
    samples: f32,
    variance: f32,
}

impl Window {
    fn add(&mut self, residual: Vec3, w: f32, count: f32, variance: f32) {
        self.residual += w * residual;
        self.weights += w;
        self.squares += w * w;
        self.samples += w * count;
        self.variance += w * count * variance;
    }

    /// What of the mean residual, `given` of which is given back already, is more than noise. `prior` is the variance of one sample
    /// by the surroundings.
    fn significant(&self, given: Vec3, prior: f32) -> Vec3 {
        if self.samples < ENOUGH_SAMPLES {
            return Vec3::ZERO;
        }
        let residual = self.residual / self.weights - given;
        let prior = PRIOR_SAMPLES * prior * self.weights / self.samples;
        let variance = (self.variance + prior) / (self.samples + PRIOR_SAMPLES);
        let noise = SIGNIFICANT * (variance * self.squares).sqrt() / self.weights;
        let off = contrast(residual, Vec3::ZERO).abs();
        if off > noise { residual * (1.0 - noise / off) } else { Vec3::ZERO }
    }

    /// The window of one pixel. If that is darker than its blend, it counts as no less noisy than like pixels around: see `doubted` of the
    /// kernel.
    fn doubted(self, given: Vec3, wide: &Self) -> Self {
        let darker = contrast(self.residual / self.weights.max(1e-20), given) < 0.0;
        let around = self.samples * wide.variance / wide.samples.max(1e-20);
        Self { variance: if darker { self.variance.max(around) } else { self.variance }, ..self }
    }
}

/// What the blend of a pixel differs by from its samples.
struct Residual {
    blended: Vec3,
    colour: Vec3,
    filtered: bool,
    /// Of the pixel's luminance, as windows count it.
    variance: f32,
    /// The larger of what its own samples and like pixels tell of the same.
    noise: f32,
    blurred: bool,
    /// By its own samples.
    measured: bool,
}

/// The range of light that a pixel's blend and those of the other surfaces beside it have.
struct Edge {
    own: Vec3,
    low: Vec3,
    high: Vec3,
}

impl Edge {
    /// A neighbour counts as much as it is another surface.
    fn add(&mut self, blended: Vec3, alike: f32) {
        let other = blended.lerp(self.own, alike);
        self.low = self.low.min(other);
        self.high = self.high.max(other);
    }

    /// As `at_edge` of the kernel.
    fn light(&self, light: Vec3, pixel: Vec3, noise: f32) -> Vec3 {
        let varies = contrast(self.high, self.low).powi(2);
        let between = pixel.clamp(self.low.min(light), self.high.max(light));
        if varies > 0.0 { light + varies / (varies + NARROW * noise) * (between - light) } else { light }
    }
}

/// The light of a pixel with what it is given back of what the blend has lost.
fn restored(
    image: &[Packed],
    residuals: &[Residual],
    [width, height]: [i64; 2],
    at: usize,
    rates: &Rates,
    prior: f32,
) -> Vec3 {
    const REACH: i64 = auto_residual::REACH as i64;
    let (p, own) = (&image[at], &residuals[at]);
    let (mut windows, mut least, mut known) = ([Window::default(); 3], Vec3::INFINITY, 0);
    let (mut edge, x, y) =
        (Edge { own: own.blended, low: own.blended, high: own.blended }, at as i64 % width, at as i64 / width);
    for (u, v) in (-REACH..=REACH).flat_map(|v| (-REACH..=REACH).map(move |u| (u, v))) {
        if !(0..width).contains(&(x + u)) || !(0..height).contains(&(y + v)) {
            continue;
        }
        let j = ((y + v) * width + x + u) as usize;
        let (q, there) = (&image[j], &residuals[j]);
        if q.count > 0.0 {
            least = least.min(q.colour);
            known += 1;
        }
        let w = if there.filtered { edge_weight(q, rates.exponent(p, q)) } else { 0.0 };
        let reach = u.abs().max(v.abs());
        if reach <= 1 && there.filtered && q.count > 0.0 {
            edge.add(there.blended, w);
        }
        let holding = windows.iter_mut().zip([REACH, 1, 0]).filter(|(_, most)| reach <= *most);
        holding.for_each(|(window, _)| window.add(there.colour, w, q.count, there.variance));
    }
    least = if known < ENOUGH_PIXELS { least.min(Vec3::ZERO) } else { least };
    if p.count == 0.0 || !own.filtered {
        return own.blended.max(least);
    }
    let [wide, near, alone] = windows;
    let mut given = wide.significant(Vec3::ZERO, prior);
    if own.measured {
        given += near.significant(given, prior);
        given += alone.doubted(given, &wide).significant(given, prior);
    }
    let light = (own.blended + given).max(least);
    if own.blurred { light } else { edge.light(light, p.colour, own.noise) }
}
