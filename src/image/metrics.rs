//! Metrics of the difference between a picture and its reference. Sums run over all pixels and channels in `f64`.
use super::film::Picture;
use crate::math::srgb::srgb_from_linear;
use crate::threads;
use serde::Serialize;

/// Added to the denominator of relMSE, so that black reference pixels do not divide by 0.
pub(crate) const RELMSE_EPSILON: f64 = 0.01;

/// Every metric of one comparison.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Metrics {
    /// Mean of `(a - b)^2`, linear.
    pub mse: f64,
    /// Mean of `(a - b)^2 / (b^2 + 0.01)`, linear; `b` is the reference.
    pub relmse: f64,
    /// `-10 log10(MSE)` in dB of the sRGB-encoded pictures clamped to [0, 1], so that the peak is 1; infinite if they are equal.
    pub psnr: f64,
    /// Mean structural similarity of the sRGB-encoded pictures; `None` if an edge is shorter than 11 pixels.
    pub ssim: Option<f64>,
    /// Mean FLIP error of the 8-bit sRGB pictures, 0 to 1.
    pub flip: f64,
}

/// Computes every metric of `test` against `reference`.
///
/// # Panics
/// When their sizes differ.
pub fn compare(test: &Picture, reference: &Picture) -> Metrics {
    let shown = [shown(test), shown(reference)];
    let others = || (mse(test, reference), relmse(test, reference), psnr_of(&shown), flip(&shown));
    // SSIM takes as long as all others together.
    let (ssim, (mse, relmse, psnr, flip)) = threads::within(|| rayon::join(|| ssim(&shown), others));
    Metrics { mse, relmse, psnr, ssim, flip }
}

/// Share of the pixels that differ while what is shown of them does not: both lie beyond 0 or 1, where PSNR, SSIM and FLIP see nothing.
///
/// # Panics
/// When their sizes differ.
pub fn unseen(test: &Picture, reference: &Picture) -> f64 {
    assert_eq!(test.size(), reference.size(), "pictures of one size");
    let beyond = |a: f32, b: f32| a == b || (a <= 0.0 && b <= 0.0) || (a >= 1.0 && b >= 1.0);
    let is_unseen = |(a, b): &(&[f32; 3], &[f32; 3])| a != b && (0..3).all(|c| beyond(a[c], b[c]));
    let count = test.pixels.iter().zip(&reference.pixels).filter(is_unseen).count();
    count as f64 / test.pixels.len().max(1) as f64
}

/// The picture as it is shown: sRGB-encoded and clamped to [0, 1].
fn shown(picture: &Picture) -> Picture {
    let pixels = picture.pixels.iter().map(|pixel| pixel.map(srgb_from_linear)).collect();
    Picture { pixels, ..*picture }
}

fn values(picture: &Picture) -> impl Iterator<Item = f32> + '_ {
    picture.pixels.iter().flatten().copied()
}

fn mean(test: &Picture, reference: &Picture, error: impl Fn(f64, f64) -> f64) -> f64 {
    assert_eq!(test.size(), reference.size(), "pictures of one size");
    let sum: f64 = values(test).zip(values(reference)).map(|(a, b)| error(a.into(), b.into())).sum();
    sum / (3 * test.pixels.len()) as f64
}

/// See [`Metrics::relmse`].
///
/// # Panics
/// When their sizes differ.
pub fn relmse(test: &Picture, reference: &Picture) -> f64 {
    mean(test, reference, |a, b| (a - b) * (a - b) / (b * b + RELMSE_EPSILON))
}

/// See [`Metrics::mse`].
///
/// # Panics
/// When their sizes differ.
pub fn mse(test: &Picture, reference: &Picture) -> f64 {
    mean(test, reference, |a, b| (a - b) * (a - b))
}

/// The contribution of every pixel to relMSE: its mean is [`Metrics::relmse`].
///
/// # Panics
/// When their sizes differ.
pub fn relative_squares(test: &Picture, reference: &Picture) -> Vec<f64> {
    assert_eq!(test.size(), reference.size(), "pictures of one size");
    let square = |a: f32, b: f32| {
        let (a, b) = (f64::from(a), f64::from(b));
        (a - b) * (a - b) / (b * b + RELMSE_EPSILON)
    };
    let pixel = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| square(a[c], b[c])).sum::<f64>() / 3.0;
    test.pixels.iter().zip(&reference.pixels).map(pixel).collect()
}

/// Mean of the values without the largest ones, of which there are `share` times their number, rounded down; 0 where none is left.
pub fn trimmed_mean(mut values: Vec<f64>, share: f64) -> f64 {
    let kept = values.len().saturating_sub((share * values.len() as f64) as usize);
    if kept == 0 {
        return 0.0;
    }
    values.select_nth_unstable_by(kept - 1, f64::total_cmp);
    values[..kept].iter().sum::<f64>() / kept as f64
}

/// Expected relMSE between a reference and the true image, from the squared standard error of each of its pixels.
///
/// # Panics
/// When there is not one variance per pixel.
pub fn relative_noise(reference: &Picture, variance: &[[f32; 3]]) -> f64 {
    assert_eq!(reference.pixels.len(), variance.len(), "one variance per pixel");
    let relative = |(v, b): (&f32, f32)| f64::from(*v) / (f64::from(b).powi(2) + RELMSE_EPSILON);
    variance.iter().flatten().zip(values(reference)).map(relative).sum::<f64>() / (3 * variance.len()) as f64
}

/// Mean HDR-FLIP error (Andersson et al. 2021, "Visualizing Errors in Rendered High Dynamic Range Images"): the largest FLIP
/// error of every pixel over exposures that suit the reference. `None` where no exposure does: the reference is black.
///
/// # Panics
/// When their sizes differ.
pub fn hdr_flip(test: &Picture, reference: &Picture) -> Option<f64> {
    assert_eq!(test.size(), reference.size(), "pictures of one size");
    let image = |p: &Picture| flip_rs::RgbImage::new(p.width as usize, p.height as usize, values(p).collect()).ok();
    let mut options = flip_rs::HdrOptions::default();
    options.return_exposure_map = false;
    let result = flip_rs::hdr_flip(&image(reference)?, &image(test)?, options).ok()?;
    let map = result.error_map.pixels();
    Some(map.iter().map(|&e| f64::from(e)).sum::<f64>() / map.len() as f64)
}

/// See [`Metrics::psnr`].
///
/// # Panics
/// When their sizes differ.
pub fn psnr(test: &Picture, reference: &Picture) -> f64 {
    psnr_of(&[shown(test), shown(reference)])
}

fn psnr_of([test, reference]: &[Picture; 2]) -> f64 {
    -10.0 * mean(test, reference, |a, b| (a - b).powi(2)).log10()
}

/// SSIM (Wang, Bovik, Sheikh and Simoncelli 2004) with a Gaussian window of 11x11 pixels and standard deviation 1.5,
/// K1 = 0.01, K2 = 0.03, averaged over all windows inside the picture and over R, G, B. scikit-image returns the same with
/// `gaussian_weights=True, sigma=1.5, use_sample_covariance=False`.
fn ssim([test, reference]: &[Picture; 2]) -> Option<f64> {
    let codes = |p: &Picture| values(p).map(|v| (v * 65_535.0).round() as u16).collect();
    let image = |p: &Picture| iqa::Image::srgb16(p.width, p.height, codes(p));
    // The only remaining error of the crate is a picture smaller than the window.
    iqa::ssim(&image(reference).ok()?, &image(test).ok()?, iqa::SsimOptions::default()).ok()
}

/// FLIP (Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating Images") at its default of 67 pixels per
/// degree, a 4K screen of 0.7 m width seen from 0.7 m.
fn flip([test, reference]: &[Picture; 2]) -> f64 {
    let codes = |p: &Picture| -> Vec<u8> { values(p).map(|v| (v * 255.0).round() as u8).collect() };
    let image = |p: &Picture| nv_flip::FlipImageRgb8::with_data(p.width, p.height, &codes(p));
    let map = nv_flip::flip(image(reference), image(test), nv_flip::DEFAULT_PIXELS_PER_DEGREE).to_vec();
    map.iter().map(|&e| f64::from(e)).sum::<f64>() / map.len() as f64
}
