//! The sheet of all models: a row of pictures each, below its name.
use crate::{Row, letters};
use anyhow::Context;
use image::{Rgb, RgbImage};
use std::path::Path;

/// Rows of pictures are laid out in so many columns.
const COLUMNS: u32 = 2;
/// Ours and those of five others.
const PICTURES: u32 = 6;
const GAP: u32 = 4;
const LINE: u32 = 14;

/// Writes the pictures of all models, each `width` pixels wide; higher ones are cut at their lower end.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, width: u32, rows: &[Row]) -> anyhow::Result<()> {
    let cell = [PICTURES * (width + GAP) + GAP, LINE + width + GAP];
    let lines = (rows.len() as u32).div_ceil(COLUMNS);
    let mut sheet = RgbImage::from_pixel(COLUMNS * cell[0], lines.max(1) * cell[1], Rgb([40; 3]));
    for (index, row) in rows.iter().enumerate() {
        let corner = [index as u32 / lines * cell[0] + GAP, index as u32 % lines * cell[1] + GAP];
        // Twice as large as letters are.
        letters::write(&row.name, |x, y| {
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                sheet.put_pixel(corner[0] + 2 * x + dx, corner[1] + 2 * y + dy, Rgb([230; 3]));
            }
        });
        for (column, (_, picture)) in (0..PICTURES).zip(&row.pictures) {
            let left = corner[0] + column * (width + GAP);
            for (at, (pixel, alpha)) in (0..).zip(picture.pixels.iter().zip(&picture.alpha)) {
                let (x, y) = (at % picture.size[0], at / picture.size[0]);
                if y < width {
                    // What nothing covers is the grey of the sheet.
                    let over = pixel.map(|v| ((v + (1.0 - alpha) * 0.16) * 255.0).round().clamp(0.0, 255.0) as u8);
                    sheet.put_pixel(left + x, corner[1] + LINE - GAP + y, Rgb(over));
                }
            }
        }
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    sheet.save(path).with_context(|| path.display().to_string())
}
