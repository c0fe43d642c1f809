//! Measures the difference between two images of the same scene beyond the noise of both.
use anyhow::{Context, anyhow, ensure};
use image::codecs::png::PngEncoder;
use std::fs::File;
use std::path::Path;
use tallow::image::{Film, Picture, WriteOptions};

/// The measures of the difference between an image and its reference.
#[derive(Debug)]
pub struct Comparison {
    /// Image mean over reference mean, per channel.
    pub ratio: [f64; 3],
    /// Median over pixels of image over reference, where the reference is brighter than a thousandth of its mean.
    pub median: f64,
    /// Root mean square over blocks of the relative difference of their means, beyond what noise explains. A misplaced
    /// shadow, a mirrored texture or a wrong lobe shows here even when the image means agree.
    pub structure: f64,
    /// Mean absolute difference of the absolute values per pixel and channel.
    pub absolute: f64,
}

/// Reads three channels of an image file by name.
///
/// # Errors
/// When the file cannot be read, a channel is missing, or a value is not finite.
pub fn read(path: &Path, channels: [&str; 3]) -> anyhow::Result<Picture> {
    let film = tallow::image::read(path)?;
    let planes = channels.map(|name| film.channel(name).map(|samples| samples.to_f32().into_owned()));
    let [Some(r), Some(g), Some(b)] = planes else {
        anyhow::bail!("{}: the channels {} are not all there", path.display(), channels.join(", "));
    };
    let picture = Picture::of_planes(film.size(), &[r, g, b]);
    picture.finite().map_err(|what| anyhow!("{}: {what}", path.display()))
}

/// Mean of the three channels, all of which count alike.
fn grey(rgb: [f32; 3]) -> f64 {
    rgb.iter().map(|&v| f64::from(v)).sum::<f64>() / 3.0
}

fn mean(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let count = values.len().max(1) as f64;
    values.sum::<f64>() / count
}

/// Computes all measures of a comparison.
///
/// # Errors
/// When the sizes differ.
pub fn compare(image: &Picture, reference: &Picture) -> anyhow::Result<Comparison> {
    let (size, wanted) = ((image.width, image.height), (reference.width, reference.height));
    ensure!(size == wanted, "the image is {} x {}, the reference {} x {}", size.0, size.1, wanted.0, wanted.1);
    let channel = |p: &Picture, c: usize| mean(p.pixels.iter().map(|v| f64::from(v[c])));
    // Two black images agree.
    let ratio = |a: f64, b: f64| if a == b { 1.0 } else { a / b };
    let absolute = image.pixels.iter().flatten().zip(reference.pixels.iter().flatten());
    Ok(Comparison {
        ratio: std::array::from_fn(|c| ratio(channel(image, c), channel(reference, c))),
        median: median_ratio(image, reference),
        structure: structure(image, reference),
        absolute: absolute.map(|(a, b)| f64::from((a.abs() - b.abs()).abs())).sum::<f64>()
            / (3 * image.pixels.len()) as f64,
    })
}

fn median_ratio(image: &Picture, reference: &Picture) -> f64 {
    let floor = 1e-3 * mean(reference.pixels.iter().map(|&v| grey(v)));
    let pairs = image.pixels.iter().zip(&reference.pixels).map(|(&a, &b)| (grey(a), grey(b)));
    let mut ratios: Vec<f64> = pairs.filter(|&(_, b)| b > floor).map(|(a, b)| a / b).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
}

/// Returns the image minus the reference.
pub fn difference(image: &Picture, reference: &Picture) -> Picture {
    let pairs = image.pixels.iter().zip(&reference.pixels);
    let pixels = pairs.map(|(a, b)| std::array::from_fn(|c| a[c] - b[c])).collect();
    Picture { pixels, ..*image }
}

/// A block's mean difference d has variance v / n from noise alone, v being the variance of the pixels inside; over all
/// blocks, mean(d^2) - mean(v / n) is what noise does not explain. Differences are relative to the block's own mean, and
/// to the image's in darker blocks: else the rim of one bright light would outweigh the picture.
fn structure(image: &Picture, reference: &Picture) -> f64 {
    let floor = mean(reference.pixels.iter().map(|&v| grey(v)));
    let grey_blocks = |p: &Picture| blocks(p, |i| grey(p.pixels[i]));
    let (differences, references) = (grey_blocks(&difference(image, reference)), grey_blocks(reference));
    let excess = differences.iter().zip(&references).map(|(block, wanted)| {
        let (n, d) = (block.len() as f64, mean(block.iter().copied()));
        let variance = block.iter().map(|v| (v - d).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        (d * d - variance / n) / mean(wanted.iter().copied()).max(floor).powi(2)
    });
    mean(excess).max(0.0).sqrt()
}

/// Calls `of_pixel` for every pixel and groups the results by square blocks. There are about 32 blocks along the shorter
/// side, of at least 16 pixels each except at the right and lower edges.
pub fn blocks<T>(picture: &Picture, of_pixel: impl Fn(usize) -> T) -> Vec<Vec<T>> {
    let [width, height] = picture.size().map(|n| n as usize);
    let edge = (width.min(height) / 32).clamp(4, 32);
    let columns = width.div_ceil(edge);
    let mut blocks: Vec<_> = (0..columns * height.div_ceil(edge)).map(|_| Vec::new()).collect();
    for i in 0..picture.pixels.len() {
        let (x, y) = (i % width, i / width);
        blocks[y / edge * columns + x / edge].push(of_pixel(i));
    }
    blocks
}

/// Writes the difference as `STEM.exr` and as `STEM.png`. In the latter, middle grey means agreement, and black and white
/// mean a difference of the reference's mean or more.
pub fn write_difference(difference: &Picture, reference: &Picture, stem: &Path) -> anyhow::Result<()> {
    tallow::image::write(&stem.with_extension("exr"), &Film::from(difference), &WriteOptions::default())?;
    let scale = 0.5 / mean(reference.pixels.iter().map(|&v| grey(v))).max(f64::MIN_POSITIVE);
    let byte = |v: f32| ((0.5 + f64::from(v) * scale).clamp(0.0, 1.0) * 255.0).round() as u8;
    let bytes = difference.pixels.iter().flatten().map(|&v| byte(v)).collect();
    let png =
        image::RgbImage::from_raw(difference.width, difference.height, bytes).context("three values per pixel")?;
    let path = stem.with_extension("png");
    let file = File::create(&path).with_context(|| format!("{}", path.display()))?;
    png.write_with_encoder(PngEncoder::new(file)).with_context(|| format!("{}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A horizontal ramp with independent noise.
    fn ramp(seed: u32, noise: f32, brightness: f32) -> Picture {
        let random = |i: u32| {
            let h = (i ^ seed.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x85eb_ca6b);
            let h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
            (h >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let pixel = |i: u32| [brightness * ((i % 128) as f32 / 127.0 + 0.1) + noise * random(i); 3];
        Picture { width: 128, height: 128, pixels: (0..128 * 128).map(pixel).collect() }
    }

    #[test]
    fn noise_alone_passes() {
        let c = compare(&ramp(1, 0.3, 1.0), &ramp(2, 0.3, 1.0)).unwrap();
        assert!(c.ratio.iter().all(|r| (r - 1.0).abs() < 5e-3) && c.structure < 5e-3, "{c:?}");
    }

    #[test]
    fn faults_show() {
        let reference = ramp(2, 0.3, 1.0);
        let brighter = compare(&ramp(1, 0.3, 1.02), &reference).unwrap();
        assert!((brighter.ratio[0] - 1.02).abs() < 5e-3 && (brighter.median - 1.02).abs() < 1e-2, "{brighter:?}");
        // Mirrored left to right: every mean agrees, nothing is in its place.
        let mut mirrored = ramp(1, 0.3, 1.0);
        mirrored.pixels.chunks_mut(128).for_each(<[_]>::reverse);
        let mirrored = compare(&mirrored, &reference).unwrap();
        assert!((mirrored.ratio[0] - 1.0).abs() < 5e-3 && mirrored.structure > 0.5, "{mirrored:?}");
        let small = Picture { width: 64, height: 256, pixels: reference.pixels.clone() };
        assert!(compare(&small, &reference).is_err());
    }
}
