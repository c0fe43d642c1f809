//! What of an image is filtered, and how it becomes an image again: `colour = sharp + factor * filtered`.
//!
//! | image | filtered | factor | sharp |
//! |---|---|---|---|
//! | Tallow's | indirect light before albedo | that albedo | direct light, emission, what smooth surfaces show |
//! | with albedo | colour / albedo | albedo | what reflects nothing: lamps, sky |
//! | any, plain | colour | 1 | nothing |
mod albedo;
mod guide;

use crate::denoise::filter::FilterInput;
use crate::image::Samples;
use crate::image::aov::{Aov, Aovs};
use crate::layout::{vec3, vec4};

/// What is kept away from the filter, where an image tells it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Demodulation {
    /// Surface colour and direct light.
    #[default]
    Light,
    /// Surface colour.
    Albedo,
    /// Nothing.
    Off,
}

/// An image taken apart.
pub struct Parts {
    /// What goes through the filter.
    pub input: FilterInput,
    sharp: Vec<vec3>,
    factor: Vec<vec3>,
    unlit: Option<Unlit>,
    /// How it was taken apart, and what was made up: one line each.
    pub notes: Vec<String>,
}

/// Direct light, `factor * radiance`, of which some pixels (0 samples) have none of their own.
struct Unlit {
    radiance: Vec<vec4>,
    factor: Vec<vec3>,
}

/// Takes an image apart.
pub fn split(aovs: &Aovs, demodulation: Demodulation) -> Parts {
    let colour = aovs.get(Aov::Colour).unwrap_or_default();
    let counts = counts(aovs, colour);
    let mut notes = Vec::new();
    let light = match (demodulation, aovs.get(Aov::Albedo), aovs.get(Aov::Direct).zip(aovs.get(Aov::Indirect))) {
        (Demodulation::Off, ..) | (_, None, _) => plain(colour),
        (Demodulation::Light, Some(albedo), Some((direct, indirect))) => {
            split_light(aovs, colour, albedo, direct, indirect)
        }
        (_, Some(albedo), _) => albedo::split(colour, albedo, aovs.film.width as usize),
    };
    notes.push(light.note.to_owned());
    let radiance = light.filtered.iter().zip(&counts).zip(&light.factor).map(with_count).collect();
    let variance = light.variance.or_else(|| {
        let of_colour = variance(aovs, &counts)?;
        Some(of_colour.iter().zip(&light.factor).map(demodulated_variance).collect())
    });
    let guide = guide::guides(aovs, &mut notes);
    let input = FilterInput { width: aovs.film.width, height: aovs.film.height, radiance, guide, variance };
    if light.unlit.is_some() {
        notes.push("direct light of pixels without a sample is made of that of the others".to_owned());
    }
    Parts { input, sharp: light.sharp, factor: light.factor, unlit: light.unlit, notes }
}

impl Parts {
    /// Direct light before albedo, where some pixels (0 samples) have none of their own: a filter in-paints it for
    /// [`Parts::light_up`].
    pub fn unlit(&self) -> Option<FilterInput> {
        self.unlit.as_ref().map(|unlit| self.input.with_radiance(unlit.radiance.clone()))
    }

    /// Gives pixels without direct light what a filter made of [`Parts::unlit`].
    ///
    /// # Panics
    /// When that has another number of pixels.
    pub fn light_up(&mut self, direct: &[vec4]) {
        assert_eq!(direct.len(), self.sharp.len(), "one filtered value per pixel");
        let Some(Unlit { radiance, factor }) = &self.unlit else { return };
        for i in (0..direct.len()).filter(|&i| radiance[i][3] == 0.0) {
            self.sharp[i] = std::array::from_fn(|c| factor[i][c] * direct[i][c]);
        }
    }

    /// Puts the image together from what the filter returned.
    ///
    /// # Panics
    /// When that has another number of pixels.
    pub fn join(&self, filtered: &[vec4]) -> Vec<vec3> {
        assert_eq!(filtered.len(), self.sharp.len(), "one filtered value per pixel");
        let pixel = |i: usize| std::array::from_fn(|c| self.sharp[i][c] + self.factor[i][c] * filtered[i][c]);
        (0..filtered.len()).map(pixel).collect()
    }

    /// Puts the image together from light that has been multiplied by surface colour already, as a look-up returns it.
    ///
    /// # Panics
    /// When that has another number of pixels.
    pub fn join_reflected(&self, light: &[vec3]) -> Vec<vec3> {
        assert_eq!(light.len(), self.sharp.len(), "one value per pixel");
        let pixel = |(sharp, light): (&vec3, &vec3)| std::array::from_fn(|c| sharp[c] + light[c]);
        self.sharp.iter().zip(light).map(pixel).collect()
    }
}

struct Light {
    filtered: Vec<vec3>,
    factor: Vec<vec3>,
    sharp: Vec<vec3>,
    unlit: Option<Unlit>,
    /// Of what is filtered, where the image tells it.
    variance: Option<Vec<vec3>>,
    note: &'static str,
}

/// Samples behind each pixel: as the file says, per pixel or for all; 1 where it does not; 0 where there is nothing.
fn counts(aovs: &Aovs, colour: &[vec3]) -> Vec<f32> {
    let of_all = aovs.film.metadata.get("samplesPerPixel").and_then(|n| n.parse::<f32>().ok()); // pbrt's
    let count = |i: usize| aovs.scalar(Aov::Samples, i).or(of_all).unwrap_or(1.0);
    let known = |i: usize| aovs.holds(i) && colour[i].iter().all(|v| v.is_finite());
    (0..colour.len()).map(|i| if known(i) { count(i) } else { 0.0 }).collect()
}

/// The albedo that indirect light is multiplied by is that of the samples, `(colour - direct) / indirect`, so that edges
/// and textures stay as smooth as the samples made them; that of the pixel's centre where no sample met light.
fn split_light(aovs: &Aovs, colour: &[vec3], albedo: &[vec3], direct: &[vec3], indirect: &[vec3]) -> Light {
    let factor = |i: usize| {
        std::array::from_fn(|c| {
            let of_samples = (colour[i][c] - direct[i][c]) / indirect[i][c];
            let known = of_samples.is_finite() && indirect[i][c] > 0.0;
            if known { of_samples.clamp(0.0, 1.0) } else { finite(albedo[i][c]) }
        })
    };
    Light {
        filtered: indirect.to_vec(),
        factor: (0..colour.len()).map(factor).collect(),
        sharp: direct.iter().map(|v| v.map(finite)).collect(),
        unlit: unlit(aovs, albedo, direct),
        variance: indirect_variance(aovs),
        note: "filtered: indirect light before albedo; direct light stays as it is",
    }
}

/// Direct light where some pixel has none: before the albedo of the pixels' centres, so that textures stay sharp, and as it is
/// where that is 0, as on a lamp.
fn unlit(aovs: &Aovs, albedo: &[vec3], direct: &[vec3]) -> Option<Unlit> {
    let lit = |i: usize| aovs.scalar(Aov::Samples, i) != Some(0.0) && direct[i].iter().all(|v| v.is_finite());
    if (0..direct.len()).all(lit) {
        return None;
    }
    let factor: Vec<vec3> =
        albedo.iter().map(|a| if albedo::reflects(a) { albedo::divisor(a) } else { [1.0; 3] }).collect();
    let pixel = |i: usize| {
        let [r, g, b] = std::array::from_fn(|c| direct[i][c] / factor[i][c]);
        if lit(i) { [r, g, b, aovs.scalar(Aov::Samples, i).unwrap_or(1.0)] } else { [0.0; 4] }
    };
    Some(Unlit { radiance: (0..direct.len()).map(pixel).collect(), factor })
}

/// 0 for what is no number: nothing would mend it later.
fn finite(v: f32) -> f32 {
    if v.is_finite() { v } else { 0.0 }
}

fn plain(colour: &[vec3]) -> Light {
    Light {
        filtered: colour.to_vec(),
        factor: vec![[1.0; 3]; colour.len()],
        sharp: vec![[0.0; 3]; colour.len()],
        unlit: None,
        variance: None,
        note: "filtered: the colour, without demodulation",
    }
}

/// Pixels whose filtered part is not used must not reach others.
fn with_count(((c, count), factor): ((&vec3, &f32), &vec3)) -> vec4 {
    let used = factor.iter().any(|&f| f > 0.0);
    [c[0], c[1], c[2], if used { *count } else { 0.0 }]
}

/// That of each pixel's mean of indirect light, by its luminance.
fn indirect_variance(aovs: &Aovs) -> Option<Vec<vec3>> {
    let Some(Samples::F32(m2)) = aovs.film.channel("indirect.m2") else { return None };
    let of_mean = |i: usize| {
        let n = aovs.scalar(Aov::Samples, i).unwrap_or(0.0);
        if n > 1.0 { m2[i] / (n * (n - 1.0)) } else { 0.0 }
    };
    Some((0..m2.len()).map(|i| [of_mean(i); 3]).collect())
}

/// Of each pixel's mean of all light; pbrt stores that of one sample. In images of earlier versions it stands for that of indirect
/// light, which alone is filtered: without any, `auto` had 1.04 to 4.8 times the error.
fn variance(aovs: &Aovs, counts: &[f32]) -> Option<Vec<vec3>> {
    let stored = aovs.get(Aov::Variance)?;
    let of_one_sample = aovs.film.channels.iter().any(|c| c.name.starts_with("RelativeVariance."));
    let mean = |(v, n): (&vec3, &f32)| if of_one_sample { v.map(|v| v / n.max(1.0)) } else { *v };
    Some(stored.iter().zip(counts).map(mean).collect())
}

fn demodulated_variance((v, f): (&vec3, &vec3)) -> vec3 {
    std::array::from_fn(|c| if f[c] > 0.0 { v[c] / (f[c] * f[c]) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Film;
    use crate::image::aov::Names;

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
        let joined = parts.join(&[[3.0, 3.0, 3.0, 1.0]; 4]);
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
            (parts.input.radiance, parts.unlit.map(|unlit| unlit.radiance))
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
        assert_eq!(parts.join(&[[1.0; 4]; 4])[1], [0.5, 1.0, 1.0]);
        assert_eq!(parts.unlit.unwrap().radiance[1], [0.0; 4]);
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
            (parts.input.guide, parts.notes.join("\n"))
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
