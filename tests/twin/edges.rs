//! What `auto` makes of pixels that filters of one surface get wrong: those that show two, and those that are dark by chance.
use crate::picture;
use crate::support::{assert_silent, gpu, hash};
use tallow::denoise::filter::{FilterInput, FilterSettings, find, run};
use tallow::layout::NONE;

const SIZE: [u32; 2] = [48, 32];
const SAMPLES: u32 = 8;

/// Uniform in 0 to 1.
fn random(i: u32, k: u32) -> f32 {
    hash(hash(i) ^ (k + 1)) as f32 / u32::MAX as f32
}

/// A plane, whose pixels have the mean of so many samples of a light, and the variance of that mean.
fn sampled(samples: u32, light: impl Fn(u32, u32) -> f32) -> FilterInput {
    let [width, height] = SIZE;
    let mut input = picture::flat(width, height);
    let mut variance = Vec::new();
    for (i, c) in (0..).zip(&mut input.radiance) {
        let lights = || (0..samples).map(|k| light(i, k));
        let mean = lights().sum::<f32>() / samples as f32;
        *c = [mean, mean, mean, samples as f32];
        let m2: f32 = lights().map(|l| (l - mean).powi(2)).sum();
        variance.push([m2 / (samples * (samples - 1)) as f32; 3]);
    }
    input.variance = Some(variance);
    input
}

/// The same with pixels in different places.
fn spread_out(mut input: FilterInput) -> FilterInput {
    for (i, guide) in (0..).zip(&mut input.guide) {
        guide.position = [i % SIZE[0], i / SIZE[0], 0].map(|at| 0.05 * at as f32);
        guide.depth = 5.0;
    }
    input
}

/// Of the kernel and of its twin.
fn filtered(input: &FilterInput) -> [Vec<f32>; 2] {
    let (gpu, auto) = (gpu(), find("auto").unwrap());
    let settings = FilterSettings::default().scaled_to(input);
    let made = [run(&gpu, auto, input, &settings).unwrap().0, (auto.reference)(input, &settings)];
    assert_silent(&gpu);
    made.map(|image| image.iter().map(|c| c[0]).collect())
}

/// A wall in light of 2 beside one in light of .2 that reflects six times as much. Pixels of the first wall's last column show random
/// shares of both, so that they have light between. Filters of one surface alone leave a relative square error of .21 there.
#[test]
fn pixels_that_show_two_surfaces_get_light_between_theirs() {
    let [width, edge] = [SIZE[0], SIZE[0] / 2];
    let truth = |i: u32| match i % width {
        x if x < edge - 1 => 2.0,
        x if x == edge - 1 => {
            let [first, second] = [random(i, SAMPLES), 6.0 * (1.0 - random(i, SAMPLES))];
            (2.0 * first + 0.2 * second) / (first + second)
        }
        _ => 0.2,
    };
    let mut input = sampled(SAMPLES, |i, k| 2.0 * random(i, k) * truth(i));
    for (i, guide) in (0..).zip(&mut input.guide) {
        guide.normal = if i % width < edge { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    }
    // Of the last column of the first wall, and of all others.
    let errors = |image: &[f32]| {
        [true, false].map(|at_edge| {
            let pixels = (0..).zip(image).filter(|(i, _)| (i % width == edge - 1) == at_edge);
            let (count, sum) =
                pixels.fold((0, 0.0), |(count, sum), (i, light)| (count + 1, sum + (light / truth(i) - 1.0).powi(2)));
            sum / count as f32
        })
    };
    let found = filtered(&input).map(|image| errors(&image));
    // What a lens blurs is not named, and has no edges.
    input.guide.iter_mut().for_each(|guide| guide.material = NONE);
    let blurred = filtered(&input).map(|image| errors(&image));
    println!("kernel and twin {found:?}, blurred {blurred:?}");
    assert!(found.iter().all(|[mixed, pure]| *mixed < 0.17 && *pure < 3e-3), "{found:?}");
    assert!(blurred.iter().all(|[mixed, _]| *mixed > 0.19), "{blurred:?}");
}

/// A wall in light of 1, which one sample in 32 finds: seven of eight pixels of four samples are dark and tell no variance. No part
/// of it is darker than a third.
#[test]
fn samples_that_are_dark_by_chance_make_no_holes() {
    let input = sampled(4, |i, k| if random(i, k) < 1.0 / 32.0 { 32.0 } else { 0.0 });
    for (image, of) in filtered(&input).iter().zip(["kernel", "twin"]) {
        let darkest = image.iter().copied().fold(f32::INFINITY, f32::min);
        let mean = image.iter().sum::<f32>() / image.len() as f32;
        println!("{of}: {darkest} to a mean of {mean}");
        assert!(darkest > 0.3 && (mean - 1.0).abs() < 0.15, "{of}: {darkest}, {mean}");
    }
}

/// The same with eight samples: three of four pixels are dark. Equal pixels that tell no variance do not tell that there is none: where
/// they count, .081 of the square error is left, and parts as dark as .18.
#[test]
fn pixels_without_variance_do_not_make_others_sure() {
    let input = spread_out(sampled(8, |i, k| if random(i, k) < 1.0 / 32.0 { 32.0 } else { 0.0 }));
    for (image, of) in filtered(&input).iter().zip(["kernel", "twin"]) {
        let darkest = image.iter().copied().fold(f32::INFINITY, f32::min);
        let error = image.iter().map(|light| (light - 1.0).powi(2)).sum::<f32>() / image.len() as f32;
        println!("{of}: {darkest}, error {error}");
        assert!(darkest > 0.35 && error < 0.05, "{of}: {darkest}, {error}");
    }
}

/// The same where a lens blurs a wall of albedo .5. Where like pixels did not count for the noise of what is blurred, it had black specks.
#[test]
fn what_a_lens_blurs_of_a_wall_has_no_specks() {
    let mut input = sampled(4, |i, k| if random(i, k) < 1.0 / 32.0 { 32.0 } else { 0.0 });
    for guide in &mut input.guide {
        (guide.material, guide.albedo) = (NONE, [0.5; 3]);
    }
    for (image, of) in filtered(&input).iter().zip(["kernel", "twin"]) {
        let darkest = image.iter().copied().fold(f32::INFINITY, f32::min);
        let mean = image.iter().sum::<f32>() / image.len() as f32;
        println!("{of}: {darkest} to a mean of {mean}");
        assert!(darkest > 0.3 && (mean - 1.0).abs() < 0.15, "{of}: {darkest}, {mean}");
    }
}

/// Lamps out of focus, each a disk of pixels that one sample in six finds; all other pixels are dark for sure. One pixel of three by three
/// shows a lamp, which reflects nothing, or the sky, where nothing was hit. Were they taken for a wall, lamps would have fog around them.
#[test]
fn lamps_that_a_lens_blurs_have_no_fog_around_them() {
    let width = SIZE[0];
    let off = |at: u32| (at % 16) as f32 - 8.0;
    let in_disk = |i: u32| off(i % width).hypot(off(i / width)) < 4.5;
    let wall = sampled(4, |i, k| if in_disk(i) && random(i, k) < 1.0 / 6.0 { 60.0 } else { 0.0 });
    let fog = |albedo: f32, object: u32| {
        let mut input = wall.clone();
        for (i, guide) in (0..).zip(&mut input.guide) {
            (guide.material, guide.albedo) = (NONE, [0.5; 3]);
            if i % width % 3 == 1 && i / width % 3 == 1 {
                (guide.albedo, guide.object) = ([albedo; 3], object);
            }
        }
        filtered(&input).map(|image| {
            let around = (0..).zip(&image).filter(|(i, _)| !in_disk(*i)).map(|(_, light)| light.powi(2));
            around.sum::<f32>() / image.len() as f32
        })
    };
    let [of_wall, beside_lamps, before_sky] = [fog(0.5, 0), fog(0.0, 0), fog(0.5, NONE)];
    println!("kernel and twin: {of_wall:?} of a wall, {beside_lamps:?} beside lamps, {before_sky:?} before a sky");
    for k in [0, 1] {
        assert!(beside_lamps[k] < 0.5 * of_wall[k] && before_sky[k] < 0.5 * of_wall[k], "{k}");
    }
}

/// The image of a small sun, of 400, which half of the samples of nine pixels find, on light of .2. What its pixels tell of their variance
/// makes no fog of it plausible where no sample of sixteen has found it: light of .37 was left around it.
#[test]
fn no_fog_is_left_around_the_image_of_a_sun() {
    let width = SIZE[0];
    let from_sun = |i: u32| ((i % width) as f32 - 24.0).hypot((i / width) as f32 - 16.0);
    let input = spread_out(sampled(16, |i, k| if from_sun(i) < 1.5 && random(i, k) < 0.5 { 400.2 } else { 0.2 }));
    for (image, of) in filtered(&input).iter().zip(["kernel", "twin"]) {
        let around: Vec<f32> =
            (0..).zip(image).filter(|(i, _)| (2.0..6.0).contains(&from_sun(*i))).map(|(_, light)| *light).collect();
        let mean = around.iter().sum::<f32>() / around.len() as f32;
        println!("{of}: {mean} around");
        assert!((0.19..0.3).contains(&mean), "{of}: {mean}");
    }
}
