use super::*;
use crate::image::aov::{Aov, Names};
use crate::image::{Film, Samples};
use crate::math::hash::{pcg, unit_interval};

const RGB: [&str; 3] = ["R", "G", "B"];

/// One row: a wall of albedo 0.5 lit by 2, the rim of a lamp, the lamp.
fn film() -> Film {
    let mut film = Film::new(4, 1);
    film.add_vec3("", RGB, &[[1.0; 3], [1.0; 3], [25.0; 3], [50.0; 3]]);
    film.add_vec3("albedo", RGB, &[[0.5; 3], [0.5; 3], [0.25; 3], [0.0; 3]]);
    film
}

fn take_apart(film: &Film, demodulation: Demodulation) -> Parts {
    split(&Aovs::find(film, &Names::new()).unwrap(), demodulation, false)
}

#[test]
fn lamps_and_their_rims_reach_no_other_pixel() {
    let parts = take_apart(&film(), Demodulation::Light);
    assert_eq!(parts.input.radiance, [[2.0, 2.0, 2.0, 4.0], [2.0, 2.0, 2.0, 4.0], [0.0; 4], [0.0; 4]]);
    let joined = parts.remodulate(&[[3.0, 3.0, 3.0, 1.0]; 4]);
    assert_eq!(joined, [[1.5; 3], [1.5; 3], [25.0; 3], [50.0; 3]]);
    // The albedo of pixel centres does not show that the third pixel is a rim; its light does.
    let mut centre = film();
    centre.channels.truncate(3);
    centre.add_vec3("albedo", RGB, &[[0.5; 3], [0.5; 3], [0.5; 3], [0.0; 3]]);
    assert_eq!(take_apart(&centre, Demodulation::Light).input.radiance[2], [0.0; 4]);
    // Control: in plain order all of it is filtered.
    assert!(take_apart(&film(), Demodulation::Off).input.radiance.iter().all(|c| c[3] == 4.0));
}

/// Sky of 7 around a pixel of nothing or of what is no number, beside a wall: the filter says 3.
#[test]
fn sky_without_a_sample_is_that_around_it() {
    for (bad, count) in [(0.0, 0), (f32::NAN, 4), (f32::INFINITY, 4)] {
        let mut film = Film::new(5, 1);
        film.add_vec3("", RGB, &[[7.0; 3], [7.0; 3], [bad, 0.0, 0.0], [7.0; 3], [1.0; 3]]);
        film.add_vec3("albedo", RGB, &[[0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3], [0.5; 3]]);
        film.add("samples", Samples::U32(vec![4, 4, count, 4, 4]));
        let joined = take_apart(&film, Demodulation::Albedo).remodulate(&[[3.0; 4]; 5]);
        assert_eq!(joined, [[7.0; 3], [7.0; 3], [7.0; 3], [7.0; 3], [1.0; 3]], "{bad}: the wall beside is a rim");
    }
}

/// A wall of albedo .4, of which nothing is known, between one of .5 and a lamp: it is no rim of the lamp.
#[test]
fn surfaces_without_a_sample_are_filled_in_beside_lamps() {
    let mut film = Film::new(3, 1);
    film.add_vec3("", RGB, &[[1.0; 3], [0.0; 3], [50.0; 3]]);
    film.add_vec3("albedo", RGB, &[[0.5; 3], [0.4; 3], [0.0; 3]]);
    film.add("samples", Samples::U32(vec![4, 0, 4]));
    let parts = take_apart(&film, Demodulation::Albedo);
    assert_eq!(parts.input.radiance[1][3], 0.0);
    assert_eq!(parts.remodulate(&[[2.0; 4]; 3]), [[1.0; 3], [0.8; 3], [50.0; 3]]);
}

/// White and pure red in turn under light without noise: a mean over both leaves both as they are.
#[test]
fn saturated_colours_do_not_bleed() {
    let mut film = Film::new(16, 16);
    let albedo: Vec<vec3> = (0..256).map(|i| if (i / 16 + i) % 2 == 0 { [0.8; 3] } else { [0.8, 0.0, 0.0] }).collect();
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    film.add_vec3("", RGB, &albedo);
    film.add_vec3("albedo", RGB, &albedo);
    film.add_vec3("direct", RGB, &vec![[0.0; 3]; 256]);
    film.add_vec3("indirect", RGB, &vec![[1.0; 3]; 256]);
    film.add_vec3("variance", RGB, &vec![[0.01, 0.0, 0.0]; 256]);
    film.add_vec3("N", ["X", "Y", "Z"], &vec![[0.0, 0.0, 1.0]; 256]);
    let guided = crate::denoise::filter::find("guided").unwrap();
    for demodulation in [Demodulation::Light, Demodulation::Albedo] {
        let parts = take_apart(&film, demodulation);
        assert!(parts.input.radiance.iter().all(|c| *c == [1.0, 1.0, 1.0, 4.0]), "{demodulation:?}");
        let variance = parts.input.variance.as_ref().unwrap();
        assert_eq!(variance[1], [variance[1][0]; 3], "{demodulation:?}");
        let settings = crate::denoise::filter::FilterSettings::default().scaled_to(&parts.input);
        let joined = parts.remodulate(&(guided.reference)(&parts.input, &settings));
        let off = joined.iter().zip(&albedo).map(|(a, b)| Vec3::from(*a).distance((*b).into())).fold(0.0, f32::max);
        assert!(off < 1e-4, "{demodulation:?}: {off}");
    }
}

/// Three columns of glass, one of a wall, two of a lamp and its rim to the left, three of noisy sky. The middle of the glass is black by chance.
#[test]
fn what_mirrors_and_glass_show_is_filtered_as_it_is_and_lamps_and_sky_stay() {
    let mut film = Film::new(10, 3);
    let columns = |values: [f32; 10]| -> Vec<vec3> { (0..30).map(|i| [values[i % 10]; 3]).collect() };
    film.add_vec3("", RGB, &columns([3.0, 0.0, 5.0, 1.0, 25.0, 50.0, 50.0, 7.0, 8.0, 9.0]));
    film.add_vec3("albedo", RGB, &columns([0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
    film.add_vec3("variance", RGB, &columns([1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0]));
    film.add("Z", Samples::F32((0..30).map(|i| if i % 10 < 7 { 2.0 } else { 0.0 }).collect()));
    let parts = take_apart(&film, Demodulation::Albedo);
    let row = |of: &dyn Fn(usize) -> f32| -> Vec<f32> { (10..20).map(of).collect() };
    assert_eq!(row(&|i| parts.input.radiance[i][0]), [3.0, 0.0, 5.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(row(&|i| parts.factor[i][0]), [1.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(row(&|i| parts.sharp[i][0]), [0.0, 0.0, 0.0, 0.0, 25.0, 50.0, 50.0, 7.0, 8.0, 9.0]);
}

/// A wall of albedo .5 that its own light, 1, and sharp light, .5, fall on: sharp, blurred by half and as a whole.
#[test]
fn the_share_that_a_lens_blurs_is_filtered_as_it_is() {
    let mut film = Film::new(3, 1);
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    for (layer, value) in [("", 1.0), ("direct", 0.5), ("indirect", 1.0), ("albedo", 0.5), ("variance", 0.0009)] {
        film.add_vec3(layer, RGB, &[[value; 3]; 3]);
    }
    // Of 2 samples: half of the sum of squares is the variance of their mean. Light of luminance .5 has a deviation of .02.
    film.add("samples", Samples::U32(vec![2; 3]));
    film.add("indirect.m2", Samples::F32(vec![0.0008; 3]));
    film.add("denoising blur", Samples::F32(vec![0.0, 0.5, 1.0]));
    let parts = take_apart(&film, Demodulation::Light);
    assert_eq!(parts.factor, [[0.5; 3], [0.75; 3], [1.0; 3]]);
    assert_eq!(parts.sharp, [[0.5; 3], [0.25; 3], [0.0; 3]]);
    assert_eq!(parts.input.radiance, [1.0, 1.0, 1.0].map(|light| [light, light, light, 2.0]));
    let deviations = parts.input.variance.as_ref().unwrap().iter().map(|v| v[0].sqrt());
    for (found, expected) in deviations.zip([0.02 / 0.5, (0.02 + 0.03) / 2.0 / 0.75, 0.03]) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }
    let joined = parts.remodulate(&[[1.0, 1.0, 1.0, 2.0]; 3]);
    assert_eq!(joined, [[1.0; 3]; 3]);
    film.channels.retain(|c| c.name != "denoising blur");
    film.add("denoising blur", Samples::F32(vec![f32::NAN, -1.0, 2.0]));
    assert_eq!(take_apart(&film, Demodulation::Light).factor, [[0.5; 3], [0.5; 3], [1.0; 3]]);
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
    // Before albedo; nothing of the lamp's rim, and the lamp's own light.
    let lit = [[1.0, 1.0, 1.0, 4.0], [0.0; 4], [0.0, 0.0, 0.0, -4.0], [50.0, 50.0, 50.0, 4.0]];
    assert_eq!(unlit.unwrap(), lit);
    // A broken pixel counts as one without samples.
    let red = film.channels.iter_mut().filter(|c| ["R", "direct.R"].contains(&c.name.as_str()));
    red.for_each(|c| c.samples = Samples::F32(vec![1.0, f32::NAN, 25.0, 50.0]));
    let parts = take_apart(&film, Demodulation::Light);
    assert_eq!(parts.input.radiance.iter().map(|c| c[3]).collect::<Vec<_>>(), [4.0, 0.0, 4.0, 0.0]);
    assert_eq!(parts.remodulate(&[[1.0; 4]; 4])[1], [0.5, 1.0, 1.0]);
    assert_eq!(parts.direct.unwrap().radiance[1], [0.0; 4]);
    // So does one of whose direct light alone that holds: what is left of the colour is no indirect light.
    let red = film.channels.iter_mut().find(|c| c.name == "R").unwrap();
    red.samples = Samples::F32(vec![1.0, 1.0, 25.0, 50.0]);
    assert_eq!(take_apart(&film, Demodulation::Light).input.radiance[1][3], 0.0);
}

/// Of four samples three met the sky of .5, and one a surface of albedo .8: neither the sky beside it nor the surface takes that light.
#[test]
fn pixels_that_show_a_surface_in_part_hand_no_direct_light_on() {
    let mut film = Film::new(4, 1);
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    film.add_vec3("", RGB, &[[0.4; 3], [0.475; 3], [0.0; 3], [0.5; 3]]);
    film.add_vec3("albedo", RGB, &[[0.8; 3], [0.2; 3], [0.0; 3], [0.0; 3]]);
    film.add_vec3("direct", RGB, &[[0.4; 3], [0.475; 3], [0.0; 3], [0.5; 3]]);
    film.add_vec3("indirect", RGB, &[[0.0; 3]; 4]);
    film.add("samples", Samples::U32(vec![4, 4, 0, 4]));
    let mut parts = take_apart(&film, Demodulation::Light);
    let lit = [[0.5, 0.5, 0.5, 4.0], [0.0, 0.0, 0.0, -4.0], [0.0; 4], [0.5, 0.5, 0.5, 4.0]];
    assert_eq!(parts.direct.as_ref().unwrap().radiance, lit);
    parts.remodulate_direct(&[[0.5; 4]; 4]);
    assert_eq!(parts.sharp, [[0.4; 3], [0.475; 3], [0.5; 3], [0.5; 3]], "it keeps its own");
}

/// A wall of albedo .5 under a key light that brings 2 before albedo. The samples of the pixel in the middle, of albedo .25, passed over it.
/// Of those around, the first looks elsewhere, the fourth lies 1 off the wall, the last is a lamp before it. Only the second tells.
#[test]
fn key_light_that_all_samples_passed_over_is_that_around() {
    let mut film = Film::new(5, 1);
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    film.add_vec3("", RGB, &[[4.0; 3], [1.5; 3], [1.0; 3], [9.0; 3], [50.0; 3]]);
    film.add_vec3("albedo", RGB, &[[0.5; 3], [0.5; 3], [0.25; 3], [0.5; 3], [0.0; 3]]);
    film.add_vec3("direct", RGB, &[[3.0; 3], [1.0; 3], [0.0; 3], [8.0; 3], [50.0; 3]]);
    film.add_vec3("indirect", RGB, &[[2.0; 3], [1.0; 3], [4.0; 3], [2.0; 3], [0.0; 3]]);
    let places = [0.0, 0.1, 0.2, 0.3, 0.4].map(|x: f32| [x, 0.0, if x == 0.3 { -4.0 } else { -5.0 }]);
    film.add_vec3("P", ["X", "Y", "Z"], &places);
    film.add("Z", Samples::F32(vec![5.0; 5]));
    film.add("samples", Samples::U32(vec![4; 5]));
    let parts = |first: [f32; 3], marks: [u32; 2]| {
        let mut film = film.clone();
        let ahead = [0.0, 0.0, 1.0];
        film.add_vec3("N", ["X", "Y", "Z"], &[first, ahead, ahead, ahead, ahead]);
        film.add("light.remainder", Samples::U32(vec![0, marks[0], marks[1], 0, 0]));
        take_apart(&film, Demodulation::Light)
    };
    let found = parts([1.0, 0.0, 0.0], [0, ALL_PASSED_OVER]);
    // .25 * 2 of the 1 is direct light, and .5 / .25 the rest before albedo.
    assert_eq!((found.sharp[2], found.input.radiance[2]), ([0.5; 3], [2.0, 2.0, 2.0, 4.0]));
    // Turned round, the first tells of 6, at two pixels' distance: weights exp(-1/2) and exp(-2).
    let [near, far] = [-0.5f32, -2.0].map(f32::exp);
    let both = 0.25 * (2.0 * near + 6.0 * far) / (near + far);
    assert!((parts([0.0, 0.0, 1.0], [0, ALL_PASSED_OVER]).sharp[2][0] - both).abs() < 1e-6);
    // Direct light beside it is also that of a lamp: the first alone tells.
    assert!((parts([0.0, 0.0, 1.0], [SOME_BARE, ALL_PASSED_OVER]).sharp[2][0] - 0.25 * 6.0).abs() < 1e-6);
    assert_eq!(parts([1.0, 0.0, 0.0], [0, 0]).sharp[2], [0.0; 3], "control");
}

/// Filtered light may be negative beside a key light, and the whole may not; where the colour is filtered as a whole, that is kept.
#[test]
fn wholes_of_direct_and_filtered_light_are_not_negative() {
    let mut film = film();
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    film.add_vec3("direct", RGB, &[[0.5; 3], [0.5; 3], [25.0; 3], [50.0; 3]]);
    film.add_vec3("indirect", RGB, &[[1.0; 3], [1.0; 3], [0.0; 3], [0.0; 3]]);
    let filtered = [[-0.5; 4], [-2.0; 4], [0.0; 4], [0.0; 4]];
    let of = |demodulation| take_apart(&film, demodulation).remodulate(&filtered);
    assert_eq!(of(Demodulation::Light)[..2], [[0.25; 3], [0.0; 3]]);
    assert_eq!(of(Demodulation::Off)[..2], [[-0.5; 3], [-2.0; 3]]);
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
    // 12 / (n (n - 1)) for all light, over the squared albedo.
    let expected = [4.0, 0.0, 32.0, 0.0];
    let found = of(&film, Demodulation::Light);
    let near = |(a, b): (&vec3, f32)| a.iter().all(|a| (a - b).abs() <= 1e-6 * b);
    assert!(found.iter().zip(expected).all(near), "{found:?}");
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
fn samples_are_those_that_the_head_of_a_file_tells_or_taken_for_some() {
    let mut film = Film::new(4, 1);
    film.add_vec3("Night.Combined", RGB, &[[1.0; 3]; 4]);
    let count = |film: &Film| take_apart(film, Demodulation::Off).input.radiance[0][3];
    assert_eq!(count(&film), 4.0);
    film.metadata.insert("cycles.Day.samples".to_owned(), "99".to_owned());
    assert_eq!(count(&film), 4.0, "of another view layer");
    film.metadata.insert("cycles.Night.samples".to_owned(), "64".to_owned());
    assert_eq!(count(&film), 64.0);
    film.metadata.insert("samplesPerPixel".to_owned(), "NaN".to_owned());
    assert_eq!(count(&film), 64.0);
    film.add("Night.Debug Sample Count.X", Samples::F32(vec![0.25; 4]));
    assert_eq!(count(&film), 16.0, "a share of them");
    film.add("samples", Samples::U32(vec![7; 4]));
    assert_eq!(count(&film), 7.0, "a pixel's own");
    let told = Aovs::find(&film, &Names::from([(Aov::Samples, "100".to_owned())])).unwrap();
    assert_eq!(split(&told, Demodulation::Off, false).input.radiance[0][3], 25.0, "the user's number goes first");
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
    let (guide, _) = guides(&|film| film.add_vec3("P", ["X", "Y", "Z"], &[[0.0, 1.0, 5.0]; 4]));
    assert!(guide.iter().all(|g| g.depth > 0.0), "all as deep: {guide:?}");
    // No normals, and both sides of a wall: nothing tells where depth grows, but what is hit is a surface.
    let sides = [1.0, -1.0, 1.0, -1.0].map(|z| [0.0, 0.0, z]);
    for normals in [None, Some(sides)] {
        let mut film = film();
        normals.iter().for_each(|sides| film.add_vec3("N", ["X", "Y", "Z"], sides));
        film.add_vec3("P", ["X", "Y", "Z"], &hits);
        let guide = take_apart(&film, Demodulation::Light).input.guide;
        assert_eq!([0, 1, 2, 3].map(|i| guide[i].depth), [1.0, 1.0, 1.0, 0.0]);
        let aovs = Aovs::find(&film, &Names::new()).unwrap();
        assert!(Layers::new(&aovs).notes.contains(&"depth: made of the position, the same for all".to_owned()));
    }
}

/// Whether a pixel of 64 a row lies on one of the darker tiles.
fn is_dark(i: usize) -> bool {
    (i % 64 / 4 + i / 256).is_multiple_of(2)
}

/// A wall of tiles, four pixels wide, whose albedo is .3 and .6 in turn, under `light` of a pixel and its albedo.
fn tiles(light: impl Fn(usize, f32) -> f32) -> Film {
    let side = 64;
    let albedo: Vec<vec3> =
        (0..side * side).map(|i| if (i % side / 4 + i / side / 4) % 2 == 0 { [0.3; 3] } else { [0.6; 3] }).collect();
    let place = |i: usize| [(i % side) as f32, (i / side) as f32, 0.0].map(|v| v * 0.01);
    let of = |i: usize| albedo[i].map(|a| light(i, a));
    let mut film = Film::new(side as u32, side as u32);
    film.add_vec3("", RGB, &(0..side * side).map(of).collect::<Vec<_>>());
    film.add_vec3("albedo", RGB, &albedo);
    film.add_vec3("direct", RGB, &vec![[0.0; 3]; side * side]);
    film.add_vec3("indirect", RGB, &(0..side * side).map(of).collect::<Vec<_>>());
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    film.add_vec3("N", ["X", "Y", "Z"], &vec![[0.0, 0.0, 1.0]; side * side]);
    film.add_vec3("P", ["X", "Y", "Z"], &(0..side * side).map(place).collect::<Vec<_>>());
    film.add("Z", Samples::F32(vec![1.0; side * side]));
    film
}

fn adapted(film: &Film) -> Parts {
    split(&Aovs::find(film, &Names::new()).unwrap(), Demodulation::Light, true)
}

/// Brightest over darkest of what is filtered.
fn contrast(parts: &Parts) -> f32 {
    let light = || parts.input.radiance.iter().map(|c| c[1]);
    light().fold(0.0, f32::max) / light().fold(f32::INFINITY, f32::min)
}

/// A gloss mirrors .3 of light without noise, and the tiles scatter .5 of what they reflect: light is .5 A + .3, with a mean of .525 over
/// the mean albedo .45. The slope relative to the means is .5 * .45 / .525 = 3/7, so that light is divided by 3/7 A + 4/7 * .45, which is
/// 6/7 of it: 7/6 is left everywhere. Divided by albedo alone, .45 / .3 and .6 / .6 show the tiles.
#[test]
fn what_a_gloss_mirrors_does_not_follow_albedo() {
    let film = tiles(|_, albedo| 0.5 * albedo + 0.3);
    let (with, without) = (adapted(&film), take_apart(&film, Demodulation::Light));
    println!("{} {}", contrast(&with), contrast(&without));
    assert!((contrast(&without) - 1.5).abs() < 1e-4, "{}", contrast(&without));
    // Windows do not hold as many pixels of both kinds of tiles.
    assert!(contrast(&with) < 1.02, "{}", contrast(&with));
    assert!(with.input.radiance.iter().all(|c| (c[0] - 7.0 / 6.0).abs() < 0.02));
    let joined = with.remodulate(&with.input.radiance);
    let off = joined.iter().zip(&with.input.guide).map(|(p, g)| (p[1] - (0.5 * g.albedo[1] + 0.3)).abs());
    assert!(off.fold(0.0, f32::max) < 1e-6, "what is taken apart is put together again");
}

/// Light of which a half is noise, on tiles without a gloss, also with a shadow that ends across tiles.
#[test]
fn light_that_follows_albedo_is_divided_by_it() {
    let noise = |i: usize| unit_interval(pcg(i as u32));
    for (shadow, most) in [(1.0, 0.01), (0.2, 0.03)] {
        let film = tiles(|i, albedo| albedo * (0.5 + noise(i)) * if i % 64 < 30 { 1.0 } else { shadow });
        let (with, without) = (adapted(&film), take_apart(&film, Demodulation::Light));
        let off = with.factor.iter().zip(&without.factor).map(|(a, b)| (a[1] / b[1] - 1.0).abs()).fold(0.0, f32::max);
        assert!(off < most, "{shadow}: {off}");
    }
}

/// Glossy tiles, the right half of them `changed`: pixels there keep their factors, those of the left half do not.
fn only_the_left_half(changed: impl Fn(&mut Film)) {
    let mut film = tiles(|i, albedo| if i % 64 < 32 { 0.5 * albedo + 0.3 } else { albedo });
    changed(&mut film);
    let (with, without) = (adapted(&film), take_apart(&film, Demodulation::Light));
    let moved = |i: usize| (with.factor[i][1] / without.factor[i][1] - 1.0).abs();
    let [left, right]: [Vec<usize>; 2] = [0, 32].map(|first| (0..4096).filter(|i| i % 64 / 32 * 32 == first).collect());
    assert!(left.iter().all(|&i| moved(i) > 0.1), "control: the gloss is found");
    let most = right.iter().map(|&i| moved(i)).fold(0.0, f32::max);
    assert!(most < 1e-6, "{most}");
}

fn replace(film: &mut Film, layer: &str, names: [&str; 3], values: &[vec3]) {
    film.channels.retain(|c| !c.name.starts_with(&format!("{layer}.")));
    film.add_vec3(layer, names, values);
}

/// Tiles without a gloss beside glossy ones, on a wall behind theirs or of a sixth of their albedo.
#[test]
fn other_surfaces_and_other_materials_do_not_count() {
    only_the_left_half(|film| {
        let place = |i: usize| [(i % 64) as f32 * 0.01, (i / 64) as f32 * 0.01, if i % 64 < 32 { 0.0 } else { -0.5 }];
        replace(film, "P", ["X", "Y", "Z"], &(0..4096).map(place).collect::<Vec<_>>());
    });
    only_the_left_half(|film| {
        let share = |i: usize| if i % 64 < 32 { 1.0 } else { 1.0 / 6.0 };
        let albedo = |i: usize| share(i) * if is_dark(i) { 0.3 } else { 0.6 };
        let light = |i: usize| if i % 64 < 32 { [0.5 * albedo(i) + 0.3; 3] } else { [albedo(i); 3] };
        let of = |f: &dyn Fn(usize) -> vec3| (0..4096).map(f).collect::<Vec<_>>();
        replace(film, "albedo", RGB, &of(&|i| [albedo(i); 3]));
        replace(film, "indirect", RGB, &of(&light));
        film.channels.retain(|c| !RGB.contains(&c.name.as_str()));
        film.add_vec3("", RGB, &of(&light));
    });
}

/// White light from a gloss on red tiles, of which every second one reflects no green: what is taken apart is put together again, and
/// what such a tile does not reflect stays out.
#[test]
fn channels_that_are_not_reflected_stay_so() {
    let mut film = tiles(|_, albedo| 0.5 * albedo + 0.3);
    let albedo: Vec<vec3> = (0..4096).map(|i| if is_dark(i) { [0.3, 0.0, 0.005] } else { [0.6, 0.01, 0.01] }).collect();
    replace(&mut film, "albedo", RGB, &albedo);
    let with = adapted(&film);
    assert!(with.factor.iter().zip(&albedo).all(|(f, a)| (f[1] == 0.0) == (a[1] == 0.0) && f[2] >= 0.005));
    assert!(with.factor.iter().zip(&albedo).any(|(f, a)| (f[0] - a[0]).abs() > 0.05), "control: the gloss is found");
    let joined = with.remodulate(&with.input.radiance);
    for (joined, i) in joined.iter().zip(0..) {
        let whole = 0.5 * if is_dark(i) { 0.3 } else { 0.6 } + 0.3;
        assert!((joined[0] - whole).abs() < 1e-5 && (joined[2] - whole).abs() < 1e-5, "{joined:?} of {whole}");
    }
}
