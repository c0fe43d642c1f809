//! How different a sequence of frames looks from its references: ColorVideoVDP (Mantiuk et al. 2024), on a display of 1920 x 1080
//! pixels.
use anyhow::Result;
use colorvideovdp::{Color, Cvvdp, DisplayModel, Image, Options};
use tallow::image::Picture;
use tallow::image::tone::{ToneMap, display};

/// Just-objectionable differences: 10 where none is seen, 1 less for each step that three of four viewers tell. `fps`: frames a
/// second.
///
/// # Errors
/// Pictures below 4 x 4 pixels.
pub fn jod(frames: &[Picture], references: &[&Picture], fps: f32) -> Result<f64> {
    let image = |p: &Picture| {
        let values = p.pixels.iter().flatten().map(|v| display(*v, 0.0, ToneMap::None)).collect();
        Image::new(p.width as usize, p.height as usize, 3, values)
    };
    let frames = frames.iter().map(image).collect::<Result<Vec<_>, _>>()?;
    let references = references.iter().map(|p| image(p)).collect::<Result<Vec<_>, _>>()?;
    let metric = Cvvdp::new(DisplayModel::from_name("standard_fhd")?, Options::default())?;
    Ok(f64::from(metric.predict_video(&frames, &references, fps, Color::Srgb)?.jod))
}
