//! Tells normal maps in tangent space from heights by what pictures hold.
use super::source::Source;
use crate::error::Checked;
use crate::image::{bands, decode, picture};

/// Sums over the texels of a picture.
#[derive(Default)]
struct Sums {
    texels: usize,
    color: [f64; 3],
    /// Texels that are unit vectors.
    vectors: usize,
}

/// Whether most texels are unit vectors, which point out of the surface on average. No picture of greys is like that.
///
/// # Errors
/// What is wrong with the picture.
pub fn are_in(source: Source) -> Checked<bool> {
    let mut sums = Sums::default();
    let coded = |v: u8| f32::from(v) / 255.0;
    match source {
        Source::Bitmap(bitmap) => bitmap.rgba.iter().for_each(|&[r, g, b, _]| sums.add([r, g, b].map(coded))),
        Source::Floats(bytes, _) => decode(&bytes)?.picture(None)?.pixels.into_iter().for_each(|rgb| sums.add(rgb)),
        Source::File(bytes, _) | Source::Deep(bytes, _) => {
            for band in bands(&picture(&bytes)?) {
                band.into_rgb8().pixels().for_each(|p| sums.add(p.0.map(coded)));
            }
        }
    }
    Ok(sums.are_of_normals())
}

impl Sums {
    fn add(&mut self, rgb: [f32; 3]) {
        let squared: f32 = rgb.iter().map(|v| (2.0 * v - 1.0).powi(2)).sum();
        self.texels += 1;
        self.vectors += usize::from((0.8..=1.2).contains(&squared.sqrt()));
        self.color.iter_mut().zip(rgb).for_each(|(sum, v)| *sum += f64::from(v));
    }

    fn are_of_normals(&self) -> bool {
        let [r, g, b] = self.color.map(|sum| sum / self.texels as f64);
        let even = [r, g].iter().all(|v| (0.35..=0.65).contains(v));
        even && b > 0.7 && self.vectors > self.texels / 2
    }
}
