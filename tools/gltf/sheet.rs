//! The sheet of all models: a row of pictures each, below its name.
use crate::{Row, letters};
use anyhow::{Context, ensure};
use image::{ImageFormat, Rgb, RgbImage};
use std::path::Path;

/// Rows of pictures are laid out in so many columns.
const COLUMNS: u32 = 2;
/// Ours and those of five others.
const PICTURES: u32 = 6;
const GAP: u32 = 4;
const LINE: u32 = 14;

/// Refuses a name whose ending is none of those of formats that hold the sheet.
///
/// # Errors
/// For such a name.
pub fn check(path: &Path) -> anyhow::Result<()> {
    let format = ImageFormat::from_path(path);
    let is_known = matches!(format, Ok(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Gif));
    ensure!(is_known, "{}: the sheet is a .png, .jpg or .gif", path.display());
    Ok(())
}

/// Writes the pictures of all models, each `width` pixels wide; higher ones are cut at their lower end, longer names at their right.
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
                let right = 2 * x + dx;
                if right < cell[0] - GAP {
                    sheet.put_pixel(corner[0] + right, corner[1] + 2 * y + dy, Rgb([230; 3]));
                }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_wider_than_its_pictures_is_cut() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.png");
        let row = |name: &str| Row { name: name.to_owned(), pictures: Vec::new() };
        write(&path, 8, &[row(&"H".repeat(30)), row(&"H".repeat(30))]).unwrap();
        let sheet = image::open(path).unwrap().into_rgb8();
        assert_eq!(sheet.dimensions(), (2 * 76, 26));
        // In the row of the strokes across.
        let is_written = |x: u32| sheet.get_pixel(x, GAP + 4).0[0] == 230;
        assert!((76..76 + GAP).all(|x| !is_written(x)) && is_written(76 + GAP));
    }

    #[test]
    fn a_file_that_cannot_hold_the_sheet_is_refused() {
        let is_taken = |name: &str| check(Path::new(name)).is_ok();
        assert!(["sheet.png", "out/sheet.JPG", "sheet.gif"].into_iter().all(is_taken));
        assert!(!["sheet.exr", "sheet.hdr", "sheet", "png/sheet"].into_iter().any(is_taken));
    }
}
