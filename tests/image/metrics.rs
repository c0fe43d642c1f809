//! Metrics against values derived by hand and by other programs.
use tallow::image::Picture;
use tallow::image::difference::{WIDER, heat_map};
use tallow::image::metrics::{Metrics, compare};
use tallow::math::srgb::{linear_from_srgb, srgb_from_linear};

fn picture(width: u32, height: u32, pixel: impl Fn(u32, u32) -> [f32; 3]) -> Picture {
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect();
    Picture { width, height, pixels }
}

fn constant(size: u32, value: f32) -> Picture {
    picture(size, size, |_, _| [value; 3])
}

#[track_caller]
fn close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance, "{value} is not {expected} within {tolerance}");
}

#[test]
fn mse_and_relmse_of_one_pixel() {
    let (test, reference) = (picture(1, 1, |_, _| [1.0, 0.0, 0.25]), picture(1, 1, |_, _| [0.5, 0.0, 1.0]));
    let metrics = compare(&test, &reference);
    // (0.25 + 0 + 0.5625) / 3, and (0.25 / 0.26 + 0 + 0.5625 / 1.01) / 3.
    close(metrics.mse, 0.270_833_333, 1e-9);
    close(metrics.relmse, 0.506_156_4, 1e-6);
    assert_eq!(metrics.ssim, None, "smaller than the window");
    // Control: with the roles swapped the denominator is another.
    close(compare(&reference, &test).relmse, (0.25 / 1.01 + 0.5625 / 0.0725) / 3.0, 1e-6);
}

#[test]
fn psnr_has_peak_1_on_srgb_values() {
    // Code values 0 and 0.5 everywhere: MSE 0.25, so 10 log10(4).
    close(compare(&constant(4, linear_from_srgb(0.5)), &constant(4, 0.0)).psnr, 6.020_600, 1e-4);
    // Control: on linear values, 0.214 against 0, it would be 13.4 dB. Above white nothing shows.
    close(compare(&constant(4, 9.0), &constant(4, 0.0)).psnr, 0.0, 1e-5);
    assert_eq!(compare(&constant(4, 0.3), &constant(4, 0.3)).psnr, f64::INFINITY);
}

#[test]
fn srgb_curve_and_its_inverse() {
    close(srgb_from_linear(0.18).into(), 0.461_356, 1e-5);
    close(srgb_from_linear(0.001).into(), 0.012_92, 1e-7);
    for i in 0..=255 {
        let code = i as f32 / 255.0;
        close(srgb_from_linear(linear_from_srgb(code)).into(), code.into(), 1e-5);
    }
}

#[test]
fn ssim_of_flat_pictures_is_its_luminance_term() {
    // Means 0.5 and 0.25, no variance: (2 * 0.125 + 1e-4) / (0.25 + 0.0625 + 1e-4).
    let metrics = compare(&constant(12, linear_from_srgb(0.5)), &constant(12, linear_from_srgb(0.25)));
    close(metrics.ssim.unwrap(), 0.2501 / 0.3126, 1e-4);
}

/// A pattern and a version of it that is darker and disturbed.
fn pattern() -> Metrics {
    let reference = |x: u32, y: u32| {
        let base = ((x * 7 + y * 13) % 31) as f32 / 31.0;
        [base, base * base, 1.0 - base]
    };
    let disturbed = |x: u32, y: u32| reference(x, y).map(|v| v * 0.9 + 0.05 * (((x * 5 + y * 3) % 7) as f32 / 7.0));
    compare(&picture(32, 24, disturbed), &picture(32, 24, reference))
}

#[test]
fn ssim_is_that_of_scikit_image() {
    // scikit-image with gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1, channel_axis=-1.
    close(pattern().ssim.unwrap(), 0.986_442_85, 2e-5);
    // Control: the tolerance tells it from the uniform 7x7 window that is scikit-image's default.
    assert!((0.986_342_31_f64 - 0.986_442_85).abs() > 2e-5);
}

#[test]
fn flip_is_that_of_the_reference_implementation() {
    // flip-evaluator 1.7, LDR, on the same pictures rounded to 8 bits; unrounded it says 0.12140.
    close(pattern().flip, 0.122_978, 1e-4);
    assert_eq!(compare(&constant(16, 0.4), &constant(16, 0.4)).flip, 0.0);
    assert!(compare(&constant(16, 0.0), &constant(16, 1.0)).flip > 0.9);
}

#[test]
fn a_picture_of_planes_is_weighed_if_its_pixels_are_numbers() {
    let planes = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]];
    let of = |planes: [[f32; 2]; 3]| Picture::of_planes([2, 1], &planes.map(Vec::from)).finite();
    assert_eq!(of(planes), Ok(picture(2, 1, |x, _| planes.map(|plane| plane[x as usize]))));
    let refused = of([planes[0], [f32::NAN, f32::INFINITY], planes[2]]).unwrap_err();
    assert!(refused.starts_with("2 of 2 pixels are NaN or infinite"), "{refused}");
}

#[test]
fn the_heat_map_shows_where_and_says_how_much() {
    let test = picture(3, 2, |x, y| if (x, y) == (1, 1) { [0.0, 0.3, 0.6] } else { [0.0; 3] });
    let (map, top) = heat_map(&test, &picture(3, 2, |_, _| [0.0; 3]));
    close(top.into(), 0.3, 1e-6);
    assert_eq!((map.width, map.height), (3 + WIDER, 2));
    let (row, pale) = (map.width as usize, map.pixels[map.width as usize - 1]);
    let brightness = |p: [f32; 3]| p[0] + p[1] + p[2];
    let brightest = (0..map.pixels.len())
        .filter(|i| i % row < 3)
        .max_by(|&i, &j| brightness(map.pixels[i]).total_cmp(&brightness(map.pixels[j])));
    assert_eq!(brightest, Some(row + 1), "the pixel that differs");
    assert_eq!(map.pixels[row + 1], pale, "which is at the top of the scale");
    assert!(brightness(map.pixels[0]) < 0.01, "no difference is black");
    // Nothing differs: all black, scale 0 to 1.
    let (map, top) = heat_map(&test, &test);
    assert!(top == 1.0 && brightness(map.pixels[row + 1]) < 0.01);
}
