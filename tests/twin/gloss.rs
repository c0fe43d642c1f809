//! What `auto` makes of two lamps' reflections on a rough plate: bright and noisy, on dark without noise, and no guide shows them.
use crate::support::{assert_silent, gpu, hash, largest};
use tallow::denoise::filter::{FilterInput, FilterSettings, find, run};
use tallow::layout::{Guide, vec4};

const SIZE: [u32; 2] = [64, 40];
/// Of a sample that finds a lamp.
const BRIGHT: f32 = 60.0;

/// The chance that a sample of pixel `i` finds a lamp.
fn chance(i: u32) -> f32 {
    let [x, y] = [i % SIZE[0], i / SIZE[0]].map(|at| at as f32 + 0.5);
    let lobe = |centre: f32, width: f32| (-((x - centre).powi(2) + (y - 20.0).powi(2)) / (2.0 * width * width)).exp();
    (0.7 * (lobe(16.0, 2.5) + lobe(46.0, 4.0))).min(1.0)
}

/// The plate at so many samples per pixel, independent ones or one in each of as many strata.
fn plate(spp: u32, stratified: bool) -> FilterInput {
    let pixels = SIZE[0] * SIZE[1];
    let found = |i: u32| {
        let random = |k: u32| hash(hash(i) ^ (k + 1)) as f32 / u32::MAX as f32;
        let place = |k: u32| if stratified { (k as f32 + random(k)) / spp as f32 } else { random(k) };
        (0..spp).filter(|&k| place(k) < chance(i)).count() as f32
    };
    let means: Vec<f32> = (0..pixels).map(|i| BRIGHT * found(i) / spp as f32).collect();
    let mean = |i: u32| means[i as usize];
    // Of the mean of `spp` values that are 0 or BRIGHT.
    let variance = |i: u32| mean(i) * (BRIGHT - mean(i)) / (spp - 1) as f32;
    let at = |i: u32| [(i % SIZE[0]) as f32, (i / SIZE[0]) as f32, 0.0];
    let guide =
        |i: u32| Guide { normal: [0.0, 0.0, 1.0], depth: 5.0, position: at(i).map(|x| 0.05 * x), ..Guide::default() };
    FilterInput {
        width: SIZE[0],
        height: SIZE[1],
        radiance: (0..pixels).map(|i| [mean(i), mean(i), mean(i), spp as f32]).collect(),
        guide: (0..pixels).map(guide).collect(),
        variance: Some((0..pixels).map(|i| [variance(i); 3]).collect()),
    }
}

/// As `tallow compare` has it.
fn relmse(image: &[vec4]) -> f32 {
    let error = |(i, c): (u32, &vec4)| {
        let truth = BRIGHT * chance(i);
        (c[0] - truth).powi(2) / (truth * truth + 0.01)
    };
    (0..).zip(image).map(error).sum::<f32>() / image.len() as f32
}

/// Consistency: with more samples the filter takes back what it does. Nothing is left to gain at 4096, and its weights are estimates.
#[test]
fn errors_over_those_of_noise_tend_to_one() {
    let auto = find("auto").unwrap();
    let ratio = |spp: u32| {
        let input = plate(spp, false);
        let output = (auto.reference)(&input, &FilterSettings::default().scaled_to(&input));
        relmse(&output) / relmse(&input.radiance)
    };
    let ratios = [2, 16, 256, 4096].map(ratio);
    println!("{ratios:.3?}");
    assert!(ratios[..3].iter().all(|ratio| *ratio < 0.9), "{ratios:?}");
    assert!((0.9..1.03).contains(&ratios[3]), "{ratios:?}");
}

#[test]
fn auto_is_not_worse_than_noise_between_reflections() {
    let (gpu, auto) = (gpu(), find("auto").unwrap());
    for spp in [2, 4, 16] {
        let input = plate(spp, false);
        let settings = FilterSettings::default().scaled_to(&input);
        let (output, twin) = (run(&gpu, auto, &input, &settings).unwrap().0, (auto.reference)(&input, &settings));
        let errors = [&output, &twin, &input.radiance].map(|image| relmse(image));
        println!("{spp} samples: kernel, twin, noisy {errors:.4?}");
        assert!(errors[0] < errors[2] && errors[1] < errors[2], "{spp} samples: {errors:?}");
        let apart = largest(output.iter().zip(&twin).map(|(a, b)| (a[0] - b[0]).abs()));
        assert!(apart < 1e-3 * BRIGHT, "{apart}");
    }
    assert_silent(&gpu);
}

/// Stratified samples have less noise than their variance tells, so that the image itself seems best. Between the reflections one
/// sample of a few pixels still finds a lamp: without a cut, .80 of the noise's error is left.
#[test]
fn auto_cuts_what_one_of_stratified_samples_has_brought() {
    let (gpu, auto, input) = (gpu(), find("auto").unwrap(), plate(16, true));
    let settings = FilterSettings::default().scaled_to(&input);
    let (output, twin) = (run(&gpu, auto, &input, &settings).unwrap().0, (auto.reference)(&input, &settings));
    let errors = [&output, &twin, &input.radiance].map(|image| relmse(image));
    println!("kernel, twin, noisy {errors:.4?}");
    assert!(errors[..2].iter().all(|&error| error < 0.7 * errors[2]), "{errors:?}");
    assert_silent(&gpu);
}

/// Light of 1 on a wall, which one sample in eight finds: three of four pixels of two samples are dark and tell no variance. Trusted,
/// they leave .032 of the noise's error.
#[test]
fn auto_is_not_misled_by_samples_that_are_dark_by_chance() {
    let (gpu, auto, mut input) = (gpu(), find("auto").unwrap(), plate(2, false));
    let found = |i: u32| (0..2).filter(|k| hash(hash(i) ^ (k + 1)).is_multiple_of(8)).count() as f32;
    for (i, c) in (0..).zip(&mut input.radiance) {
        *c = [4.0 * found(i), 4.0 * found(i), 4.0 * found(i), 2.0];
    }
    // Of the mean of 0 and 8, and of two that are the same.
    let variance = |i: u32| [if found(i) == 1.0 { 16.0 } else { 0.0 }; 3];
    input.variance = Some((0..SIZE[0] * SIZE[1]).map(variance).collect());
    let settings = FilterSettings::default().scaled_to(&input);
    let (output, twin) = (run(&gpu, auto, &input, &settings).unwrap().0, (auto.reference)(&input, &settings));
    let errors = [&output, &twin, &input.radiance].map(|image| image.iter().map(|c| (c[0] - 1.0).powi(2)).sum::<f32>());
    println!("kernel, twin, noisy {errors:.4?}");
    assert!(errors[..2].iter().all(|&error| error < 0.02 * errors[2]), "{errors:?}");
    assert_silent(&gpu);
}

/// Light of 1 on a wall, which one sample in 16 finds: of 64 samples one pixel in sixty has met none, one in fifteen one. Those tell no variance,
/// or little. Trusted, they leave specks below three quarters of the light at one pixel in forty; as noisy as those around, one in a hundred.
#[test]
fn auto_leaves_no_specks_where_samples_are_dark_by_chance() {
    let (gpu, auto, mut input) = (gpu(), find("auto").unwrap(), plate(64, false));
    let found = |i: u32| (0..64).filter(|k| hash(hash(i) ^ (k + 1)).is_multiple_of(16)).count() as f32;
    for (i, c) in (0..).zip(&mut input.radiance) {
        let mean = 16.0 * found(i) / 64.0;
        *c = [mean, mean, mean, 64.0];
    }
    // Of samples of 16 and 0: the variance of their mean.
    let variance = |i: u32| {
        let share = found(i) / 64.0;
        [16f32.powi(2) * share * (1.0 - share) / 63.0; 3]
    };
    input.variance = Some((0..SIZE[0] * SIZE[1]).map(variance).collect());
    let settings = FilterSettings::default().scaled_to(&input);
    let (output, twin) = (run(&gpu, auto, &input, &settings).unwrap().0, (auto.reference)(&input, &settings));
    let dark = |image: &Vec<vec4>| image.iter().filter(|c| c[0] < 0.75).count() as f32 / image.len() as f32;
    let shares = [&output, &twin, &input.radiance].map(dark);
    println!("kernel, twin, noisy {shares:.4?}");
    assert!(shares[..2].iter().all(|share| *share < 0.015) && shares[2] > 0.15, "{shares:?}");
    assert_silent(&gpu);
}

/// Light of 1 on a wall, which one sample in 64 brings, and another a little: of 16 samples six pixels in ten have met nothing. Were svgf
/// trusted by left-out pixels alone, .033 of the noise's error would stay. Were the light of single samples cut in dark pixels too, there
/// would be 28 specks.
#[test]
fn auto_keeps_the_light_that_few_samples_bring() {
    const SPP: u32 = 16;
    const LITTLE: f32 = 2.0;
    let (gpu, auto, mut input) = (gpu(), find("auto").unwrap(), plate(SPP, false));
    let sample = |i: u32, k: u32| match hash(hash(i) ^ (k + 1)) >> 26 {
        0 => 64.0 - LITTLE,
        63 => LITTLE,
        _ => 0.0,
    };
    for i in 0..SIZE[0] * SIZE[1] {
        let samples = (0..SPP).map(|k| sample(i, k));
        let mean = samples.clone().sum::<f32>() / SPP as f32;
        let square = samples.map(|light| (light - mean).powi(2)).sum::<f32>();
        input.radiance[i as usize] = [mean, mean, mean, SPP as f32];
        input.variance.as_mut().unwrap()[i as usize] = [square / (SPP * (SPP - 1)) as f32; 3];
    }
    let settings = FilterSettings::default().scaled_to(&input);
    let (output, twin) = (run(&gpu, auto, &input, &settings).unwrap().0, (auto.reference)(&input, &settings));
    let error = |image: &Vec<vec4>| image.iter().map(|c| (c[0] - 1.0).powi(2)).sum::<f32>() / image.len() as f32;
    let errors = [&output, &twin, &input.radiance].map(error);
    let specks = [&output, &twin].map(|image| specks(image));
    println!("kernel, twin, noisy {errors:.4?}, specks {specks:?}");
    assert!(errors[..2].iter().all(|&error| error < 0.022 * errors[2]), "{errors:?}");
    assert!(specks.iter().all(|&specks| specks <= 10), "{specks:?}");
    assert_silent(&gpu);
}

/// How many pixels have less than .6 of the light that the four beside them have.
fn specks(image: &[vec4]) -> usize {
    let [width, height] = SIZE.map(|edge| edge as usize);
    let light = |x: usize, y: usize| image[y * width + x][0];
    let beside = |x: usize, y: usize| light(x - 1, y) + light(x + 1, y) + light(x, y - 1) + light(x, y + 1);
    let dark = |y: usize| (1..width - 1).filter(move |&x| light(x, y) < 0.6 * 0.25 * beside(x, y)).count();
    (1..height - 1).map(dark).sum()
}

/// A plate with a texture below a gloss that shows a lamp: a base of albedo a, which light of 1 falls on, and a gloss of .04 that shows
/// light of 5. Divided by the albedo A = a + .04 of both it is (a + .2) / A = 1 + .16 / A: a guide that tells A tells the light.
#[test]
fn the_texture_below_a_gloss_is_not_left_in_its_light() {
    let (gpu, auto, mut input) = (gpu(), find("auto").unwrap(), plate(16, false));
    let random = |i: u32| hash(i) as f32 / u32::MAX as f32;
    let albedo = |i: u32| 0.16 + 0.6 * random(i % SIZE[0] / 3).powi(2); // of stripes
    let truth = |i: u32| 1.0 + 0.16 / albedo(i);
    let noise = |i: u32| 0.6 * (0..4).map(|k| random(9 * i + k + 1000) - 0.5).sum::<f32>(); // of variance .6^2 / 3
    for i in 0..SIZE[0] * SIZE[1] {
        let light = truth(i) + noise(i);
        input.radiance[i as usize] = [light, light, light, 16.0];
        input.variance.as_mut().unwrap()[i as usize] = [0.12; 3];
    }
    let error = |told: &dyn Fn(u32) -> f32| {
        let mut input = input.clone();
        for (i, g) in (0..).zip(&mut input.guide) {
            g.albedo = [told(i); 3];
        }
        let output = run(&gpu, auto, &input, &FilterSettings::default().scaled_to(&input)).unwrap().0;
        (0..).zip(&output).map(|(i, c)| (c[0] - truth(i)).powi(2)).sum::<f32>() / output.len() as f32
    };
    let [told, untold] = [error(&albedo), error(&|_| 0.5)];
    println!("{told:.6} {untold:.6}");
    assert!(told < 0.3 * untold, "{told} of {untold}");
    assert_silent(&gpu);
}
