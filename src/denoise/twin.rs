//! The CPU twin of the kernels of `glsl/film` that take a noisy image apart and put it together, for tests and tools.
use super::file::Layers;
use super::filter::FilterInput;
use super::{Demodulation, Holds};
use crate::image::aov::Aovs;
use crate::layout::{Guide, PixelLight, PixelStats, vec3, vec4};
use crate::shaders::demodulate::{OUTLIER, WHOLE};
use crate::shaders::shared::albedo::SMALLEST_ALBEDO;

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
}

/// An image taken apart.
pub struct Parts {
    /// What goes through the filter.
    pub input: FilterInput,
    /// What does not, and what the filtered light is multiplied by.
    pub sharp: Vec<vec3>,
    /// See `sharp`.
    pub factor: Vec<vec3>,
    /// Direct light before albedo, for a filter to in-paint, where some pixels (0 samples) have none of their own.
    pub direct: Option<FilterInput>,
}

impl Pixels {
    /// Those of a file.
    pub fn of_file(aovs: &Aovs) -> Self {
        let (layers, pixels) = (Layers::new(aovs), 0..aovs.film.pixels());
        Self {
            size: [aovs.film.width, aovs.film.height],
            holds: layers.holds(),
            stats: pixels.clone().map(|i| layers.stats(i)).collect(),
            light: pixels.clone().map(|i| layers.light(i)).collect(),
            guide: pixels.map(|i| layers.guide(i)).collect(),
        }
    }

    fn count(&self, i: usize) -> f32 {
        if self.holds.of_file { f32::from_bits(self.stats[i].count) } else { self.stats[i].count as f32 }
    }
}

/// Takes a file's image apart, and in-paints direct light where it is missing: what [`super::Filtered`] does before it filters.
pub fn split(aovs: &Aovs, demodulation: Demodulation) -> Parts {
    let pixels = Pixels::of_file(aovs);
    let lit = |i: usize| pixels.count(i) != 0.0 && pixels.light[i].direct.iter().all(|v| v.is_finite());
    let apart = pixels.holds.demodulation(demodulation) == Demodulation::Light;
    let in_paint = apart && !(0..pixels.stats.len()).all(lit);
    demodulate(&pixels, demodulation, in_paint)
}

/// Twin of `demodulate.comp` and, with `in_paint`, `demodulate_direct.comp`.
pub fn demodulate(pixels: &Pixels, demodulation: Demodulation, in_paint: bool) -> Parts {
    let all = 0..pixels.stats.len();
    let demodulation = pixels.holds.demodulation(demodulation);
    let parts: Vec<Part> = all.clone().map(|i| part(pixels, demodulation, i)).collect();
    let factor: Vec<vec3> = parts.iter().map(|p| p.factor).collect();
    let radiance = |i: usize| {
        let [r, g, b] = parts[i].filtered;
        let known = pixels.stats[i].mean.iter().all(|v| v.is_finite()) && factor[i].iter().any(|&f| f > 0.0);
        [r, g, b, if known { pixels.count(i) } else { 0.0 }]
    };
    let measured = pixels.holds.variance_of_filtered(demodulation);
    let variance = measured.then(|| all.clone().map(|i| variance(pixels, demodulation, i, &factor[i])).collect());
    let [width, height] = pixels.size;
    let radiance = all.map(radiance).collect();
    let input = FilterInput { width, height, radiance, guide: pixels.guide.clone(), variance };
    let direct = in_paint.then(|| input.with_radiance(demodulate_direct(pixels)));
    Parts { input, sharp: parts.iter().map(|p| p.sharp).collect(), factor, direct }
}

/// Twin of `demodulate_direct.comp`.
fn demodulate_direct(pixels: &Pixels) -> Vec<vec4> {
    let pixel = |i: usize| {
        let (direct, factor) = (pixels.light[i].direct, factor_of_direct(&pixels.guide[i].albedo));
        let [r, g, b] = std::array::from_fn(|c| direct[c] / factor[c]);
        let lit = pixels.count(i) != 0.0 && direct.iter().all(|v| v.is_finite());
        if lit { [r, g, b, pixels.count(i)] } else { [0.0; 4] }
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
        let pixel = |i: usize| std::array::from_fn(|c| self.sharp[i][c] + self.factor[i][c] * filtered[i][c]);
        (0..filtered.len()).map(pixel).collect()
    }
}

struct Part {
    filtered: vec3,
    factor: vec3,
    sharp: vec3,
}

fn part(pixels: &Pixels, demodulation: Demodulation, i: usize) -> Part {
    let (colour, albedo) = (pixels.stats[i].mean, pixels.guide[i].albedo);
    match demodulation {
        Demodulation::Light => split_light(&colour, &albedo, &pixels.light[i]),
        Demodulation::Albedo if !reflects(&albedo) || is_rim(pixels, i) => {
            Part { filtered: [0.0; 3], factor: [0.0; 3], sharp: colour.map(number) }
        }
        Demodulation::Albedo => {
            let factor = divisor(&albedo);
            Part { filtered: std::array::from_fn(|c| colour[c] / factor[c]), factor, sharp: [0.0; 3] }
        }
        Demodulation::Off => Part { filtered: colour, factor: [1.0; 3], sharp: [0.0; 3] },
    }
}

fn split_light(colour: &vec3, albedo: &vec3, light: &PixelLight) -> Part {
    let factor = |c: usize| {
        let of_samples = (colour[c] - light.direct[c]) / light.indirect[c];
        let known = of_samples.is_finite() && light.indirect[c] > 0.0;
        if known { of_samples.clamp(0.0, 1.0) } else { number(albedo[c]) }
    };
    Part { filtered: light.indirect, factor: std::array::from_fn(factor), sharp: light.direct.map(number) }
}

/// Of the mean of what is filtered.
fn variance(pixels: &Pixels, demodulation: Demodulation, i: usize, factor: &vec3) -> vec3 {
    let (n, PixelStats { m2, .. }) = (pixels.count(i), pixels.stats[i]);
    let of_mean = |m2: f32| if n > 1.0 { m2 / (n * (n - 1.0)) } else { 0.0 };
    if demodulation == Demodulation::Light && pixels.holds.indirect_variance {
        return [of_mean(pixels.light[i].indirect_m2); 3];
    }
    let all = if pixels.holds.of_file { m2 } else { m2.map(of_mean) };
    std::array::from_fn(|c| if factor[c] > 0.0 { all[c] / (factor[c] * factor[c]) } else { 0.0 })
}

fn factor_of_direct(albedo: &vec3) -> vec3 {
    if reflects(albedo) { divisor(albedo) } else { [1.0; 3] }
}

/// What a pixel's light is divided by.
fn divisor(albedo: &vec3) -> vec3 {
    albedo.map(|v| number(v).max(SMALLEST_ALBEDO))
}

fn reflects(albedo: &vec3) -> bool {
    largest(albedo) > SMALLEST_ALBEDO
}

/// 0 for what is no number: nothing would mend it later.
fn number(v: f32) -> f32 {
    if v.is_finite() { v } else { 0.0 }
}

/// 0 for what is no number.
fn largest(v: &vec3) -> f32 {
    v.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max)
}

/// Beside something brighter that reflects nothing, and partly of it.
fn is_rim(pixels: &Pixels, i: usize) -> bool {
    let neighbours = || neighbours(pixels.size, i);
    let light = |q: usize| largest(&pixels.stats[q].mean);
    let albedo = |q: usize| &pixels.guide[q].albedo;
    if !neighbours().any(|q| !reflects(albedo(q)) && light(q) > light(i)) {
        return false;
    }
    let mut others: Vec<f32> = neighbours().filter(|&q| reflects(albedo(q))).map(light).collect();
    others.sort_by(f32::total_cmp);
    let median = others.get(others.len() / 2).copied().unwrap_or(0.0);
    light(i) > OUTLIER * median || neighbours().any(|q| largest(albedo(i)) < WHOLE * largest(albedo(q)))
}

/// Up to eight.
fn neighbours([width, height]: [u32; 2], i: usize) -> impl Iterator<Item = usize> {
    let (width, height) = (width as usize, height as usize);
    let (x, y) = (i % width, i / width);
    let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
    let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
    rows.flat_map(move |y| columns.clone().map(move |x| y * width + x)).filter(move |&q| q != i)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::aov::Names;
    use crate::image::{Film, Samples};

    const RGB: [&str; 3] = ["R", "G", "B"];

    /// One row: a wall of albedo 0.5 lit by 2, the rim of a lamp, the lamp.
    fn film() -> Film {
        let mut film = Film::new(4, 1);
        film.add_vec3("", RGB, &[[1.0; 3], [1.0; 3], [25.0; 3], [50.0; 3]]);
        film.add_vec3("albedo", RGB, &[[0.5; 3], [0.5; 3], [0.25; 3], [0.0; 3]]);
        film
    }

    fn take_apart(film: &Film, demodulation: Demodulation) -> Parts {
        split(&Aovs::find(film, &Names::new()).unwrap(), demodulation)
    }

    #[test]
    fn lamps_and_their_rims_reach_no_other_pixel() {
        let parts = take_apart(&film(), Demodulation::Light);
        assert_eq!(parts.input.radiance, [[2.0, 2.0, 2.0, 1.0], [2.0, 2.0, 2.0, 1.0], [0.0; 4], [0.0; 4]]);
        let joined = parts.remodulate(&[[3.0, 3.0, 3.0, 1.0]; 4]);
        assert_eq!(joined, [[1.5; 3], [1.5; 3], [25.0; 3], [50.0; 3]]);
        // The albedo of pixel centres does not show that the third pixel is a rim; its light does.
        let mut centre = film();
        centre.channels.truncate(3);
        centre.add_vec3("albedo", RGB, &[[0.5; 3], [0.5; 3], [0.5; 3], [0.0; 3]]);
        assert_eq!(take_apart(&centre, Demodulation::Light).input.radiance[2], [0.0; 4]);
        // Control: in plain order all of it is filtered.
        assert!(take_apart(&film(), Demodulation::Off).input.radiance.iter().all(|c| c[3] == 1.0));
    }

    #[test]
    fn direct_light_is_left_out_also_where_pixels_lack_it() {
        let mut film = film();
        film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
        film.add_vec3("direct", RGB, &[[0.5; 3], [0.5; 3], [25.0; 3], [50.0; 3]]);
        film.add_vec3("indirect", RGB, &[[1.0; 3], [1.0; 3], [0.0; 3], [0.0; 3]]);
        let counts = |counts: [u32; 4]| {
            let mut film = film.clone();
            film.add("samples", Samples::U32(counts.to_vec()));
            let parts = take_apart(&film, Demodulation::Light);
            (parts.input.radiance, parts.direct.map(|direct| direct.radiance))
        };
        let (all, unlit) = counts([4; 4]);
        assert_eq!((all[0], unlit), ([1.0, 1.0, 1.0, 4.0], None));
        let (sparse, unlit) = counts([4, 0, 4, 4]);
        assert_eq!(sparse[..2], [[1.0, 1.0, 1.0, 4.0], [1.0, 1.0, 1.0, 0.0]]);
        // Before albedo; the lamp's own light.
        let lit = [[1.0, 1.0, 1.0, 4.0], [0.0; 4], [100.0, 100.0, 100.0, 4.0], [50.0, 50.0, 50.0, 4.0]];
        assert_eq!(unlit.unwrap(), lit);
        // A broken pixel counts as one without samples.
        let red = film.channels.iter_mut().filter(|c| ["R", "direct.R"].contains(&c.name.as_str()));
        red.for_each(|c| c.samples = Samples::F32(vec![1.0, f32::NAN, 25.0, 50.0]));
        let parts = take_apart(&film, Demodulation::Light);
        assert_eq!(parts.input.radiance.iter().map(|c| c[3]).collect::<Vec<_>>(), [1.0, 0.0, 1.0, 0.0]);
        assert_eq!(parts.remodulate(&[[1.0; 4]; 4])[1], [0.5, 1.0, 1.0]);
        assert_eq!(parts.direct.unwrap().radiance[1], [0.0; 4]);
    }

    /// However the image is taken apart, and whatever its other layers hold.
    #[test]
    fn a_pixel_that_is_no_number_counts_as_not_sampled() {
        for demodulation in [Demodulation::Light, Demodulation::Albedo, Demodulation::Off] {
            let whole = {
                let mut film = film();
                film.add_vec3("direct", RGB, &[[0.5; 3], [0.5; 3], [25.0; 3], [50.0; 3]]);
                film.add_vec3("indirect", RGB, &[[1.0; 3], [1.0; 3], [0.0; 3], [0.0; 3]]);
                film.add("samples", Samples::U32(vec![4; 4]));
                film
            };
            let clean = take_apart(&whole, demodulation).input.radiance;
            assert!(clean[1][3] == 4.0, "control: as it is, the pixel is sampled");
            for (bad, name) in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY].into_iter().zip(RGB) {
                let mut film = whole.clone();
                let channel = film.channels.iter_mut().find(|c| c.name == name).unwrap();
                channel.samples = Samples::F32(vec![1.0, bad, 25.0, 50.0]);
                let broken = take_apart(&film, demodulation).input.radiance;
                assert_eq!(broken[1][3], 0.0, "{demodulation:?}, {bad} in {name}");
                assert_eq!([broken[0], broken[2], broken[3]], [clean[0], clean[2], clean[3]], "{demodulation:?}");
            }
        }
    }

    #[test]
    fn indirect_light_has_the_variance_of_its_own_samples() {
        let mut film = film();
        film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
        film.add_vec3("direct", RGB, &[[0.5; 3]; 4]);
        film.add_vec3("indirect", RGB, &[[1.0; 3]; 4]);
        film.add_vec3("variance", RGB, &[[8.0; 3]; 4]);
        film.add("samples", Samples::U32(vec![4, 1, 3, 0]));
        let of = |film: &Film, demodulation| take_apart(film, demodulation).input.variance.unwrap();
        assert_eq!(
            of(&film, Demodulation::Light)[0],
            [32.0; 3],
            "of earlier versions: of all light over the squared albedo"
        );
        film.add("indirect.m2", Samples::F32(vec![12.0; 4]));
        assert_eq!(of(&film, Demodulation::Light), [[1.0; 3], [0.0; 3], [2.0; 3], [0.0; 3]]);
        assert_eq!(of(&film, Demodulation::Off)[0], [8.0; 3]);
    }

    #[test]
    fn the_variance_of_a_pbrt_file_is_that_of_one_sample() {
        let mut film = film();
        film.add_vec3("Variance", RGB, &[[8.0; 3]; 4]);
        let first = |film: &Film| take_apart(film, Demodulation::Light).input.variance.unwrap()[0][0];
        assert_eq!(first(&film), 32.0, "of the mean, over the squared albedo");
        film.add_vec3("RelativeVariance", RGB, &[[8.0; 3]; 4]);
        film.metadata.insert("samplesPerPixel".to_owned(), "16".to_owned());
        assert_eq!(first(&film), 2.0);
    }

    #[test]
    fn positions_and_depths_are_made_of_each_other_and_it_is_said() {
        let guides = |change: &dyn Fn(&mut Film)| {
            let mut film = film();
            film.add_vec3("N", ["X", "Y", "Z"], &[[0.0, 0.0, 0.5]; 4]);
            change(&mut film);
            let parts = take_apart(&film, Demodulation::Light);
            let aovs = Aovs::find(&film, &Names::new()).unwrap();
            (parts.input.guide, Layers::new(&aovs).notes.join("\n"))
        };
        let (guide, notes) = guides(&|film| film.add("Z", Samples::F32(vec![1.0, 2.0, 1e10, f32::INFINITY])));
        assert_eq!([guide[0].depth, guide[2].depth, guide[3].depth], [1.0, 0.0, 0.0], "1e10 is Blender's sky");
        assert!(guide[0].position[0] < 0.0 && guide[1].position[2] < guide[0].position[2], "{guide:?}");
        assert_eq!(guide[0].normal, [0.0, 0.0, 1.0], "means of normals are made unit");
        assert!(notes.contains("position: made of the depth"), "{notes}");
        let hits = [[0.0, 1.0, 5.0], [0.0, 1.0, 4.0], [0.0, 1.0, 3.0], [0.0; 3]];
        let (guide, notes) = guides(&|film| film.add_vec3("P", ["X", "Y", "Z"], &hits));
        let depths: Vec<f32> = guide.iter().map(|g| g.depth).collect();
        assert!(depths[0] > 0.0 && depths[1] == depths[0] + 1.0 && depths[2] == depths[0] + 2.0, "{depths:?}");
        assert_eq!(depths[3], 0.0, "no hit");
        assert!(notes.contains("depth: made of the position"), "{notes}");
    }
}
