//! Tests whether an image differs from its reference by more than the noise of both. This needs a file with the noise of
//! the reference.
use crate::compare;
use crate::statistics::sidak_quantile;
use anyhow::{Context, ensure};
use std::path::Path;
use tallow::image::Picture;

/// Matrix from linear Rec. 709 to CIE XYZ. Mitsuba computes variances in XYZ and converts them to RGB like colours, so
/// they are variances only after they are converted back. All tests are made in XYZ.
const XYZ_FROM_RGB: [[f64; 3]; 3] =
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]];

/// Samples per pixel of the references of Mitsuba's tests, from the default of the script that renders them. (For the two
/// that Mitsuba 3.9.1 reproduces best, the residuals suggest 31,800 and 35,800.)
const MITSUBA_SPP: f64 = 32_000.0;

/// Relative differences up to this are accepted, because Mitsuba 2 converted colours with such an error (its white sky is
/// 1.0011 0.9997 0.9997).
pub const COLOUR: f64 = 5e-4;

/// Squared standard errors per pixel, in XYZ.
pub type Errors = Vec<[f64; 3]>;

/// The differences in standard errors beyond the known difference, with the limits that chance explains (by Sidak: with
/// noise alone, all channels, or all blocks and channels, together fail once in a hundred times).
#[derive(Debug)]
pub struct Significance {
    /// Difference of the image's mean, the largest of the three channels.
    pub mean: f64,
    pub mean_limit: f64,
    /// Difference of the means of blocks, the largest of all blocks and channels.
    pub block: f64,
    pub block_limit: f64,
}

impl Significance {
    pub fn passes(&self) -> bool {
        self.mean <= self.mean_limit && self.block <= self.block_limit
    }
}

fn xyz(rgb: [f64; 3]) -> [f64; 3] {
    XYZ_FROM_RGB.map(|row| (0..3).map(|c| row[c] * rgb[c]).sum())
}

/// Reads the noise of a reference: `STEM_se.exr` holds standard errors, `STEM_var.exr` the variances of samples.
///
/// # Errors
/// When the file exists but cannot be read.
pub fn of_reference(path: &Path) -> anyhow::Result<Option<Errors>> {
    let stem = path.file_stem().context("a file")?.to_string_lossy();
    let beside = |suffix: &str| Some(path.with_file_name(format!("{stem}{suffix}.exr"))).filter(|p| p.is_file());
    let variance = |v: [f64; 3]| xyz(v).map(|v| v.max(0.0) / MITSUBA_SPP);
    match (beside("_se"), beside("_var")) {
        (Some(file), _) => read(&file, ["R", "G", "B"], together).map(Some),
        (None, Some(file)) => read(&file, ["R", "G", "B"], variance).map(Some),
        (None, None) => Ok(None),
    }
}

/// Reads the noise of a render from its variance layer. With low-discrepancy points the actual error is smaller.
///
/// # Errors
/// When the layer cannot be read.
pub fn of_render(path: &Path) -> anyhow::Result<Errors> {
    read(path, ["variance.R", "variance.G", "variance.B"], |v| together(v.map(f64::sqrt)))
}

fn read(path: &Path, channels: [&str; 3], error2: impl Fn([f64; 3]) -> [f64; 3]) -> anyhow::Result<Errors> {
    Ok(compare::read(path, channels)?.pixels.into_iter().map(|v| error2(v.map(f64::from))).collect())
}

/// Squared standard errors in XYZ from standard errors in RGB. The correlation of the channels is unknown, so full
/// correlation is assumed, which is the worst case.
fn together(errors: [f64; 3]) -> [f64; 3] {
    xyz(errors).map(|e| e * e)
}

/// Tests an image against a reference, given the noise of both. `known` is the difference of the image and of each block
/// that has a known reason, relative to its mean or, in darker blocks, to the mean of the image.
///
/// # Errors
/// When the sizes differ.
pub fn test(image: &Picture, reference: &Picture, errors: [&Errors; 2], known: f64) -> anyhow::Result<Significance> {
    let same = errors.iter().all(|e| e.len() == image.pixels.len()) && image.pixels.len() == reference.pixels.len();
    ensure!(same, "the errors are those of an image of another size");
    let pixels: Vec<Pixel> = (0..image.pixels.len())
        .map(|i| {
            let [a, b] = [image, reference].map(|p| xyz(p.pixels[i].map(f64::from)));
            let both = std::array::from_fn(|c| errors[0][i][c] + errors[1][i][c]);
            Pixel { difference: std::array::from_fn(|c| a[c] - b[c]), reference: b, error2: both }
        })
        .collect();
    let blocks = compare::blocks(image, |i| pixels[i]);
    let floor = |c: usize| pixels.iter().map(|p| p.reference[c]).sum::<f64>() / pixels.len() as f64;
    let floors = [0, 1, 2].map(floor);
    let largest = |of: &[Pixel]| (0..3).map(|c| excess(of, c, known, floors[c])).fold(0.0, f64::max);
    Ok(Significance {
        mean: largest(&pixels),
        mean_limit: sidak_quantile(3),
        block: blocks.iter().map(|block| largest(block)).fold(0.0, f64::max),
        block_limit: sidak_quantile(3 * blocks.len()),
    })
}

#[derive(Clone, Copy)]
struct Pixel {
    difference: [f64; 3],
    reference: [f64; 3],
    error2: [f64; 3],
}

/// The difference between the means of a channel over some pixels, less the known difference, in standard errors.
fn excess(pixels: &[Pixel], c: usize, known: f64, floor: f64) -> f64 {
    let sum = |of: fn(&Pixel) -> [f64; 3]| pixels.iter().map(|p| of(p)[c]).sum::<f64>();
    let beyond = sum(|p| p.difference).abs() - known * sum(|p| p.reference).max(floor * pixels.len() as f64);
    if beyond <= 0.0 { 0.0 } else { beyond / sum(|p| p.error2).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Grey 0.5 with noise of standard error 0.01 in every pixel, all channels alike.
    fn noisy(seed: u64) -> (Picture, Errors) {
        let mut random = fastrand::Rng::with_seed(seed);
        // Uniform noise of width w has standard deviation w / sqrt 12.
        let pixels = (0..64 * 64).map(|_| [0.5 + 0.01 * 12f32.sqrt() * (random.f32() - 0.5); 3]).collect();
        (Picture { width: 64, height: 64, pixels }, vec![together([0.01; 3]); 64 * 64])
    }

    #[test]
    fn noise_passes_and_faults_do_not() {
        let ((mut image, error), (reference, of_reference)) = (noisy(1), noisy(2));
        let errors = [&error, &of_reference];
        let test = |image: &Picture, known| test(image, &reference, errors, known).unwrap();
        let found = test(&image, 0.0);
        assert!(found.passes() && found.block > 1.5, "{found:?}");
        // A block of 4 x 4 has a standard error of 0.01 sqrt(2) / 4 = 0.0035; 0.03 is 8 of them.
        (0..16).for_each(|i| image.pixels[64 * (20 + i / 4) + 20 + i % 4][1] += 0.03);
        let spot = test(&image, 0.0);
        assert!(spot.mean <= spot.mean_limit && !spot.passes() && spot.block > 5.0, "{spot:?}");
        assert!(test(&image, 0.06).passes(), "as much is known");
        // The image's error is 0.01 sqrt(2) / 64 = 0.00022: 0.3 % of 0.5 are 7 of them, and less than 1 of a block's.
        let mut brighter = noisy(1).0;
        brighter.pixels.iter_mut().flatten().for_each(|v| *v *= 1.003);
        let brighter = test(&brighter, 0.0);
        assert!(brighter.mean > 5.0 && brighter.block <= brighter.block_limit, "{brighter:?}");
    }

    #[test]
    fn the_noise_of_references_is_found_beside_them() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, value: [f32; 3]| {
            let mut film = tallow::image::Film::new(1, 1);
            film.add_vec3("", ["R", "G", "B"], &[value]);
            tallow::image::write(&folder.path().join(name), &film, &Default::default()).unwrap();
        };
        let of = |name: &str| of_reference(&folder.path().join(name)).unwrap();
        assert!(of("a.exr").is_none());
        write("a_se.exr", [0.5; 3]);
        // White has Y = 1.
        assert!((of("a.exr").unwrap()[0][1] - 0.25).abs() < 1e-6);
        // A variance of 1 in Y alone: as a colour, red and blue are negative.
        write("b_var.exr", [-1.53715, 1.875991, -0.204043]);
        let [x, y, z] = of("b.exr").unwrap()[0].map(|v| v * MITSUBA_SPP);
        assert!(x.abs() < 1e-4 && (y - 1.0).abs() < 1e-4 && z.abs() < 1e-4, "{x} {y} {z}");
    }
}
