//! Tests of the test whether two renders have the same expectation: how often it errs, and what it finds.
use tallow::image::significance::{Estimate, Noise, Options, Outcome, Scale, Verdict, suspects, test};
use tallow::image::{Film, Samples, Window};

/// How the samples of a pixel are distributed; the mean of all is 1.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Light {
    Exponential,
    /// Dim light, and a bright sample once in four hundred.
    Fireflies,
    /// A power law whose fourth moment is infinite.
    HeavyTail,
    /// Light or none.
    Visibility,
    /// One sample in each of n strata, like the points of a net: the mean is much better than m2 says.
    Stratified,
}

const LIGHTS: [Light; 5] =
    [Light::Exponential, Light::Fireflies, Light::HeavyTail, Light::Visibility, Light::Stratified];

impl Light {
    /// Sample `i` of `n`.
    fn sample(self, i: u32, n: u32, random: &mut fastrand::Rng) -> f64 {
        let u = 1.0 - random.f64();
        match self {
            Self::Exponential => -u.ln(),
            Self::Fireflies if random.u32(..400) == 0 => -200.0 * u.ln(),
            Self::Fireflies => 0.5,
            // A Pareto distribution of shape 2.1 has the mean 2.1 / 1.1.
            Self::HeavyTail => u.powf(-1.0 / 2.1) * 1.1 / 2.1,
            Self::Visibility => f64::from(u8::from(u < 0.05)) * 20.0,
            Self::Stratified => 2.0 * (f64::from(i) + u) / f64::from(n),
        }
    }
}

/// An image of so many pixels along each edge, whose pixels are of unlike brightness.
fn image(edge: u32, n: u32, light: Light, brightness: impl Fn(u32) -> f64, random: &mut fastrand::Rng) -> Estimate {
    let (mut mean, mut m2) = (Vec::new(), Vec::new());
    for pixel in 0..edge * edge {
        let samples: Vec<f64> = (0..n).map(|i| brightness(pixel) * light.sample(i, n, random)).collect();
        let average = samples.iter().sum::<f64>() / f64::from(n);
        mean.push([average as f32, 0.5 * average as f32, 0.0]);
        let squares = samples.iter().map(|v| (v - average).powi(2)).sum::<f64>();
        m2.push([squares as f32, 0.25 * squares as f32, 0.0]);
    }
    let noise = Noise::Samples { m2, count: vec![n as f32; mean.len()] };
    Estimate { width: edge, height: edge, mean, noise, objects: None }
}

fn uneven(pixel: u32) -> f64 {
    1.0 + f64::from(pixel % 7)
}

fn options(false_alarms: f64) -> Options {
    Options { false_alarms, ..Options::default() }
}

#[test]
fn what_is_no_image_is_refused() {
    let mut random = fastrand::Rng::with_seed(1);
    let good = image(4, 8, Light::Exponential, |_| 1.0, &mut random);
    let says = |a: &Estimate, options: Options, word: &str| {
        let line = test(a, &good, &options).unwrap_err();
        assert!(line.contains(word), "{line}");
    };
    assert!(test(&good, &good, &Options::default()).is_ok(), "control");
    let mut broken = good.clone();
    broken.mean[3][1] = f32::NAN;
    says(&broken, Options::default(), "image A: 1 of 16 pixels are NaN or infinite, the first (3, 0)");
    says(&Estimate { mean: Vec::new(), ..good.clone() }, Options::default(), "16 pixels, but [0, 16, 16, 16] means");
    says(&Estimate { objects: Some(vec![1]), ..good.clone() }, Options::default(), "[16, 16, 16, 1]");
    let noise = |m2: f32, counts: usize| Noise::Samples { m2: vec![[m2; 3]; 16], count: vec![8.0; counts] };
    says(&Estimate { noise: noise(1.0, 3), ..good.clone() }, Options::default(), "[16, 16, 3, 16]");
    says(&Estimate { noise: noise(-1.0, 16), ..good.clone() }, Options::default(), "variances or counts are negative");
    says(&good, Options { accept: f64::INFINITY, ..Options::default() }, "both finite");
    for resolve in [f64::NAN, 0.0, 1e-300] {
        says(&good, Options { resolve, ..Options::default() }, "must be at least 1e-12");
    }
}

fn differs(outcome: &Outcome) -> bool {
    outcome.verdict == Verdict::Different
}

/// Number of pairs out of `pairs` with the same expectation that are called different.
fn false_alarms(pairs: u32, edge: u32, light: Light, n: [u32; 2], rate: f64, seed: u64) -> u32 {
    let mut random = fastrand::Rng::with_seed(seed);
    let pair = |_| {
        let [a, b] = n.map(|n| image(edge, n, light, uneven, &mut random));
        u32::from(differs(&test(&a, &b, &options(rate)).unwrap()))
    };
    (0..pairs).map(pair).sum()
}

#[test]
fn of_a_thousand_pairs_that_are_the_same_no_more_than_the_rate_are_called_different() {
    let (mut all, mut pairs) = (0, 0);
    for (i, light) in LIGHTS.into_iter().enumerate() {
        for (k, n) in [[16, 16], [4, 4], [16, 64], [8, 128]].into_iter().enumerate() {
            let found = false_alarms(75, 20, light, n, 0.05, (10 * i + k) as u64);
            // 75 pairs at 5 % give 3.75 on average, and more than 10 once in 500.
            assert!(found <= 10, "{light:?} with {n:?} samples: {found} of 75");
            (all, pairs) = (all + found, pairs + 75);
        }
    }
    assert!(pairs >= 1000 && all <= pairs / 20, "{all} of {pairs}");
}

#[test]
fn a_set_that_missed_its_fireflies_is_not_different_from_one_that_met_them() {
    // A block of 16 pixels with 8 samples has one in three times; with 4096 samples it has 164.
    let found = false_alarms(20, 20, Light::Fireflies, [8, 4096], 0.05, 77);
    assert!(found <= 3, "{found} of 20");
}

#[test]
fn few_pixels_make_few_degrees_of_freedom() {
    // 256 blocks of 16 pixels: at this rate a block must differ by 4.6 standard errors of the normal distribution, which Student's
    // t with 15 degrees of freedom exceeds a hundred times as often: in 16 of these 200 pairs, where 0.5 are expected.
    let mut random = fastrand::Rng::with_seed(78);
    let mut image = || image(64, 16, Light::Stratified, |_| 1.0, &mut random);
    let different = (0..200).filter(|_| differs(&test(&image(), &image(), &options(0.01)).unwrap())).count();
    assert!(different <= 4, "{different} of 200");
}

#[test]
fn a_difference_is_found_where_it_is() {
    let mut random = fastrand::Rng::with_seed(7);
    let spot = |pixel: u32| if pixel % 64 / 16 == 1 && pixel / 64 / 16 == 2 { 1.5 } else { 1.0 };
    let a = image(64, 32, Light::Exponential, spot, &mut random);
    let b = image(64, 32, Light::Exponential, |_| 1.0, &mut random);
    let outcome = test(&a, &b, &options(0.01)).unwrap();
    let blocks = outcome.level(Scale::Block(16)).unwrap();
    let found = &blocks.worst[0];
    assert!(differs(&outcome) && blocks.different == 1, "{outcome:?}");
    assert_eq!((found.place.first, found.place.last), ([16, 32], [31, 47]));
    // 256 pixels of 32 samples: the standard error is sqrt(1.5^2 + 1) / sqrt(8192) = 0.02.
    assert!((found.difference - 0.5).abs() < 0.08 && (found.error - 0.02).abs() < 0.005, "{found:?}");
    let marked: Vec<usize> = (0..64 * 64).filter(|i| blocks.map[*i] != 0.0).collect();
    assert!(marked.len() == 256 && marked.iter().all(|i| spot(*i as u32) == 1.5));
    let inside = |f: &tallow::image::significance::Finding| spot(f.place.first[1] * 64 + f.place.first[0]) == 1.5;
    let worst = suspects(&a, &b, &outcome);
    assert!(!worst.is_empty() && worst.iter().all(|f| outcome.levels[0].different > 0 || inside(f)), "{worst:?}");
}

/// To look at all pixels for each object that differs would take minutes here.
#[test]
fn time_does_not_grow_as_objects_times_pixels() {
    const EDGE: u32 = 896;
    let pixels = (EDGE * EDGE) as usize;
    let object = |i: u32| i / EDGE / 4 * (EDGE / 4) + i % EDGE / 4;
    let noise = Noise::Samples { m2: vec![[1e-5; 3]; pixels], count: vec![16.0; pixels] };
    let mut random = fastrand::Rng::with_seed(8);
    let mut image = |mean: f32| Estimate {
        width: EDGE,
        height: EDGE,
        mean: (0..pixels).map(|_| [mean + 0.001 * random.f32(); 3]).collect(),
        noise: noise.clone(),
        objects: Some((0..EDGE * EDGE).map(object).collect()),
    };
    let (a, b) = (image(1.1), image(1.0));
    let start = std::time::Instant::now();
    let outcome = test(&a, &b, &Options::default()).unwrap();
    let objects = outcome.level(Scale::Object).unwrap();
    assert_eq!((objects.regions, objects.different), (pixels / 16, pixels / 16));
    let worst = objects.worst[0].place;
    let first = worst.object.map(|object| [object % (EDGE / 4) * 4, object / (EDGE / 4) * 4]).unwrap();
    assert_eq!((worst.first, worst.last), (first, first.map(|first| first + 3)));
    assert!(objects.map.iter().all(|d| (d - 0.1).abs() < 0.01));
    assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
}

#[test]
fn what_points_of_a_net_gain_is_not_lost() {
    // The true standard error of a pixel is 2 / sqrt(12) / 16^1.5 = 0.009 of its mean; m2 says 0.144. Over 1024 pixels,
    // both images: 0.0004, where m2 says 0.0064. A difference of 0.5 % is 12 true standard errors.
    let mut random = fastrand::Rng::with_seed(3);
    let mut of = |brightness: f64| image(32, 16, Light::Stratified, |_| brightness, &mut random);
    let (a, b, c) = (of(1.005), of(1.0), of(1.0));
    let found = test(&a, &b, &options(0.01)).unwrap();
    assert!(differs(&found) && found.level(Scale::Image).unwrap().different == 1, "{found:?}");
    let Verdict::Same { visible } = test(&b, &c, &options(0.01)).unwrap().verdict else { panic!("the same") };
    assert!(visible < 0.005, "{visible}");
}

#[test]
fn among_regions_that_are_reported_few_are_false() {
    let mut random = fastrand::Rng::with_seed(11);
    let half = |pixel: u32| if pixel % 64 < 32 { 1.6 } else { 1.0 };
    let (mut shares, mut found, pairs) = (0.0, 0, 40);
    for _ in 0..pairs {
        let a = image(64, 16, Light::Exponential, half, &mut random);
        let b = image(64, 16, Light::Exponential, |_| 1.0, &mut random);
        let outcome = test(&a, &b, &options(0.2)).unwrap();
        let level = outcome.level(Scale::Block(4)).unwrap();
        let false_ones = level.map.iter().enumerate().filter(|(i, d)| **d != 0.0 && i % 64 >= 32).count() / 16;
        shares += false_ones as f64 / level.different.max(1) as f64;
        found += level.different;
    }
    // The level of each of four scales is 5 %.
    assert!(shares / f64::from(pairs) < 0.05, "{shares}");
    assert!(found > 40 * pairs as usize, "control: {found} of {} blocks are found", 128 * pairs);
}

#[test]
fn images_that_are_too_noisy_are_told_how_many_samples_would_do() {
    let mut random = fastrand::Rng::with_seed(5);
    let mut pair = |n| [(); 2].map(|()| image(32, n, Light::Exponential, |_| 1.0, &mut random));
    let verdict = |[a, b]: [Estimate; 2]| test(&a, &b, &Options { resolve: 0.05, ..options(0.01) }).unwrap().verdict;
    let Verdict::TooNoisy { visible, samples } = verdict(pair(4)) else { panic!("too noisy") };
    // sqrt(2 / 4096) = 0.022, of which about 4.5 can be seen.
    assert!(
        (0.08..0.12).contains(&visible) && (samples - ((visible - 1e-5) / 0.05).powi(2)).abs() < 1e-9,
        "{visible} {samples}"
    );
    let enough = (4.0 * samples * 1.1) as u32;
    assert!(matches!(verdict(pair(enough)), Verdict::Same { visible } if visible < 0.05));
}

/// A film with the layers of a render of 5 x 4 pixels.
fn film(value: f32, variance: f32, count: u32) -> Film {
    let mut film = Film::new(5, 4);
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    film.add_vec3("", ["R", "G", "B"], &[[value; 3]; 20]);
    film.add_vec3("m2", ["R", "G", "B"], &[[variance * (count * count.saturating_sub(1)) as f32; 3]; 20]);
    film.add("samples", Samples::U32(vec![count; 20]));
    film
}

#[test]
fn what_does_not_tell_its_noise_is_refused() {
    let refused = |film: &Film, part: &str| {
        let line = Estimate::of_film(film).unwrap_err();
        assert!(line.contains(part) && !line.contains('\n'), "{line}");
    };
    let good = film(1.0, 0.01, 16);
    assert!(Estimate::of_film(&good).is_ok());
    refused(&film(1.0, 0.0, 1), "--spp 2");
    refused(&film(f32::NAN, 0.01, 16), "each of its 20 pixels");
    refused(&film(1.0, f32::INFINITY, 16), "infinite");
    let mut broken = good.clone();
    let red = broken.channels.iter_mut().find(|c| c.name == "R").unwrap();
    red.samples = Samples::F32((0..20).map(|i| if i == 7 { f32::NAN } else { 1.0 }).collect());
    refused(&broken, "1 of 20 pixels are NaN or infinite, the first (2, 1)");
    let mut bare = good.clone();
    bare.channels.retain(|c| !c.name.starts_with("m2"));
    refused(&bare, "--errors");
    let mut filtered = good.clone();
    filtered.metadata.insert("filtered".to_owned(), "atrous".to_owned());
    refused(&filtered, "atrous");
    // pbrt tells the variance of one sample, and how many there are in the head.
    let mut of_pbrt = Film::new(5, 4);
    of_pbrt.add_vec3("", ["R", "G", "B"], &[[1.0; 3]; 20]);
    of_pbrt.add_vec3("Variance", ["R", "G", "B"], &[[0.5; 3]; 20]);
    of_pbrt.add_vec3("RelativeVariance", ["R", "G", "B"], &[[0.5; 3]; 20]);
    of_pbrt.metadata.insert("samplesPerPixel".to_owned(), "16".to_owned());
    let Noise::Samples { m2, count } = Estimate::of_film(&of_pbrt).unwrap().noise else { panic!("no samples") };
    assert_eq!((m2[7], count[7]), ([7.5; 3], 16.0), "m2 / (n - 1) is the variance of a sample");
    // Of a part of the picture the rest has no samples.
    let left = Window { first: [0, 0], size: [2, 4] };
    let mut part = of_pbrt.clone();
    part.channels.iter_mut().for_each(|c| c.window = Some(left));
    let Noise::Samples { count, .. } = Estimate::of_film(&part).unwrap().noise else { panic!("no samples") };
    assert_eq!(count[..6], [16.0, 16.0, 0.0, 0.0, 0.0, 16.0]);
    part.metadata.clear();
    part.channels.retain(|c| !c.name.starts_with("Relative"));
    refused(&part, "a part of its picture");
    // With the noisy image beside the filtered one, that is what counts.
    filtered.add_vec3("Noisy Image", ["R", "G", "B"], &[[2.0; 3]; 20]);
    assert_eq!(Estimate::of_film(&filtered).unwrap().mean[0], [2.0; 3]);
    let (a, wide) =
        (Estimate::of_film(&good).unwrap(), image(6, 4, Light::Exponential, uneven, &mut fastrand::Rng::new()));
    assert!(test(&a, &wide, &Options::default()).unwrap_err().contains("one size"));
    let line = test(&a, &a, &Options { at: Scale::Block(64), ..Options::default() }).unwrap_err();
    assert!(
        line.contains("\"64x64\"") && line.contains("pixel, 4x4, image") || line.contains("pixel, image"),
        "{line}"
    );
}

#[test]
fn a_reference_with_standard_errors_counts_them() {
    let reference = |error: f32| {
        let mut film = Film::new(5, 4);
        film.add_vec3("", ["R", "G", "B"], &[[1.0; 3]; 20]);
        let errors = tallow::image::Picture { width: 5, height: 4, pixels: vec![[error; 3]; 20] };
        Estimate::with_errors(&film, &errors).unwrap()
    };
    let mut film_alone = Film::new(5, 4);
    film_alone.add_vec3("", ["R", "G", "B"], &[[1.0; 3]; 20]);
    let signed = tallow::image::Picture { width: 5, height: 4, pixels: vec![[-0.02; 3]; 20] };
    assert!(Estimate::with_errors(&film_alone, &signed).unwrap_err().contains("negative"));
    // The images differ by 3 %; the standard errors of 20 pixels together are 0.2236 times those of one.
    let a = Estimate::of_film(&film(1.03, 1e-6, 64)).unwrap();
    assert!(differs(&test(&a, &reference(0.001), &options(0.01)).unwrap()));
    assert!(!differs(&test(&a, &reference(0.1), &options(0.01)).unwrap()));
    let accepted = Options { accept: 0.05, ..options(0.01) };
    assert!(!differs(&test(&a, &reference(0.001), &accepted).unwrap()), "such a difference does not matter");
}
