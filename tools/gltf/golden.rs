//! The published pictures: WebP files with alpha.
use crate::display::Shown;
use anyhow::Context;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// Reads the pictures of a folder, which may be missing, by the names of their engines. Those of another shape are left out.
///
/// # Errors
/// When one cannot be decoded.
pub fn read(folder: &Path, size: [u32; 2]) -> anyhow::Result<Vec<(String, Shown)>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry?.path();
        let engine = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let picture = one(&path, size).with_context(|| path.display().to_string())?;
        found.extend(picture.map(|picture| (engine, picture)));
    }
    found.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(found)
}

fn one(path: &Path, size: [u32; 2]) -> anyhow::Result<Option<Shown>> {
    let mut decoder = image_webp::WebPDecoder::new(BufReader::new(File::open(path)?))?;
    let (width, height) = decoder.dimensions();
    let channels = if decoder.has_alpha() { 4 } else { 3 };
    let mut bytes = vec![0; decoder.output_buffer_size().context("a picture that is too large")?];
    decoder.read_image(&mut bytes)?;
    let alike = (f64::from(width) * f64::from(size[1]) / f64::from(height) - f64::from(size[0])).abs() < 2.0;
    Ok(alike.then(|| Shown::shrunk(&bytes, channels, [width, height], size)))
}
