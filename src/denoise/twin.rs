//! The CPU twin of the kernels of `glsl/film` that take a noisy image apart and put it together, for tests and tools.
use super::file::Layers;
use super::filter::FilterInput;
use super::filter::pixel::{largest, reflects, sampled_albedo};
use super::{Demodulation, Holds};
use crate::image::aov::Aovs;
use crate::layout::{Guide, PixelLight, PixelStats, vec3, vec4};
use crate::math::srgb::luminance;
use crate::shaders::demodulate::{AROUND, MIRRORED, OUTLIER};
use crate::shaders::shared::albedo::{SMALLEST_ALBEDO, WHOLE};
use crate::shaders::shared::gloss_cell::{ONE_PLANE, ONE_SURFACE_COSINE};
use crate::shaders::shared::sample_marks::{ALL_PASSED_OVER, SOME_BARE};
use glam::Vec3;

/// A noisy image on the host: see [`super::Noisy`].
#[derive(Clone, Debug)]
pub struct Pixels {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// What the others hold.
    pub holds: Holds,
    /// One per pixel.
    pub stats: Vec<PixelStats>,
    /// One per pixel.
    pub light: Vec<PixelLight>,
    /// One per pixel.
    pub guide: Vec<Guide>,
    /// How far the lens blurs what each pixel shows; empty where it is not asked for.
    pub blur: Vec<f32>,
    /// Whether light that does not follow albedo is not divided by it, as for filters that weigh noise.
    pub gloss: bool,
}

/// An image taken apart.
pub struct Parts {
    /// What goes through the filter.
    pub input: FilterInput,
    /// What does not, and what the filtered light is multiplied by.
    pub sharp: Vec<vec3>,
    /// See `sharp`.
    pub factor: Vec<vec3>,
    /// Variance of what does not go through the filter, mean over channels; 0 where none is known.
    pub sharp_variance: Vec<f32>,
    /// Direct light before albedo, for a filter to in-paint, where some pixels (0 samples) have none of their own. Some hand none on
    /// (fewer than 0).
    pub direct: Option<FilterInput>,
    /// Whether it is that of [`Demodulation::Light`], whose whole is not negative.
    pub light: bool,
}

impl Pixels {
    /// Those of a file; see [`Pixels::gloss`] for `weighs_noise`.
    pub fn of_file(aovs: &Aovs, weighs_noise: bool) -> Self {
        let (layers, pixels) = (Layers::new(aovs), 0..aovs.film.pixels());
        Self {
            size: aovs.film.size(),
            holds: layers.holds(),
            stats: pixels.clone().map(|i| layers.stats(i)).collect(),
            light: pixels.clone().map(|i| layers.light(i)).collect(),
            guide: pixels.clone().map(|i| layers.guide(i)).collect(),
            blur: if layers.holds().blur { pixels.map(|i| layers.blur(i)).collect() } else { Vec::new() },
            gloss: weighs_noise,
        }
    }

    /// What the samples say of it or, without samples, the ray through the pixel's centre.
    fn albedo(&self, i: usize) -> &vec3 {
        let sampled = self.holds.light && self.count(i) > 0.0;
        if sampled { &self.light[i].albedo } else { &self.guide[i].albedo }
    }

    /// Surfaces as filters of this light see them, with the albedo that it was divided by.
    fn guide_of(&self, radiance: &[vec4]) -> Vec<Guide> {
        let albedo = |i: usize| match self.holds.light {
            true => sampled_albedo(&self.light[i], radiance[i][3], self.guide[i].albedo),
            false => self.guide[i].albedo,
        };
        (0..radiance.len()).map(|i| Guide { albedo: albedo(i), ..self.guide[i] }).collect()
    }

    fn sampled(&self, i: usize) -> bool {
        self.count(i) > 0.0 && self.stats[i].mean.iter().all(|v| v.is_finite())
    }

    /// Whether a pixel has any of these marks.
    fn marked(&self, i: usize, marks: u32) -> bool {
        self.light[i].remainder & marks != 0
    }

    /// Whether no sample tells of the key light.
    fn passed_over(&self, i: usize) -> bool {
        self.marked(i, ALL_PASSED_OVER)
    }

    fn count(&self, i: usize) -> f32 {
        if self.holds.of_file { f32::from_bits(self.stats[i].count) } else { self.stats[i].count as f32 }
    }
}

/// Takes a file's image apart, and in-paints direct light where it is missing: what [`super::Filtered`] does before it filters. See
/// [`Pixels::gloss`] for `weighs_noise`.
pub fn split(aovs: &Aovs, demodulation: Demodulation, weighs_noise: bool) -> Parts {
    let pixels = Pixels::of_file(aovs, weighs_noise);
    let lit = |i: usize| pixels.count(i) != 0.0 && pixels.light[i].direct.iter().all(|v| v.is_finite());
    let apart = pixels.holds.demodulation(demodulation) == Demodulation::Light;
    let in_paint = apart && !(0..pixels.stats.len()).all(lit);
    demodulate(&pixels, demodulation, in_paint)
}

/// Twin of `demodulate.comp` and, with `in_paint`, `demodulate_direct.comp`.
pub fn demodulate(pixels: &Pixels, demodulation: Demodulation, in_paint: bool) -> Parts {
    let blur = |i: usize| pixels.blur.get(i).filter(|_| !in_paint).copied();
    let all = 0..pixels.stats.len();
    let demodulation = pixels.holds.demodulation(demodulation);
    let with_gloss = pixels.gloss && demodulation == Demodulation::Light;
    let cells = if with_gloss { gloss::cells(pixels) } else { Vec::new() };
    let apart = |i| part(pixels, demodulation, &cells, i);
    let parts: Vec<Part> = all.clone().map(|i| blurred(pixels, i, blur(i), apart(i))).collect();
    let factor: Vec<vec3> = parts.iter().map(|p| p.factor).collect();
    let radiance = |i: usize| {
        let [r, g, b] = with_unreflected(parts[i].filtered, &factor[i]);
        let known = pixels.stats[i].mean.iter().all(|v| v.is_finite()) && factor[i].iter().any(|&f| f > 0.0);
        let lit = demodulation != Demodulation::Light || pixels.light[i].direct.iter().all(|v| v.is_finite());
        [r, g, b, if known && lit { pixels.count(i) } else { 0.0 }]
    };
    let measured = pixels.holds.variance_of_filtered(demodulation);
    let variance: Option<Vec<vec3>> =
        measured.then(|| all.clone().map(|i| variance(pixels, demodulation, i, blur(i), &parts[i])).collect());
    let of_filtered =
        |i: usize| variance.as_ref().map(|v| Vec3::from(factor[i]) * Vec3::from(factor[i]) * Vec3::from(v[i]));
    let rest = |i: usize| of_filtered(i).map_or(0.0, |filtered| variance_of_sharp(pixels, i, filtered));
    let sharp_variance = all.clone().map(rest).collect();
    let variance = variance.map(|v| v.into_iter().zip(&factor).map(|(v, f)| with_unreflected(v, f)).collect());
    let [width, height] = pixels.size;
    let radiance: Vec<vec4> = all.map(radiance).collect();
    let input = FilterInput { width, height, guide: pixels.guide_of(&radiance), radiance, variance };
    let direct = in_paint.then(|| {
        let radiance = demodulate_direct(pixels);
        FilterInput { guide: pixels.guide_of(&radiance), ..input.with_radiance(radiance) }
    });
    let light = demodulation == Demodulation::Light;
    Parts { input, sharp: parts.iter().map(|p| p.sharp).collect(), factor, sharp_variance, direct, light }
}

/// Twin of `demodulate_direct.comp`.
fn demodulate_direct(pixels: &Pixels) -> Vec<vec4> {
    let pixel = |i: usize| {
        let (direct, factor) = (pixels.light[i].direct, factor_of_direct(pixels.albedo(i)));
        let [r, g, b] = std::array::from_fn(|c| direct[c] / factor[c]);
        match pixels.count(i) != 0.0 && direct.iter().all(|v| v.is_finite()) {
            false => [0.0; 4],
            true if pixels.passed_over(i) || shows_in_part(pixels, i) => [0.0, 0.0, 0.0, -pixels.count(i)],
            true => [r, g, b, pixels.count(i)],
        }
    };
    (0..pixels.light.len()).map(pixel).collect()
}

impl Parts {
    /// Gives pixels without direct light what a filter made of [`Parts::direct`]. Twin of `remodulate_direct.comp`.
    ///
    /// # Panics
    /// When that has another number of pixels.
    pub fn remodulate_direct(&mut self, filtered: &[vec4]) {
        assert_eq!(filtered.len(), self.sharp.len(), "one filtered value per pixel");
        let Some(direct) = &self.direct else { return };
        for i in (0..filtered.len()).filter(|&i| direct.radiance[i][3] == 0.0) {
            let factor = factor_of_direct(&direct.guide[i].albedo);
            self.sharp[i] = std::array::from_fn(|c| factor[c] * filtered[i][c]);
        }
    }

    /// Puts the image together from what the filter returned. Twin of `remodulate.comp`.
    ///
    /// # Panics
    /// When that has another number of pixels.
    pub fn remodulate(&self, filtered: &[vec4]) -> Vec<vec3> {
        assert_eq!(filtered.len(), self.sharp.len(), "one filtered value per pixel");
        let pixel = |i: usize| {
            std::array::from_fn(|c| {
                let whole = self.sharp[i][c] + self.factor[i][c] * filtered[i][c];
                if self.light { whole.max(self.sharp[i][c].min(0.0)) } else { whole }
            })
        };
        (0..filtered.len()).map(pixel).collect()
    }
}

struct Part {
    filtered: vec3,
    factor: vec3,
    sharp: vec3,
}

fn part(pixels: &Pixels, demodulation: Demodulation, cells: &[vec4], i: usize) -> Part {
    let (colour, albedo) = (pixels.stats[i].mean, pixels.albedo(i));
    match demodulation {
        Demodulation::Light => split_light(pixels, cells, i),
        Demodulation::Albedo if is_mirror(pixels, i) => Part { filtered: colour, factor: [1.0; 3], sharp: [0.0; 3] },
        Demodulation::Albedo if !reflects(albedo) => {
            let sharp = if pixels.sampled(i) { colour } else { light_around(pixels, i) };
            Part { filtered: [0.0; 3], factor: [0.0; 3], sharp }
        }
        Demodulation::Albedo if pixels.sampled(i) && is_rim(pixels, i) => {
            Part { filtered: [0.0; 3], factor: [0.0; 3], sharp: colour }
        }
        Demodulation::Albedo => {
            let divisor = divisor(albedo);
            let factor = std::array::from_fn(|c| if albedo[c] == 0.0 && colour[c] == 0.0 { 0.0 } else { divisor[c] });
            Part { filtered: std::array::from_fn(|c| number(colour[c] / factor[c])), factor, sharp: [0.0; 3] }
        }
        Demodulation::Off => Part { filtered: colour, factor: [1.0; 3], sharp: [0.0; 3] },
    }
}

fn split_light(pixels: &Pixels, cells: &[vec4], i: usize) -> Part {
    let (direct, colour) = (direct_at(pixels, i), pixels.stats[i].mean);
    let factor = gloss::followed_albedo(pixels, cells, i, pixels.albedo(i).map(|a| number(a).max(0.0)));
    let filtered = |c: usize| number((colour[c] - direct[c]) / factor[c]);
    Part { filtered: std::array::from_fn(filtered), factor, sharp: direct.map(number) }
}

/// Whether pixel `q` tells how the key light shines on the surface that `i` shows.
fn tells_key_light(pixels: &Pixels, q: usize, i: usize) -> bool {
    let lit = !pixels.marked(q, ALL_PASSED_OVER | SOME_BARE);
    pixels.sampled(q) && lit && reflects(pixels.albedo(q)) && one_surface(pixels, q, i)
}

/// Whether pixel `q` shows the surface that `i` shows.
fn one_surface(pixels: &Pixels, q: usize, i: usize) -> bool {
    let (own, theirs) = (&pixels.guide[i], &pixels.guide[q]);
    let normal = Vec3::from(own.normal);
    let off = normal.dot(Vec3::from(theirs.position) - Vec3::from(own.position));
    normal.dot(theirs.normal.into()) > ONE_SURFACE_COSINE && off.abs() < ONE_PLANE * own.depth
}

/// Direct light. Where all samples passed over the key light, the pixels around tell what it brings.
fn direct_at(pixels: &Pixels, i: usize) -> vec3 {
    let own = pixels.light[i].direct;
    if !pixels.passed_over(i) {
        return own;
    }
    let width = pixels.size[0] as usize;
    let (mut sum, mut weights) = (Vec3::ZERO, 0.0);
    for q in neighbours(pixels.size, i, AROUND as usize).filter(|&q| tells_key_light(pixels, q, i)) {
        let off = [(q % width).abs_diff(i % width), (q / width).abs_diff(i / width)];
        let weight = (-0.5 * (off[0] * off[0] + off[1] * off[1]) as f32).exp();
        let (direct, divisor) = (pixels.light[q].direct, divisor(pixels.albedo(q)));
        sum += weight * Vec3::from_array(std::array::from_fn(|c| number(direct[c] / divisor[c])));
        weights += weight;
    }
    let albedo = pixels.albedo(i).map(|a| number(a).max(0.0));
    (Vec3::from(own) + Vec3::from(albedo) * sum / weights.max(1e-20)).into()
}

/// For a pixel of lamps or sky without a sample: the mean of the pixels around that show some.
fn light_around(pixels: &Pixels, i: usize) -> vec3 {
    let shows = |&q: &usize| pixels.sampled(q) && !reflects(pixels.albedo(q));
    let around: Vec<_> =
        neighbours(pixels.size, i, 3).filter(shows).map(|q| Vec3::from(pixels.stats[q].mean)).collect();
    (around.iter().sum::<Vec3>() / around.len().max(1) as f32).to_array().map(number)
}

/// Channels that a surface does not reflect (`factor` 0) take the mean of the others.
fn with_unreflected(light: vec3, factor: &vec3) -> vec3 {
    let known = || (0..3).filter(|&c| factor[c] > 0.0);
    let mean = known().map(|c| light[c]).sum::<f32>() / known().count().max(1) as f32;
    std::array::from_fn(|c| if factor[c] > 0.0 { light[c] } else { mean })
}

/// What the lens blurs is filtered as it is.
fn blurred(pixels: &Pixels, i: usize, blur: Option<f32>, p: Part) -> Part {
    let Some(share) = blur else { return p };
    let factor = p.factor.map(|v| v * (1.0 - share) + share);
    let sharp = p.sharp.map(|v| v * (1.0 - share));
    let filtered = std::array::from_fn(|c| number((pixels.stats[i].mean[c] - sharp[c]) / factor[c]));
    Part { filtered, factor, sharp }
}

/// Of the mean of what is filtered.
fn variance(pixels: &Pixels, demodulation: Demodulation, i: usize, blur: Option<f32>, part: &Part) -> vec3 {
    let Part { filtered, factor, .. } = part;
    if demodulation == Demodulation::Light && pixels.holds.indirect_variance {
        let other = Vec3::from(pixels.stats[i].mean)
            - Vec3::from(if blur.is_some() { direct_at(pixels, i) } else { part.sharp });
        let of_mean = variance_of_mean(pixels.light[i].indirect_m2, pixels.count(i));
        let relative = number(of_mean.sqrt() / luminance(other.abs()));
        let Some(share) = blur else { return filtered.map(|light| (light * relative).powi(2)) };
        let whole = variance_of_colour(pixels, i);
        let deviation = |c: usize| number((other[c] * relative * (1.0 - share) + whole[c].sqrt() * share) / factor[c]);
        return std::array::from_fn(|c| deviation(c).powi(2));
    }
    let all = variance_of_colour(pixels, i);
    std::array::from_fn(|c| if factor[c] > 0.0 { all[c] / (factor[c] * factor[c]) } else { 0.0 })
}

fn variance_of_mean(m2: f32, n: f32) -> f32 {
    if n > 1.0 { m2 / (n * (n - 1.0)) } else { 0.0 }
}

fn variance_of_colour(pixels: &Pixels, i: usize) -> vec3 {
    let m2 = pixels.stats[i].m2;
    if pixels.holds.of_file { m2 } else { m2.map(|m2| variance_of_mean(m2, pixels.count(i))) }
}

/// What of the colour's variance is not that of what is filtered, mean over channels.
fn variance_of_sharp(pixels: &Pixels, i: usize, filtered: Vec3) -> f32 {
    let rest = Vec3::from(variance_of_colour(pixels, i)) - filtered;
    rest.to_array().map(|v| number(v).max(0.0)).iter().sum::<f32>() / 3.0
}

fn factor_of_direct(albedo: &vec3) -> vec3 {
    if reflects(albedo) { divisor(albedo) } else { [1.0; 3] }
}

/// What a pixel's light is divided by.
fn divisor(albedo: &vec3) -> vec3 {
    albedo.map(|v| number(v).max(SMALLEST_ALBEDO))
}

/// 0 for what is no number: nothing would mend it later.
fn number(v: f32) -> f32 {
    if v.is_finite() { v } else { 0.0 }
}

/// Beside something brighter that reflects nothing, and partly of it.
fn is_rim(pixels: &Pixels, i: usize) -> bool {
    let neighbours = || neighbours(pixels.size, i, 1);
    let light = |q: usize| largest(&pixels.stats[q].mean);
    let albedo = |q: usize| pixels.albedo(q);
    if !neighbours().any(|q| !reflects(albedo(q)) && light(q) > light(i)) {
        return false;
    }
    let mut others: Vec<f32> = neighbours().filter(|&q| reflects(albedo(q))).map(light).collect();
    others.sort_by(f32::total_cmp);
    let median = others.get(others.len() / 2).copied().unwrap_or(0.0);
    light(i) > OUTLIER * median || neighbours().any(|q| largest(albedo(i)) < WHOLE * largest(albedo(q)))
}

/// A surface in part, and beside it something without albedo.
fn shows_in_part(pixels: &Pixels, i: usize) -> bool {
    let (own, around) = (pixels.albedo(i), || neighbours(pixels.size, i, 1).map(|q| pixels.albedo(q)));
    let partly = around().any(|theirs| largest(own) < WHOLE * largest(theirs));
    reflects(own) && partly && around().any(|theirs| !reflects(theirs))
}

/// Noisy or black without albedo, as most pixels around it are.
fn is_mirror(pixels: &Pixels, i: usize) -> bool {
    let around = || neighbours(pixels.size, i, 1).chain([i]);
    let smooth = |q: usize| !reflects(pixels.albedo(q)) && pixels.guide[q].depth > 0.0;
    let noisy = |q: usize| smooth(q) && largest(&pixels.stats[q].m2) > 0.0;
    let alike = |q: usize| noisy(q) || smooth(q) && largest(&pixels.stats[q].mean) == 0.0;
    let count = around().filter(|&q| alike(q)).count() as f32;
    alike(i) && around().any(noisy) && count > MIRRORED * around().count() as f32
}

/// Those up to `reach` pixels away, but the pixel itself.
fn neighbours([width, height]: [u32; 2], i: usize, reach: usize) -> impl Iterator<Item = usize> {
    let (width, height) = (width as usize, height as usize);
    let (x, y) = (i % width, i / width);
    let rows = y.saturating_sub(reach)..=(y + reach).min(height - 1);
    let columns = x.saturating_sub(reach)..=(x + reach).min(width - 1);
    rows.flat_map(move |y| columns.clone().map(move |x| y * width + x)).filter(move |&q| q != i)
}

mod gloss;
#[cfg(test)]
mod tests;
