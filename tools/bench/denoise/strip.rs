//! Pictures side by side: noisy, filtered and converged, and below them the places where the first filter and the last one are
//! furthest off.
use std::path::Path;
use tallow::image::{self, Film, Picture, WriteOptions};

/// Gap between pictures in pixels.
const GAP: usize = 4;
/// So many times wider and higher is a picture than a detail of it, which is drawn as large.
const ZOOM: usize = 4;

/// Draws the columns noisy, filtered, reference.
pub fn draw(noisy: &Picture, filtered: &[&Picture], reference: &Picture) -> Picture {
    let columns: Vec<_> = [noisy].into_iter().chain(filtered.iter().copied()).chain([reference]).collect();
    let (width, height) = (reference.width as usize + GAP, reference.height as usize + GAP);
    let worst = [filtered.first(), filtered.last()].map(|p| p.map_or([0; 2], |p| worst_window(p, reference)));
    let [w, h] = [width * columns.len() - GAP, height * (1 + worst.len()) - GAP];
    let mut strip = Picture { width: w as u32, height: h as u32, pixels: vec![[1.0; 3]; w * h] };
    for (i, picture) in columns.into_iter().enumerate() {
        paste(&mut strip, picture, [i * width, 0], |at| at);
        for (k, [x, y]) in worst.into_iter().enumerate() {
            paste(&mut strip, picture, [i * width, (k + 1) * height], |[u, v]| [x + u / ZOOM, y + v / ZOOM]);
        }
    }
    strip
}

/// Fills a place as large as the picture with pixels of it.
fn paste(strip: &mut Picture, picture: &Picture, [left, top]: [usize; 2], from: impl Fn([usize; 2]) -> [usize; 2]) {
    let (width, height) = (picture.width as usize, picture.height as usize);
    for v in 0..height {
        for u in 0..width {
            let [x, y] = from([u, v]);
            strip.pixels[(top + v) * strip.width as usize + left + u] = picture.pixels[y * width + x];
        }
    }
}

/// Where the window lies whose relative error is largest.
fn worst_window(picture: &Picture, reference: &Picture) -> [usize; 2] {
    let [width, height] = [picture.width as usize, picture.height as usize];
    let [w, h] = [width.div_ceil(ZOOM), height.div_ceil(ZOOM)];
    // Compressed, so that a single lamp's edge does not outdo all else.
    let error = |i: usize| -> f32 {
        let (a, b) = (picture.pixels[i], reference.pixels[i]);
        (0..3).map(|c| ((a[c] - b[c]).abs() / (b[c].abs() + 0.1)).min(1.0)).sum()
    };
    let sum = |[x, y]: [usize; 2]| -> f32 { (0..w * h).map(|k| error((y + k / w) * width + x + k % w)).sum() };
    let steps = |edge: usize, window: usize| (0..=edge - window).step_by(window.div_ceil(4));
    let places = steps(height, h).flat_map(|y| steps(width, w).map(move |x| [x, y]));
    places.max_by(|a, b| sum(*a).total_cmp(&sum(*b))).unwrap_or([0; 2])
}

pub fn write(picture: &Picture, path: &Path) -> anyhow::Result<()> {
    Ok(image::write(path, &Film::from(picture), &WriteOptions::default())?)
}
