//! Pixels as text inside a page: half floats for the viewer, and PNG for readers without scripts.
use crate::error::Checked;
use crate::image::{Picture, WriteOptions, encode_png};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use half::f16;

/// The part of a picture that a page shows.
pub struct Crop {
    /// First column and row.
    pub first: [u32; 2],
    pub picture: Picture,
}

/// Cuts out the middle of a picture, so that not more than about `pixels` are left. A smaller picture stays whole.
pub fn middle(picture: &Picture, pixels: usize) -> Crop {
    let scale = (pixels as f64 / picture.pixels.len().max(1) as f64).sqrt().min(1.0);
    let shrink = |length: u32| ((f64::from(length) * scale).round() as u32).clamp(1.min(length), length);
    let (width, height) = (shrink(picture.width), shrink(picture.height));
    let first = [(picture.width - width) / 2, (picture.height - height) / 2];
    let row = |y: u32| {
        let start = y as usize * picture.width as usize + first[0] as usize;
        picture.pixels[start..start + width as usize].iter().copied()
    };
    let pixels = (first[1]..first[1] + height).flat_map(row).collect();
    Crop { first, picture: Picture { width, height, pixels } }
}

/// Base64 of the pixels as half floats, little endian: R, G, B of the first pixel, and so on. Values beyond 65504 become
/// 65504, the largest that a half float holds.
pub fn halves(picture: &Picture) -> String {
    let largest = f16::MAX.to_f32();
    let half = |v: &f32| f16::from_f32(v.clamp(-largest, largest)).to_le_bytes();
    let bytes: Vec<u8> = picture.pixels.iter().flatten().flat_map(half).collect();
    STANDARD.encode(bytes)
}

/// Characters of what [`halves`] returns: 8 for the 6 bytes of a pixel.
pub fn length_of_halves(picture: &Picture) -> usize {
    8 * picture.pixels.len()
}

/// Base64 of a PNG file.
///
/// # Errors
/// When the picture has no pixels.
pub fn png(picture: &Picture) -> Checked<String> {
    Ok(STANDARD.encode(encode_png(picture, &WriteOptions::default())?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_picture_loses_its_border_and_a_small_one_nothing() {
        let pixels = (0..32).map(|i| [i as f32; 3]).collect();
        let picture = Picture { width: 8, height: 4, pixels };
        assert_eq!(middle(&picture, 32).picture, picture);
        let crop = middle(&picture, 8);
        assert_eq!((crop.first, crop.picture.width, crop.picture.height), ([2, 1], 4, 2));
        assert_eq!(crop.picture.pixels[0], [10.0; 3]);
        assert_eq!(crop.picture.pixels[7], [21.0; 3]);
    }

    #[test]
    fn half_floats_are_little_endian_and_stay_finite() {
        let picture = Picture { width: 1, height: 1, pixels: vec![[1.0, 1e9, -2.0]] };
        // 0x3c00, 0x7bff and 0xc000.
        assert_eq!(STANDARD.decode(halves(&picture)).unwrap(), [0x00, 0x3c, 0xff, 0x7b, 0x00, 0xc0]);
        assert_eq!(halves(&picture).len(), length_of_halves(&picture));
    }
}
