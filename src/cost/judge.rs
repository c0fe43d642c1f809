//! Errors of an image against a reference whose own noise may be known.
use super::document::Errors;
use crate::image::Picture;
use crate::image::metrics::{self, Metrics};

/// Share of the pixels that the trimmed relMSE leaves out.
const TRIMMED: f64 = 0.001;
/// Squared relative error above which a pixel is an outlier.
const OUTLIER: f64 = 1.0;

/// The expected error of a reference itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Noise {
    /// Expected MSE between the reference and the true image.
    pub mse: f64,
    /// Expected relMSE between the reference and the true image.
    pub relmse: f64,
}

/// Judges a finite image. The noise of the reference is independent of the image's, so both add up in MSE and relMSE: `noise` is
/// subtracted from them, and they end at 0.
///
/// # Panics
/// When the sizes differ.
pub fn judge(image: &Picture, reference: &Picture, noise: Noise) -> Errors<f64> {
    let Metrics { mse, psnr, ssim, flip, .. } = metrics::compare(image, reference);
    let squares = metrics::relative_squares(image, reference);
    let pixels = squares.len().max(1) as f64;
    let relmse = squares.iter().sum::<f64>() / pixels;
    let outliers = squares.iter().filter(|&&square| square > OUTLIER).count() as f64 / pixels;
    let all = [
        Some((mse - noise.mse).max(0.0)),
        Some((relmse - noise.relmse).max(0.0)),
        Some(metrics::trimmed_mean(squares, TRIMMED)),
        Some(psnr),
        ssim,
        Some(flip),
        metrics::hdr_flip(image, reference),
        Some(outliers),
    ];
    Errors::from_values(all.map(|value| value.filter(|v: &f64| v.is_finite())))
}
