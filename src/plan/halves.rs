//! Errors without a reference: two images of the same expectation that share no random numbers tell how far each is from it.
use crate::image::metrics::RELMSE_EPSILON;
use rayon::prelude::*;

/// An image's pixels, linear radiance.
pub type Pixels = [[f32; 3]];

/// Pixels to each side that the surroundings of a pixel reach.
const REACH: usize = 2;

/// What squared errors are divided by: the square of the radiance, plus relMSE's constant. The radiance is the mean of both images, moved
/// towards that of the 5 x 5 pixels around by the share that noise has in the variance among these (Lee 1980): unmoved, a bright outlier
/// would divide its own error, and moved wholly, a dark pixel beside a lamp would count for nothing. In a picture of small
/// lamps out of focus, 4 to 32 samples tell 0.8 to 1.1 of the true error. `noisy` are unfiltered images of the same: where the product
/// of both, which is the square of the radiance on average, says more, it counts. A filter that takes a lamp of a pixel or two for noise
/// would leave the error of that lamp to be divided by what is around it.
pub fn scales(width: usize, [a, b]: [&Pixels; 2], noisy: [&Pixels; 2]) -> Vec<[f64; 3]> {
    let height = a.len() / width.max(1);
    let scale = |i: usize| {
        let (x, y) = (i % width, i / width);
        let columns = x.saturating_sub(REACH)..(x + REACH + 1).min(width);
        let rows = y.saturating_sub(REACH)..(y + REACH + 1).min(height);
        let count = (columns.len() * rows.len()) as f64;
        let around = || rows.clone().flat_map(|row| columns.clone().map(move |x| row * width + x));
        [0, 1, 2].map(|c| {
            let halves = |j: usize| [a, b].map(|image| f64::from(image[j][c]));
            let [mean, square, noise] = around().map(halves).fold([0.0; 3], |sum, [a, b]| {
                let (mean, off) = (0.5 * (a + b), 0.5 * (a - b));
                [sum[0] + mean / count, sum[1] + mean * mean / count, sum[2] + off * off / count]
            });
            let variance = (square - mean * mean).max(f64::MIN_POSITIVE);
            let [a, b] = halves(i);
            let own = 0.5 * (a + b);
            let moved = (own + (noise / variance).min(1.0) * (mean - own)).powi(2);
            let product: f64 = noisy.iter().map(|image| f64::from(image[i][c])).product();
            moved.max(product) + RELMSE_EPSILON
        })
    };
    (0..a.len()).into_par_iter().map(scale).collect()
}

/// Relative mean square error of either of two unbiased images: half the square of their difference.
pub fn error([a, b]: [&Pixels; 2], scales: &[[f64; 3]]) -> f64 {
    mean(scales, |i, c| 0.5 * (f64::from(a[i][c]) - f64::from(b[i][c])).powi(2))
}

/// Relative mean square error of either of two filtered images, whose bias counts too. A filtered image `f_a` and the unfiltered one
/// `b` of the other half share no noise, so that `E[f_a b] = E[f_a] r` for the true radiance `r`, and
/// `E[(f_a - r)^2] = E[f_a^2] - 2 E[f_a b] + E[a b]`. Bright outliers of `a` and `b` enter by themselves, not squared. That may come out
/// as less than the variance of the filtered images, or than nothing, which no error is.
pub fn error_of_filtered([fa, fb]: [&Pixels; 2], [a, b]: [&Pixels; 2], scales: &[[f64; 3]]) -> f64 {
    let unbiased = mean(scales, |i, c| {
        let [fa, fb, a, b] = [fa, fb, a, b].map(|image| f64::from(image[i][c]));
        0.5 * (fa * fa + fb * fb) - fa * b - fb * a + a * b
    });
    unbiased.max(error([fa, fb], scales))
}

fn mean(scales: &[[f64; 3]], square: impl Fn(usize, usize) -> f64) -> f64 {
    let sum: f64 =
        (0..scales.len()).flat_map(|i| (0..3).map(move |c| (i, c))).map(|(i, c)| square(i, c) / scales[i][c]).sum();
    sum / (3 * scales.len()).max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(values: &[f32]) -> Vec<[f32; 3]> {
        values.iter().map(|&v| [v; 3]).collect()
    }

    #[test]
    fn a_worked_example() {
        // Two pixels of true radiance 1: noise of +-1, and a filter that halves it and darkens by .2.
        let (a, b) = (image(&[2.0, 0.0]), image(&[0.0, 2.0]));
        let (fa, fb) = (image(&[1.3, 0.3]), image(&[0.3, 1.3]));
        let scales = scales(2, [&a, &b], [&a, &b]);
        assert!((scales[0][0] - 1.01).abs() < 1e-12);
        assert!((error([&a, &b], &scales) - 2.0 / 1.01).abs() < 1e-9);
        // The means of the filtered pixels are .8.
        let of_filtered = super::scales(2, [&fa, &fb], [&a, &b]);
        assert!(of_filtered.iter().flatten().all(|scale| (scale - (0.64 + RELMSE_EPSILON)).abs() < 1e-6));
        // By hand: (1.69 + .09) / 2 - 0 - .3 * 2 + 0 and the same of the other pixel.
        let found = error_of_filtered([&fa, &fb], [&a, &b], &scales);
        // Which is (.89 - .6) / 1.01, and by chance less than the variance, .5 / 1.01.
        assert!((found - 0.5 / 1.01).abs() < 1e-6, "{found}");
        let (fa, fb) = (image(&[0.9, 0.7]), image(&[0.7, 0.9]));
        // (.81 + .49) / 2 - 0 - .7 * 2 and the same of the other pixel, which is less than nothing, against .02.
        let found = error_of_filtered([&fa, &fb], [&a, &b], &scales);
        assert!((found - 0.02 / 1.01).abs() < 1e-6, "{found}");
    }

    #[test]
    fn rare_bright_samples_do_not_hide_their_error() {
        // A lamp out of focus, which every hundredth of 8 samples finds.
        let (size, lamp, odds, samples) = (100, 80.0, 0.01, 8);
        let mut random = fastrand::Rng::with_seed(5);
        let mut pixel = || (0..samples).filter(|_| random.f32() < odds).count() as f32 * lamp / samples as f32;
        let [a, b] = [(), ()].map(|()| image(&(0..size * size).map(|_| pixel()).collect::<Vec<_>>()));
        let (truth, variance) = (f64::from(lamp * odds), f64::from(lamp * lamp * odds * (1.0 - odds)));
        let relative = variance / samples as f64 / (truth * truth + RELMSE_EPSILON);
        let found = error([&a, &b], &scales(size, [&a, &b], [&a, &b])) / relative;
        assert!((0.5..2.0).contains(&found), "{found} of the true error");
    }

    /// One pixel of 20 in a row of black, whose noise is 5 and which a filter cuts to .3.
    #[test]
    fn the_error_of_a_small_lamp_is_relative_to_it() {
        let row = |value: f32| image(&[0.0, 0.0, value, 0.0, 0.0]);
        let ([a, b], [fa, fb]) = ([row(25.0), row(15.0)], [row(0.3), row(0.3)]);
        let scales = scales(5, [&fa, &fb], [&a, &b]);
        let found = error([&a, &b], &scales);
        assert!((found - 50.0 / (375.0 + RELMSE_EPSILON) / 5.0).abs() < 1e-6, "{found}");
        // Control: one that only one image shows is an outlier, and hides no error of its own.
        let [one, none] = [row(25.0), row(0.0)];
        assert!(error([&one, &none], &super::scales(5, [&fa, &fb], [&one, &none])) > 500.0);
    }

    #[test]
    fn estimates_are_those_of_the_true_radiance() {
        let mut random = fastrand::Rng::with_seed(5);
        let (truth, size) = (0.7f32, 200);
        let mut noisy = || image(&(0..size * size).map(|_| truth + 2.0 * (random.f32() - 0.5)).collect::<Vec<_>>());
        let (a, b) = (noisy(), noisy());
        // The mean of 4 x 4 blocks, a tenth too bright.
        let filter = |image: &[[f32; 3]]| -> Vec<[f32; 3]> {
            let block = |i: usize| (i / size / 4 * 4, i % size / 4 * 4);
            let value = |i: usize| {
                let (y, x) = block(i);
                let sum: f32 = (0..16).map(|k| image[(y + k / 4) * size + x + k % 4][0]).sum();
                [1.1 * sum / 16.0; 3]
            };
            (0..image.len()).map(value).collect()
        };
        let (fa, fb) = (filter(&a), filter(&b));
        let scales = vec![[1.0; 3]; a.len()];
        let true_error = |image: &[[f32; 3]]| image.iter().map(|p| f64::from(p[0] - truth).powi(2)).sum::<f64>() / 4e4;
        let (of_noise, of_filter) = (error([&a, &b], &scales), error_of_filtered([&fa, &fb], [&a, &b], &scales));
        assert!((of_noise / true_error(&a) - 1.0).abs() < 0.03, "{of_noise}");
        assert!((of_filter / true_error(&fa) - 1.0).abs() < 0.1, "{of_filter} {}", true_error(&fa));
        // Control: images that share their noise look free of error.
        assert!(error([&a, &a], &scales) == 0.0);
    }
}
