//! The filters on the device against their CPU twins, and the twins against examples worked by hand.
#[path = "support/picture.rs"]
mod picture;
mod support;

use picture::{Picture, SIZES};
use support::{assert_silent, gpu};
use tallow::filter::{FILTERS, FilterInput, FilterSettings, find, firefly, run};
use tallow::gpu::layout::vec4;

/// The largest difference of a channel, relative to the pixel's largest where that is above `scale`.
fn apart(a: &[vec4], b: &[vec4], scale: f32) -> f32 {
    assert_eq!(a.len(), b.len());
    let largest = |c: &vec4| c[..3].iter().fold(scale, |m, v| m.max(v.abs()));
    let pair = |(a, b): (&vec4, &vec4)| {
        let off = (0..4).map(|i| (a[i] - b[i]).abs()).fold(0.0, f32::max);
        if off.is_nan() { f32::INFINITY } else { off / largest(b) }
    };
    a.iter().zip(b).map(pair).fold(0.0, f32::max)
}

#[test]
fn kernels_agree_with_their_twins() {
    let gpu = gpu();
    for row in FILTERS {
        for (width, height) in SIZES {
            let input = Picture::new(width, height).noisy().input;
            for settings in picture::settings(row.name) {
                let settings = settings.scaled_to(&input);
                let (device, _) = run(&gpu, row, &input, &settings).unwrap();
                let host = (row.reference)(&input, &settings);
                let off = apart(&device, &host, 1.0);
                assert!(off < 2e-4, "{} {width}x{height}: {off} apart with {settings:?}", row.name);
                if width * height > 1 {
                    let mut turned = host.clone();
                    turned.rotate_right(1);
                    assert!(apart(&device, &turned, 1.0) > 1e-2, "{} control: other pixels", row.name);
                }
            }
        }
    }
    assert_silent(&gpu);
}

/// One row of pixels on one plane, without edges.
fn line(values: &[f32]) -> FilterInput {
    let mut input = Picture::new(values.len() as u32, 1).flat().input;
    input.radiance = values.iter().map(|v| [*v, *v, *v, if v.is_nan() { 0.0 } else { 1.0 }]).collect();
    input
}

fn red(pixels: &[vec4]) -> Vec<f32> {
    pixels.iter().map(|p| p[0]).collect()
}

#[test]
fn atrous_solves_the_worked_example() {
    let off = f32::INFINITY;
    let plain = FilterSettings { levels: 1, sigma_rt: off, sigma_n: off, sigma_x: off, ..FilterSettings::default() };
    let reference = find("atrous").unwrap().reference;
    // An impulse of 16 becomes the B3 spline 1, 4, 6, 4, 1; nothing is known outside, so pixels 2 and 6 of a row of 9
    // have all their taps, 1 and 7 lack the last.
    let mut values = [0.0; 9];
    values[4] = 16.0;
    assert_eq!(red(&reference(&line(&values), &plain)), [0.0, 0.0, 1.0, 4.0, 6.0, 4.0, 1.0, 0.0, 0.0]);
    // Level 1 spreads taps of 2 pixels over that: pixel 4 takes 6/16 of 6, 4/16 of 1 + 1; pixel 0 has 6/16 and 4/16 of
    // 0 and 1 and 1/16 of 6 in reach: (4 + 6) / (6 + 4 + 1).
    let two = reference(&line(&values), &FilterSettings { levels: 2, ..plain });
    assert_eq!(two[4][0], (6.0 * 6.0 + 4.0 * 2.0) / 16.0);
    assert!((two[0][0] - 10.0 / 11.0).abs() < 1e-6);
    // 0 | 1 in all three channels with sigma 1: the neighbour weighs 4/16 * e^-3 beside 6/16. Conserving, it moves that
    // much of the step, times the 6/16 of the taps that lie in the row.
    let edge = FilterSettings { sigma_rt: 1.0, ..plain };
    let w = (-3.0f32).exp() * 4.0 / 16.0;
    assert!((red(&reference(&line(&[0.0, 1.0]), &edge))[0] - w / (w + 6.0 / 16.0)).abs() < 1e-6);
    let kept = red(&reference(&line(&[0.0, 1.0]), &FilterSettings { conserve_energy: true, ..edge }));
    assert!((kept[0] - w * 6.0 / 16.0).abs() < 1e-6 && kept[0] + kept[1] == 1.0);
    // An unknown pixel between 2 and 4 takes their mean, whatever the radiance weight, and counts as one sample.
    let painted = reference(&line(&[2.0, f32::NAN, 4.0]), &FilterSettings { sigma_rt: 0.1, ..plain });
    assert_eq!(painted[1], [3.0, 3.0, 3.0, 1.0]);
}

#[test]
fn fireflies_are_cut_and_accounted_for() {
    let gpu = gpu();
    // A lone 9 over a floor of 1 is cut to twice that; two together keep each other.
    let mut input = Picture::new(20, 6).flat().input;
    input.radiance.fill([1.0, 1.0, 1.0, 1.0]);
    input.radiance[2 * 20 + 4] = [9.0, 9.0, 9.0, 1.0];
    input.radiance[2 * 20 + 14] = [9.0, 9.0, 9.0, 1.0];
    input.radiance[3 * 20 + 14] = [9.0, 9.0, 9.0, 1.0];
    input.radiance[3 * 20 + 15] = [9.0, 9.0, 9.0, 1.0];
    let host = firefly::reference(&input, 2.0);
    let before = input.clone();
    let removed = firefly::remove_fireflies(&gpu, &mut input, 2.0).unwrap();
    assert!(apart(&input.radiance, &host, 1.0) < 1e-6);
    assert!((input.radiance[2 * 20 + 4][0] - 2.0).abs() < 1e-6 && input.radiance[2 * 20 + 14][0] == 9.0);
    assert_eq!((removed.pixels, removed.radiance[1].round()), (1, 7.0));
    assert!((removed.share - 7.0 / (120.0 + 4.0 * 8.0)).abs() < 1e-6, "{removed:?}");
    assert_eq!(firefly::removed(&before.radiance, &before.radiance).pixels, 0, "control: nothing was cut");
    assert!(firefly::remove_fireflies(&gpu, &mut input, 0.5).is_err());

    let mut noisy = Picture::new(33, 18).noisy().input;
    let host = firefly::reference(&noisy, 1.5);
    assert!(firefly::remove_fireflies(&gpu, &mut noisy, 1.5).unwrap().pixels > 3);
    assert!(apart(&noisy.radiance, &host, 1e-3) < 1e-5);
    assert_silent(&gpu);
}
